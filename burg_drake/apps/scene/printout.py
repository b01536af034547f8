"""`burg-drake printout`: the board of a scene as a PDF."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from burg_drake.apps.options import (
    Parser,
    add_measured_board,
    add_options,
    add_scene,
    add_verb,
    settings_from,
)


def add_to(verbs: Any) -> None:
    """Adds the verb."""
    add_verb(
        verbs,
        "printout",
        run_printout,
        "write the board of a scene as PDF, to print at true scale",
        "burg-drake printout tabletop_six -o board.pdf",
        "burg-drake printout tabletop_six --page A2 -o board.pdf",
        "burg-drake printout tabletop_six --measured-mm 98.5 -o board.pdf",
        "",
        "Print at 100 % and measure the two printed rulers of 100 mm. If they are not 100 mm"
        " long, print again with what they measure, such as --measured-mm 98.5,99.2.",
        options=_add_options,
    )


def _add_options(parser: Parser) -> None:
    from burg_drake.printout import PrintSettings

    add_scene(parser)
    parser.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="file to write (.pdf)"
    )
    add_options(parser, PrintSettings, "page", "margin")
    add_measured_board(
        parser,
        "length of the printed 100 mm rulers along x and y, to correct the print (default: 100)",
    )
    add_options(parser, PrintSettings, "height_map", "names")
    parser.add_argument(
        "--no-instructions",
        action="store_true",
        help="leave out the page of instructions",
    )


def require_pdf(path: str) -> None:
    """Refuses names of other files."""
    from burg_drake.core import InvalidInputError

    if not path.lower().endswith(".pdf"):
        raise InvalidInputError(f"{path}: only PDF is written; end the name with .pdf")


def run_printout(arguments: argparse.Namespace) -> int:
    """Writes the PDF; what is not on it as in the scene goes to stderr."""
    from burg_drake.core.files import require_writable
    from burg_drake.printout import PAPERS, PrintSettings, print_board
    from burg_drake.scene.document import load_scene

    require_pdf(arguments.output)
    x, y = arguments.measured_mm
    settings = settings_from(
        arguments,
        PrintSettings,
        measured=(x * 1e-3, y * 1e-3),
        instructions=not arguments.no_instructions,
    )
    scene = load_scene(arguments.scene)
    require_writable(arguments.output)
    printout = print_board(scene, settings)
    printout.save(arguments.output)
    for warning in printout.warnings:
        print(f"burg-drake: warning: {scene.path}: {warning}", file=sys.stderr)
    tiling = printout.tiling
    columns, rows = len(tiling.x_cuts) + 1, len(tiling.y_cuts) + 1
    across = " landscape" if tiling.paper.width > tiling.paper.height else " portrait"
    if tiling.paper.name not in PAPERS:
        across = ""
    pages = f"{columns} x {rows} pages" if columns * rows > 1 else "1 page"
    told = "instructions and " if printout.first else ""
    print(f"wrote {arguments.output}: {told}{pages} {tiling.paper.name}{across}")
    return 0
