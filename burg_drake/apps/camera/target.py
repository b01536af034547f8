"""`burg-drake camera target`: prints a ChArUco board; and the options that tell which it is."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import Parser, add_measured_board, add_options, add_verb, settings_from

if TYPE_CHECKING:
    from burg_drake.cameras.calibration import CharucoTarget


def add_to(group: Any) -> None:
    """Adds the verb to the group `camera`."""
    add_verb(
        group,
        "target",
        run_target,
        "write a calibration board (ChArUco) as PDF",
        "burg-drake camera target -o target.pdf",
        "burg-drake camera target --page A3 --square-mm 30 --marker-mm 22 -o target.pdf",
        options=_add_options,
    )


def _add_options(target: Parser) -> None:
    from burg_drake.printout import PrintSettings

    target.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="file to write (.pdf)"
    )
    add_options(target, PrintSettings, "page")
    add_measured_board(
        target,
        "length of the 100 mm rulers of an earlier print, to correct this one",
    )
    add_board(target)


def add_board(parser: Any) -> None:
    """The options about the board."""
    from burg_drake.cameras.calibration import CharucoTarget

    board = parser.add_argument_group(
        "calibration board", "The defaults are those of `burg-drake camera target`."
    )
    add_options(board, CharucoTarget)


def given_target(arguments: argparse.Namespace) -> CharucoTarget:
    """The board that the options tell."""
    from burg_drake.cameras.calibration import CharucoTarget

    return settings_from(arguments, CharucoTarget)


def run_target(arguments: argparse.Namespace) -> int:
    """Writes the PDF."""
    from burg_drake.apps.scene import require_pdf
    from burg_drake.cameras.calibration import write_target
    from burg_drake.printout import PrintSettings

    require_pdf(arguments.output)
    x, y = arguments.measured_mm
    settings = settings_from(arguments, PrintSettings, measured=(1e-3 * x, 1e-3 * y))
    target = given_target(arguments)
    paper = write_target(target, arguments.output, settings)
    columns, rows = target.squares
    print(
        f"wrote {arguments.output}: {columns} x {rows} squares of {arguments.square_mm:g} mm on"
        f" {paper.name}; print at 100 %, glue it onto something flat"
    )
    return 0
