"""`burg-drake scene import-burg`: scenes of BURG-Toolkit."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import add_verb
from burg_drake.core import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.scene.document import Scene


def add_to(group: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        group,
        "import-burg",
        run_import_burg,
        "import a scene of BURG-Toolkit",
        "burg-drake library import-burg object_library.yaml -o my_library",
        "burg-drake scene import-burg scene.yaml --library my_library -o my_scene.yaml",
        "burg-drake scene import-burg scene.yaml --library my_library -o my_scene.yaml"
        " --station-out my_station.yaml",
        "burg-drake scene validate my_scene.yaml",
    )
    parser.add_argument("file", metavar="SCENE.yaml", help="scene file of BURG-Toolkit")
    parser.add_argument(
        "--library",
        metavar="LIB",
        required=True,
        help="library made by `library import-burg`",
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="scene file to write (.yaml)"
    )
    parser.add_argument("--name", metavar="NAME", help="name of the scene (default: that of FILE)")
    parser.add_argument(
        "--station-out",
        metavar="FILE",
        help="also write a station that the scene fits on",
    )


def run_import_burg(arguments: argparse.Namespace) -> int:
    """Writes a scene document."""
    from pathlib import Path

    from burg_drake.apps.scene.references import library_reference, require_another_file
    from burg_drake.core.files import require_writable
    from burg_drake.core.paths import name_from
    from burg_drake.formats.collections import read_burg_scene
    from burg_drake.objects.library import load_library
    from burg_drake.pipeline import import_burg_scene
    from burg_drake.scene.document import load_scene, save_scene

    output = Path(arguments.output)
    for file in filter(None, (arguments.output, arguments.station_out)):
        require_writable(file)
        require_another_file(Path(arguments.file), file)
    if arguments.station_out is not None:
        require_another_file(output, arguments.station_out)
    burg = read_burg_scene(arguments.file)
    library = load_library(arguments.library)
    imported = import_burg_scene(
        burg,
        library,
        name=arguments.name or name_from(output.stem),
        reference=library_reference(arguments.library, library, output.parent),
    )
    for note in (*burg.notes, *imported.notes):
        print(note)
    save_scene(imported.document, output)
    fixed = f" and {n} fixed ones" if (n := len(imported.document.background)) else ""
    print(f"wrote {output}: {len(imported.document.instances)} objects{fixed}")
    _propose_station(load_scene(output), arguments.station_out)
    return 0


def _propose_station(scene: Scene, output: str | None) -> None:
    """Says which station fits, and writes it if that is asked for."""
    from pathlib import Path

    from burg_drake.core.documents import save_document
    from burg_drake.motion.workspace import find_built_in, propose_station

    if output is None:
        try:
            fitting, misfits = find_built_in(scene)
        except InvalidInputError as error:
            print(f"no station fits: {error}")
            return
        _print_fits(fitting.name if fitting else "", misfits)
        if fitting is None:
            print("no built-in station fits; --station-out FILE lays one out around the scene")
        return
    proposal = propose_station(scene, Path(output))
    _print_fits(proposal.source, proposal.misfits)
    save_document(proposal.document, output)
    arm = proposal.document.arm
    where = (
        "without an arm"
        if arm is None
        else "the arm's base at ({:g}, {:g}, {:g}) m".format(*arm.X_WA.translation)
    )
    width, depth, _ = proposal.document.table.size
    print(f"wrote {output}: a table of {width:g} x {depth:g} m, {where}")
    for warning in proposal.warnings:
        print(f"burg-drake: warning: {output}: {warning}", file=sys.stderr)


def _print_fits(fitting: str, misfits: dict[str, str]) -> None:
    for name, reason in misfits.items():
        print(f"station {name} does not fit: {reason}")
    if fitting:
        print(f"station {fitting} fits: --station {fitting}")
