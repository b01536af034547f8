"""`burg-drake scene import-burg`: scenes of BURG-Toolkit."""

from __future__ import annotations

import argparse
from typing import Any

from burg_drake.apps.arguments import add_verb


def add_to(group: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        group,
        "import-burg",
        run_import_burg,
        "make a scene of one of BURG-Toolkit",
        "burg-drake library import-burg object_library.yaml -o my_library",
        "burg-drake scene import-burg scene.yaml --library my_library -o my_scene.yaml",
        "burg-drake scene validate my_scene.yaml",
    )
    parser.add_argument("file", metavar="SCENE.yaml", help="scene file of BURG-Toolkit")
    parser.add_argument(
        "--library",
        metavar="LIB",
        required=True,
        help="object library: folder of what `library import-burg` made of the scene's library",
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="scene file to write (.yaml)"
    )
    parser.add_argument("--name", metavar="NAME", help="of the scene (default: that of FILE)")


def run_import_burg(arguments: argparse.Namespace) -> int:
    """Writes a scene document."""
    from pathlib import Path

    from burg_drake.apps.scene_file import library_reference, require_another_file
    from burg_drake.core.names import name_from
    from burg_drake.formats.burg_scene import read_burg_scene
    from burg_drake.objects.library import load_library
    from burg_drake.pipeline.scene_imports import burg_scene_document
    from burg_drake.scene.scene import save_scene

    require_another_file(Path(arguments.file), arguments.output)
    scene = read_burg_scene(arguments.file)
    library = load_library(arguments.library)
    output = Path(arguments.output)
    document = burg_scene_document(
        scene,
        library,
        name=arguments.name or name_from(output.stem),
        reference=library_reference(arguments.library, library, output.parent),
    )
    for note in scene.notes:
        print(note)
    save_scene(document, output)
    fixed = f" and {n} fixed ones" if (n := len(document.background)) else ""
    print(f"wrote {output}: {len(document.instances)} objects{fixed}")
    return 0
