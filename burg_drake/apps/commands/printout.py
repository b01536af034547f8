"""`burg-drake printout` and `camera target`: PDFs of a scene's board and of a calibration board."""

from __future__ import annotations

import argparse
from typing import Any

from burg_drake import cameras, core
from burg_drake.apps import options
from burg_drake.apps.terminal import print_warning


def add_printout_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake printout`."""
    from burg_drake.printout import PrintSettings

    parser.epilog = options.examples_text(
        "burg-drake printout tabletop_six -o board.pdf",
        "burg-drake printout tabletop_six --page A2 -o board.pdf",
        "burg-drake printout tabletop_six --measured-mm 98.5 -o board.pdf",
        "",
        "Print at 100 % and measure the two printed rulers of 100 mm. If they are not 100 mm"
        " long, print again with what they measure, such as --measured-mm 98.5,99.2.",
    )
    options.add_scene(parser)
    options.add_output(parser, "FILE", "file to write (.pdf)")
    options.add_settings_options(parser, PrintSettings, "page", "margin")
    options.add_measured_board(
        parser,
        "length of the printed 100 mm rulers along x and y, to correct the print (default: 100)",
    )
    options.add_settings_options(parser, PrintSettings, "height_map", "names")
    parser.add_argument(
        "--no-instructions", action="store_true", help="leave out the page of instructions"
    )


def require_pdf(path: str) -> None:
    """Refuses a path without the suffix of a PDF."""
    if not path.lower().endswith(".pdf"):
        raise core.InvalidInputError(f"{path}: only PDF is written; end the name with .pdf")


def run_printout(arguments: argparse.Namespace) -> int:
    """Writes the PDF; prints differences from the scene to stderr."""
    from burg_drake.printout import PAPER_SIZES, PrintSettings, print_board
    from burg_drake.scene import load_scene

    require_pdf(arguments.output)
    x, y = arguments.measured_mm
    settings = options.settings_from(
        arguments,
        PrintSettings,
        measured=(x * 1e-3, y * 1e-3),
        instructions=not arguments.no_instructions,
    )
    scene = load_scene(arguments.scene)
    core.require_writable(arguments.output)
    printout = print_board(scene, settings)
    printout.save(arguments.output)
    for warning in printout.warnings:
        print_warning(f"{scene.path}: {warning}")
    tiling = printout.tiling
    columns, rows = len(tiling.x_cuts) + 1, len(tiling.y_cuts) + 1
    across = " landscape" if tiling.paper.width > tiling.paper.height else " portrait"
    if tiling.paper.name not in PAPER_SIZES:
        across = ""
    pages = f"{columns} x {rows} pages" if columns * rows > 1 else "1 page"
    told = "instructions and " if printout.first else ""
    print(f"wrote {arguments.output}: {told}{pages} {tiling.paper.name}{across}")
    return 0


def add_camera_target_options(target: options.Parser) -> None:
    """Adds the options of `burg-drake camera target`."""
    from burg_drake.printout import PrintSettings

    target.epilog = options.examples_text(
        "burg-drake camera target -o target.pdf",
        "burg-drake camera target --page A3 --square-mm 30 --marker-mm 22 -o target.pdf",
    )
    options.add_output(target, "FILE", "file to write (.pdf)")
    options.add_settings_options(target, PrintSettings, "page")
    options.add_measured_board(
        target, "length of the 100 mm rulers of an earlier print, to correct this one"
    )
    add_target_board_options(target)


def add_target_board_options(parser: Any) -> None:
    """Adds the options about the calibration board."""
    board = parser.add_argument_group(
        "calibration board", "The defaults are those of `burg-drake camera target`."
    )
    options.add_settings_options(board, cameras.CharucoTarget)


def target_from_options(arguments: argparse.Namespace) -> cameras.CharucoTarget:
    """The calibration board from options."""
    return options.settings_from(arguments, cameras.CharucoTarget)


def run_camera_target(arguments: argparse.Namespace) -> int:
    """Writes the PDF."""
    from burg_drake.printout import PrintSettings

    require_pdf(arguments.output)
    x, y = arguments.measured_mm
    settings = options.settings_from(arguments, PrintSettings, measured=(1e-3 * x, 1e-3 * y))
    target = target_from_options(arguments)
    paper = cameras.write_target(target, arguments.output, settings)
    columns, rows = target.squares
    print(
        f"wrote {arguments.output}: {columns} x {rows} squares of {arguments.square_mm:g} mm on"
        f" {paper.name}; print at 100 %, glue it onto something flat"
    )
    return 0
