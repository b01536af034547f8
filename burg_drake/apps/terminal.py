"""Terminal output and Meshcat views of commands, and their reaction to Ctrl-C and SIGTERM."""

from __future__ import annotations

import argparse
import contextlib
import logging
import select
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from burg_drake import core, visualization

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat
    from rich.text import Text


def print_remark(text: str) -> None:
    """Prints a line about the work of a command to standard error."""
    print(f"burg-drake: {text}", file=sys.stderr, flush=True)


def print_warning(text: str) -> None:
    """Prints a warning to standard error."""
    print_remark(f"warning: {text}")


def print_note_lines(notes: Iterable[str]) -> None:
    """Prints notes on the results, one per line."""
    for note in notes:
        print(f"note: {note}")


@contextlib.contextmanager
def show_progress(
    phase: str, unit: str, total: float = 0, *, quiet: bool = False
) -> Iterator[core.ProgressMeter]:
    """Shows the progress of a job on standard error until the block is left.

    Args:
        phase: name of the job, such as `sampling`.
        unit: noun of the counted things.
        total: their number; 0 if unknown.
        quiet: show nothing.
    """
    with core.Reporter(not quiet) as reporter:
        yield core.ProgressMeter(reporter.show, core.Progress(phase, total=total, unit=unit))


def wait_for_interrupt() -> NoReturn:
    """Waits, in the main thread, for Ctrl-C; see `sigterm_as_interrupt`.

    The system may deliver a signal in any thread. Python handles it in the main thread, which the
    signal does not wake from a wait without timeout.

    Raises:
        KeyboardInterrupt: at Ctrl-C.
    """
    poll_interval = 0.5  # Seconds between checks for an interrupt.
    while True:
        time.sleep(poll_interval)


def sigterm_as_interrupt() -> contextlib.AbstractContextManager[None]:
    """Makes SIGTERM act like Ctrl-C, so that commands finish cleanly."""
    return _handle_signal(signal.SIGTERM, signal.default_int_handler)


def ignore_interrupts() -> contextlib.AbstractContextManager[None]:
    """Ignores Ctrl-C while the last results are written: an interrupt would lose them."""
    return _handle_signal(signal.SIGINT, signal.SIG_IGN)


@contextlib.contextmanager
def _handle_signal(number: signal.Signals, handler: Any) -> Iterator[None]:
    """Replaces the handler of a signal during the block, if this is the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(number, handler)
    try:
        yield
    finally:
        signal.signal(number, before)


def print_legend(legend: Sequence[visualization.LegendEntry | visualization.ColorBar]) -> None:
    """Prints the legend of colours; for numbers a histogram, the colour bar and its ticks."""
    from rich.console import Console
    from rich.text import Text

    console = Console()
    for entry in legend:
        if isinstance(entry, visualization.ColorBar):
            for line in _color_bar_lines(entry, with_colors=console.color_system is not None):
                console.print(line, no_wrap=True, crop=False, overflow="ignore")
        else:
            console.print(Text("■ ", style=entry.color) + Text(entry.label, style="default"))


def _color_bar_lines(bar: visualization.ColorBar, with_colors: bool) -> list[Text]:
    columns_per_bin = 2  # Terminal columns per bin of a colour bar.
    block_characters = " ▁▂▃▄▅▆▇█"
    from rich.text import Text

    peak = max(1, *bar.counts)
    levels = [-(-count * (len(block_characters) - 1) // peak) for count in bar.counts]  # rounded up
    histogram, colors = Text(), Text()
    for level, color in zip(levels, bar.colors, strict=True):
        histogram.append(block_characters[level] * columns_per_bin, style=color)
        colors.append("█" * columns_per_bin, style=color)
    lines = [Text(bar.title), histogram, *([colors] if with_colors else [])]
    lines.append(Text(tick_line(bar.ticks, columns_per_bin * len(bar.colors))))
    return [*lines, Text(bar.note)] if bar.note else lines


def tick_line(ticks: Sequence[tuple[float, str]], width: int) -> str:
    """The line of tick labels below a bar of `width` columns, as far as there is room.

    Args:
        ticks: positions along the bar in [0, 1], increasing, and labels; the first and the last
            label are always shown.
    """
    (_, first), *inner, (_, last) = ticks
    line = first
    end = width - len(last)
    for position, text in inner:
        start = round(position * width - len(text) / 2)
        if start > len(line) and start + len(text) < end:
            line = line.ljust(start) + text
    return line.ljust(max(end, len(line) + 1)) + last


def open_view(arguments: argparse.Namespace) -> Meshcat:
    """Opens Meshcat for a command; first checks that the page can be written.

    Raises:
        InvalidInputError: the page's folder cannot be written, or the port is taken.
    """
    from pathlib import Path

    if arguments.html is not None:
        page = Path(arguments.html)
        if page.is_dir():
            raise core.InvalidInputError(
                f"--html {page} is a folder; give a file such as {page}/view.html"
            )
        core.ensure_writable_folder(page.parent)
    logging.getLogger("drake").setLevel(logging.WARNING)  # pydrake sets it when imported
    return visualization.open_meshcat(arguments.port)


def present_view(
    meshcat: Meshcat,
    arguments: argparse.Namespace,
    *,
    title: str,
    caption: Sequence[str] = (),
    legend: Sequence[visualization.LegendEntry | visualization.ColorBar] = (),
    controls: visualization.GraspPicker | None = None,
) -> None:
    """Saves the page if --html was given; else prints the address and waits, but for --no-wait.

    Args:
        meshcat: the view.
        arguments: parsed options of `add_view_options`.
        title: title of the page.
        caption: lines of the page.
        legend: legend of the page.
        controls: controls of the page; the live view has a slider of Meshcat instead.
    """
    if arguments.html is not None:
        visualization.save_html(
            meshcat, arguments.html, title=title, caption=caption, legend=legend, controls=controls
        )
        print(f"wrote {arguments.html}")
        return
    if arguments.no_wait:  # the address would be invalid before anyone could open it
        print(f"{title}: not kept open; give --html FILE for a page that stays")
        return
    print(f"{title}: open {meshcat.web_url()} in a browser", flush=True)
    if controls is not None:
        controls.add_slider(meshcat)
    meshcat.Flush()
    wait_for_user(None if controls is None else lambda: controls.follow_slider(meshcat))


def wait_for_user(poll: Callable[[], None] | None = None) -> None:
    """Returns on Enter (at a terminal) or Ctrl-C.

    Args:
        poll: called several times a second until then.
    """
    poll_interval = 0.1  # Seconds between checks of a live view's controls.
    terminal = sys.stdin is not None and sys.stdin.isatty()
    try:
        key = "Enter" if terminal else "Ctrl-C"
        print(f"It is served until you press {key}.", flush=True)
        while True:
            if poll is not None:
                poll()
            if not terminal:
                time.sleep(poll_interval)
            elif select.select([sys.stdin], [], [], poll_interval)[0]:
                return
    except KeyboardInterrupt:
        print()


def open_in_browser(url: str) -> None:
    """Opens a page in the user's browser; prints a message if there is no browser."""
    import webbrowser

    if not webbrowser.open(url):
        print_remark("no browser was found to open it in")
