"""`burg-drake camera target`: prints a ChArUco board; and the options that tell which it is."""

from __future__ import annotations

import argparse
import re
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import add_measured_board, add_verb, positive

if TYPE_CHECKING:
    from burg_drake.cameras.calibration import CharucoTarget


def add_to(group: Any) -> None:
    """Adds the verb to the group `camera`."""
    target = add_verb(
        group,
        "target",
        run_target,
        "print a ChArUco board to calibrate cameras with, as a PDF at true scale",
        "burg-drake camera target -o target.pdf",
        "burg-drake camera target --page A3 --square-mm 30 --marker-mm 22 -o target.pdf",
    )
    target.add_argument("-o", "--output", metavar="FILE", required=True, help="PDF to write")
    target.add_argument(
        "--page", default="A4", help="A4, A3, letter, ... or WxH in mm (default: %(default)s)"
    )
    add_measured_board(
        target,
        "what the rulers of 100 mm of an earlier print measured, for a printer that scales",
    )
    add_board(target)


def add_board(parser: Any) -> None:
    """The options about the board."""
    board = parser.add_argument_group("the board", "what `burg-drake camera target` printed")
    board.add_argument(
        "--squares",
        metavar="CxR",
        type=two_numbers,
        default=(8, 11),
        help="columns and rows (default: 8x11)",
    )
    board.add_argument(
        "--square-mm", type=positive, default=20.0, help="side of a square (default: %(default)g)"
    )
    board.add_argument(
        "--marker-mm", type=positive, default=14.0, help="side of a marker (default: %(default)g)"
    )
    board.add_argument(
        "--dictionary",
        default="5X5_100",
        help=("ArUco dictionary of the markers (default: %(default)s)"),
    )
    board.add_argument(
        "--legacy",
        action="store_true",
        help="a board of OpenCV before 4.6: with an even number of rows, white in the upper left",
    )


def given_target(arguments: argparse.Namespace) -> CharucoTarget:
    """The board that the options tell."""
    from burg_drake.cameras.calibration import CharucoTarget

    return CharucoTarget(
        squares=arguments.squares,
        square=1e-3 * arguments.square_mm,
        marker=1e-3 * arguments.marker_mm,
        dictionary=arguments.dictionary,
        legacy=arguments.legacy,
    )


def run_target(arguments: argparse.Namespace) -> int:
    """Writes the PDF."""
    from burg_drake.apps.scene import require_pdf
    from burg_drake.cameras.calibration import write_target
    from burg_drake.printout import PrintSettings

    require_pdf(arguments.output)
    x, y = arguments.measured_mm
    settings = PrintSettings(page=arguments.page, measured=(1e-3 * x, 1e-3 * y))
    target = given_target(arguments)
    paper = write_target(target, arguments.output, settings)
    columns, rows = target.squares
    print(
        f"wrote {arguments.output}: {columns} x {rows} squares of {arguments.square_mm:g} mm on"
        f" {paper.name}; print at 100 %, glue it onto something flat"
    )
    return 0


def two_numbers(text: str) -> tuple[int, int]:
    """`AxB` of whole numbers from 1."""
    found = re.fullmatch(r"([1-9]\d*)[x×]([1-9]\d*)", text.strip().lower())
    if found is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not two whole numbers, such as 8x11")
    return int(found[1]), int(found[2])
