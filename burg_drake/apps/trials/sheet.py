"""`burg-drake trials sheet`: the protocol of trials for the lab, as a page to print."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import add_verb
from burg_drake.apps.trials.arguments import add_moved, add_sheet, add_show_simulated

if TYPE_CHECKING:
    from burg_drake.experiment.pages import TriedRuns


def add_to(verbs: Any) -> None:
    """Adds the verb to the group `trials`."""
    parser = add_verb(
        verbs,
        "sheet",
        run_sheet,
        "write a paper form: order, pictures, boxes to tick",
        "burg-drake trials sheet trials.yaml -o sheet.html",
        "burg-drake trials sheet trials.yaml -o sheet.html --show-simulated",
        "",
        "Print the page on A4 or letter. The board of each scene lies beside it, as"
        " sheet_SCENE.pdf.",
    )
    add_sheet(parser)
    add_moved(parser)
    parser.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="page to write (.html)"
    )
    add_show_simulated(parser)
    parser.add_argument(
        "--no-printouts", action="store_true", help="do not write the boards to print"
    )


def run_sheet(arguments: argparse.Namespace) -> int:
    """Writes the page, and the printed boards."""
    from burg_drake.core.files import atomic_write, require_writable
    from burg_drake.experiment.pages import SheetOptions, TrialPictures, TriedRuns, sheet_page

    require_writable(arguments.output)
    runs = TriedRuns(arguments.trials, dict(arguments.moved))
    page = Path(arguments.output)
    printouts = {} if arguments.no_printouts else _printouts(runs, page)
    options = SheetOptions(show_simulated=arguments.show_simulated, printouts=printouts)
    atomic_write(page, sheet_page(runs, TrialPictures(runs), options))
    print(f"wrote {page}: {len(runs.sheet.trials)} trials")
    return 0


def _printouts(runs: TriedRuns, page: Path) -> dict[int, str]:
    """Writes the board of each scene; returns the files' names by block."""
    from burg_drake.core import BurgError
    from burg_drake.experiment.pages import in_blocks
    from burg_drake.printout import PrintSettings, print_board

    names: dict[int, str] = {}
    written: dict[str, str] = {}
    for block, trials in in_blocks(runs.sheet).items():
        scene = runs.of(trials[0]).scene
        if scene.content not in written:
            taken = f"_{block}" if f"{page.stem}_{scene.name}.pdf" in written.values() else ""
            name = f"{page.stem}_{scene.name}{taken}.pdf"
            try:
                print_board(scene, PrintSettings(instructions=True)).save(page.with_name(name))
            except BurgError as error:
                message = f"burg-drake: warning: no printed board of {scene.name}: {error}"
                print(message, file=sys.stderr)
                continue
            written[scene.content] = name
            print(f"wrote {page.with_name(name)}")
        names[block] = written[scene.content]
    return names
