"""`burg-drake trials record`, `show` and `restore`: outcomes of trials on the robot.

Begins with the arguments that all commands of `burg-drake trials` share.
"""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Sequence
from datetime import date, datetime
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

from burg_drake import core, experiment
from burg_drake.apps import options
from burg_drake.apps.terminal import print_note_lines, print_remark

if TYPE_CHECKING:
    from burg_drake.cameras import PlacementCheck


def add_trials_argument(parser: options.Parser) -> None:
    """Adds the argument TRIALS."""
    parser.add_argument("trials", metavar="TRIALS", help="trials file of `trials plan`")


def add_moved_run_option(parser: options.Parser) -> None:
    """Adds the option --run, for folders that have moved."""
    parser.add_argument(
        "--run",
        dest="moved",
        metavar="KEY=FOLDER",
        type=partial(options.key_and_value, form="KEY=FOLDER"),
        action="append",
        default=[],
        help="folder of a run, if it has moved",
    )


def add_show_simulated_option(parser: options.Parser, more: str = "") -> None:
    """Adds the option --show-simulated, for commands whose output operators see.

    Args:
        parser: parser that gets the option.
        more: text after "the simulated outcomes" on what else is hidden.
    """
    parser.add_argument(
        "--show-simulated",
        action="store_true",
        help=f"show the simulated outcomes{more}; hidden to keep operators blind",
    )


def print_damage(book: experiment.TrialBook) -> bool:
    """Prints damaged lines of the journal to standard error. Returns True if there are any."""
    damage = book.damage()
    if damage:
        print_remark(damage)
    return bool(damage)


def add_trials_record_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake trials record`."""
    parser.epilog = options.examples_text(
        "burg-drake trials record trials.yaml 17 --outcome lifted",
        "burg-drake trials record trials.yaml next --outcome slipped --note 'wet fingers'",
        "burg-drake trials record trials.yaml 17 --photo photo.png --intrinsics K.yaml",
        "burg-drake trials record trials.yaml 17 --outcome dropped --correct",
        "",
        "Only this trial changes in the file; a journal beside it keeps every entry. Exit code 1"
        " if a photo does not show the board; the rest is recorded.",
    )
    add_trials_argument(parser)
    parser.add_argument("number", metavar="NUMBER", help="number of the trial, or next")
    parser.add_argument(
        "--outcome", metavar="OUTCOME", help="outcome, such as lifted, slipped, no_ik"
    )
    for name, what in (("note", "a note"), ("operator", "name of the operator")):
        parser.add_argument(f"--{name}", metavar="TEXT", help=what)
    parser.add_argument(
        "--time",
        metavar="TIME",
        type=_parse_moment,
        help="time in ISO 8601, or a day (default: now)",
    )
    robot = parser.add_argument_group("what the robot measured at the end")
    robot.add_argument(
        "--width-mm", metavar="MM", type=options.not_negative, help="distance between the pads"
    )
    robot.add_argument("--effort-n", metavar="N", type=options.not_negative, help="gripping force")
    _add_photo_options(parser.add_argument_group("photo of the scene before the trial"))
    add_moved_run_option(parser)
    mode_group = parser.add_mutually_exclusive_group()
    mode_group.add_argument("--correct", action="store_true", help="replace the entry")
    mode_group.add_argument(
        "--again", action="store_true", help="the trial was repeated: replace all its entries"
    )


def _add_photo_options(group: Any) -> None:
    group.add_argument("--photo", metavar="FILE", help="photo, copied to photos/")
    options.add_intrinsics(
        group, "intrinsics of the camera; the placement of objects is then measured"
    )
    group.add_argument("--depth", metavar="FILE", help="depth image of the same camera")
    options.add_depth_unit(group)
    group.add_argument("--scene", metavar="SCENE", help="scene file (default: the run's copy)")
    options.add_measured_board(group)
    group.add_argument(
        "--placement", metavar="FILE", help="placement file of `camera placement`, if there is one"
    )


def run_trials_record(arguments: argparse.Namespace) -> int:
    """Measures the placement and records a trial; returns 1 if the photo shows no board."""
    _require_consistent_record_options(arguments)
    if arguments.outcome is not None:
        experiment.parse_real_outcome(arguments.outcome)
    book = experiment.TrialBook(arguments.trials)
    sheet = book.sheet()
    trial = book.trial(_resolve_trial_number(arguments.number, sheet))
    entry = _entry_from_options(arguments)
    book.require_open(trial, entry, correct=arguments.correct, again=arguments.again)
    check = _placement_check(arguments, sheet, trial)
    problem = "" if check is None else check.reason
    measured = None if problem else check
    if arguments.photo or check is not None:
        photo = experiment.save_photo_and_placement(
            arguments.trials, trial.number, photo=arguments.photo, check=measured
        )
        entry |= {"photo": photo} if photo else {}
    if measured is not None:
        entry["placement"] = experiment.summarize_placements(measured)
    recorded = _record_trial(book, arguments, trial, entry)
    if arguments.photo and not (arguments.intrinsics or arguments.placement):
        print("no placement was measured: --intrinsics FILE of the camera is missing")
    _print_recorded(recorded, book.sheet(), measured)
    if arguments.width_mm is not None:
        _warn_of_width(arguments, sheet, recorded)
    if problem:
        print_remark(f"{arguments.photo}: {problem}; recorded without placement")
    return 1 if problem else 0


def _record_trial(
    book: experiment.TrialBook,
    arguments: argparse.Namespace,
    trial: experiment.RealTrial,
    entry: dict[str, Any],
) -> experiment.RealTrial:
    """Records a trial. `next` is the trial that is first open when this is called; with a photo or
    placement, it must still be the trial that these belong to."""
    replacing = {"correct": arguments.correct, "again": arguments.again}
    if arguments.number != "next":
        return book.record(trial.number, **replacing, **entry)
    if not (arguments.photo or arguments.placement):
        return book.record("next", **replacing, **entry)
    try:
        return book.record(trial.number, expected=trial, **replacing, **entry)
    except experiment.TrialChanged as error:
        kept = f", but the photo is kept as {entry['photo']}" if "photo" in entry else ""
        raise core.InvalidInputError(
            f"{error}; nothing was recorded{kept}: give the number of its trial instead of next"
        ) from error


def _resolve_trial_number(text: str, sheet: experiment.TrialSheet) -> int | Literal["next"]:
    max_digits = 9
    if text == "next":
        return "next"
    if text.isascii() and text.isdecimal() and len(text) < max_digits:
        return int(text)
    numbers = [trial.number for trial in sheet.trials]
    span = f", {min(numbers)} to {max(numbers)}," if numbers else ""
    raise core.InvalidInputError(
        f"{core.quote_value(text)}: give the number of a trial{span} or next"
    )


def _parse_moment(text: str) -> str:
    """A time, with the local time zone if there is none, or a day."""
    try:
        with contextlib.suppress(ValueError):
            return date.fromisoformat(text).isoformat()
        moment = datetime.fromisoformat(text)
        return (moment if moment.tzinfo else moment.astimezone()).isoformat()
    except (ValueError, OverflowError) as error:
        raise argparse.ArgumentTypeError(
            f"{core.quote_value(text)} is not a time; give ISO 8601 such as 2026-05-04T16:30"
        ) from error


def _require_consistent_record_options(arguments: argparse.Namespace) -> None:
    """Refuses options whose required other option is missing, and calls that record nothing."""
    photo_options = ("intrinsics", "depth", "depth_unit", "scene")
    if not arguments.photo:
        for name in photo_options:
            if getattr(arguments, name) is not None:
                raise core.InvalidInputError(
                    f"{arguments.flags[name]} is for photos; add --photo FILE"
                )
    elif arguments.depth and not arguments.intrinsics:
        raise core.InvalidInputError("--depth needs --intrinsics FILE of its camera")
    if arguments.placement and arguments.intrinsics:
        raise core.InvalidInputError(
            "--placement is already a measurement; leave out either it or --intrinsics"
        )
    if not (_entry_from_options(arguments) or arguments.photo or arguments.placement):
        raise core.InvalidInputError(
            "nothing to record; give --outcome, --note or --photo, for example"
        )


def _entry_from_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """The entry from options, without photo and placement."""

    def given(*names: str) -> dict[str, Any]:
        return {name: v for name in names if (v := getattr(arguments, name)) is not None}

    entry, robot = given("outcome", "note", "operator", "time"), given("width_mm", "effort_n")
    if not arguments.correct:  # a correction may replace them by empty text
        entry = {k: v for k, v in entry.items() if k not in ("note", "operator") or v.strip()}
    return entry | ({"robot": robot} if robot else {})


def _placement_check(
    arguments: argparse.Namespace, sheet: experiment.TrialSheet, trial: experiment.RealTrial
) -> PlacementCheck | None:
    """The placement check from a file or the photo; None if not requested."""
    if arguments.placement:
        from burg_drake.cameras import load_placement

        check = load_placement(arguments.placement)
        experiment.require_scene_of_trial(check.scene, sheet, trial, arguments.placement)
        return check
    if not arguments.photo or not arguments.intrinsics:
        return None
    from burg_drake.scene import load_scene

    if arguments.scene:
        scene = load_scene(arguments.scene)
        experiment.require_scene_of_trial(scene, sheet, trial, arguments.scene)
    else:
        run = experiment.load_source_run(
            sheet, arguments.trials, trial.run, moved=dict(arguments.moved)
        )
        scene = run.scene()
    return experiment.measure_placement(
        scene,
        arguments.photo,
        arguments.intrinsics,
        depth=arguments.depth,
        depth_unit=arguments.depth_unit,
        scale=options.print_scale_from_options(arguments),
    )


def _warn_of_width(
    arguments: argparse.Namespace, sheet: experiment.TrialSheet, trial: experiment.RealTrial
) -> None:
    """Prints a warning if a width exceeds the opening of the hand, if the run is available."""
    with contextlib.suppress(core.BurgError):
        run = experiment.load_source_run(
            sheet, arguments.trials, trial.run, moved=dict(arguments.moved)
        )
        hand = run.station().hand
        if arguments.width_mm > 1e3 * hand.opening[1]:
            print_remark(
                f"--width-mm {arguments.width_mm:g} is recorded, but hand"
                f" {hand.name!r} opens {1e3 * hand.opening[1]:g} mm"
            )


def _print_recorded(
    trial: experiment.RealTrial, sheet: experiment.TrialSheet, check: PlacementCheck | None
) -> None:
    from burg_drake.apps.commands.camera_placement import placement_table

    if check is not None:
        placement_table(check.instances).show()
    outcome = "no outcome yet" if trial.outcome is None else trial.outcome.value
    print(f"trial {trial.number}: {outcome} ({trial.grasp})")
    left = sum(not other.carried_out for other in sheet.trials)
    if sheet.next is not None:
        print(
            f"{left} of {len(sheet.trials)} left; next is {sheet.next.number}: {sheet.next.grasp}"
        )
    else:
        print("all trials have an outcome")


def add_trials_show_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake trials show`."""
    parser.epilog = options.examples_text(
        "burg-drake trials show trials.yaml",
        "burg-drake trials show trials.yaml --all",
        "",
        "Exit code 1 if the file lacks entries of its journal, as after an editor saved an old"
        " version: `trials restore` brings them back.",
    )
    add_trials_argument(parser)
    parser.add_argument("--all", action="store_true", help="also print a line for each trial")
    add_show_simulated_option(parser, " and the notes on the selection")


def run_trials_show(arguments: argparse.Namespace) -> int:
    """Prints the trials; returns 1 if entries are missing, or the journal is damaged."""
    book = experiment.TrialBook(arguments.trials)
    sheet = book.sheet()
    for key, run in sheet.runs.items():
        print(f"run {key}: {run.hash}, scene {run.scene.name}, mode {run.mode}, in {run.path}")
    if arguments.all:
        _print_trials(sheet.trials, arguments.show_simulated)
    _print_progress(sheet, arguments.show_simulated)
    has_results = any(trial.carried_out for trial in sheet.trials)
    print_note_lines(() if has_results or not arguments.show_simulated else sheet.notes)
    if sheet.next is not None:
        print(f"next is {sheet.next.number}: {sheet.next.grasp}")
    missing = book.missing_values()
    _print_missing_entries(arguments.trials, missing)
    damage = print_damage(book)
    return 1 if damage or any(found.values for found in missing) else 0


def _print_progress(sheet: experiment.TrialSheet, simulated: bool) -> None:
    """Prints the number of finished trials and their outcomes, by object."""
    table = core.TextTable().names("object")
    table.numbers("trials", "done", "tried")
    table.numbers(*(["success\nin simulation"] if simulated else []), "success\non the robot")
    success = sheet.selection.success

    def row(name: str, trials: Sequence[experiment.RealTrial], *, bold: bool = False) -> None:
        outcomes = [t.outcome for t in trials if t.outcome is not None]
        counts = (
            len(trials),
            len(outcomes),
            sum(outcome.attempted for outcome in outcomes),
            *(
                [sum(experiment.is_success(t.simulated, success) for t in trials)]
                if simulated
                else []
            ),
            sum(experiment.is_success(outcome, success) for outcome in outcomes),
        )
        table.row(name, *map(str, counts), bold=bold)

    for name in sorted({trial.object for trial in sheet.trials}):
        row(name, [trial for trial in sheet.trials if trial.object == name])
    row("all", sheet.trials, bold=True)
    table.show()


def _print_trials(trials: Sequence[experiment.RealTrial], simulated: bool) -> None:
    table = core.TextTable().numbers("trial", "block").texts("grasp", "outcome", "note")
    table.texts(*(["simulated"] if simulated else []))
    for trial in trials:
        outcome = "" if trial.outcome is None else trial.outcome.value
        cells = [str(trial.number), str(trial.block), trial.grasp, outcome, trial.note]
        table.row(*cells, *([trial.simulated.value] if simulated else []))
    table.show()


def _print_missing_entries(path: str, missing: Sequence[experiment.MissingValues]) -> None:
    """Prints the entries of the journal that are missing in the file."""
    for found in missing:
        if found.values:
            text = ", ".join(
                f"{name} {value}" if isinstance(value, str) else name
                for name, value in found.values.items()
            )
            print_remark(f"trial {found.number} lacks what was recorded: {text}")
        if found.edited:
            print(f"trial {found.number}: {', '.join(found.edited)} edited by hand since recorded")
    if any(found.values for found in missing):
        print_remark(
            f"`burg-drake trials restore {path}` brings it back; with --keep the file"
            " stays as it is"
        )


def add_trials_restore_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake trials restore`."""
    parser.epilog = options.examples_text(
        "burg-drake trials restore trials.yaml",
        "burg-drake trials restore trials.yaml --number 17",
        "burg-drake trials restore trials.yaml --number 17 --keep",
        "",
        "Values that were edited by hand stay.",
    )
    add_trials_argument(parser)
    parser.add_argument(
        "--number",
        metavar="N",
        type=options.positive_int,
        action="append",
        help="number of a trial (default: all); repeatable",
    )
    parser.add_argument(
        "--keep", action="store_true", help="keep the file as it is; it is right, not the journal"
    )


def run_trials_restore(arguments: argparse.Namespace) -> int:
    """Restores entries from the journal and prints them; returns 1 if it is damaged."""
    book = experiment.TrialBook(arguments.trials)
    for number in arguments.number or ():
        book.trial(number)
    done = (book.keep if arguments.keep else book.restore)(arguments.number)
    what = "kept as it is in the file" if arguments.keep else "restored"
    for trial in done:
        outcome = "no outcome" if trial.outcome is None else trial.outcome.value
        print(f"trial {trial.number}: {what}, {outcome}")
    if not done:
        print("nothing to restore")
    return 1 if print_damage(book) else 0
