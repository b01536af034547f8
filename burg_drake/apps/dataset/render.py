"""`burg-drake render`: one look at a scene, as image files."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.dataset.colors import warn_without_colors
from burg_drake.apps.options import Parser, add_options, add_scene, add_station, add_verb

if TYPE_CHECKING:
    from burg_drake.dataset.rendering import Images


def add_to(verbs: Any) -> None:
    """Adds the verb."""
    add_verb(
        verbs,
        "render",
        run_render,
        "render what a camera of the station sees",
        "burg-drake render tabletop_six --camera board -o view.png",
        "burg-drake render tabletop_six --camera overview --arm -o view.png --depth --labels",
        "burg-drake render tabletop_six --renderer blender -o view.png",
        "",
        "Depth, labels and normals are written beside it: view.depth.png (16 bit, 0.1 mm, 0:"
        " none), view.labels.png (instances from 1, 0: the rest), view.normals.png (16 bit,"
        " component = (value - 32768) / 32767, camera frame).",
        options=_add_options,
    )


def _add_options(parser: Parser) -> None:
    from burg_drake.dataset.generating import DatasetRecipe

    add_scene(parser)
    add_station(parser)
    parser.add_argument(
        "--camera",
        metavar="NAME",
        default="board",
        help="camera of the station (default: %(default)s)",
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="file to write (.png)"
    )
    parser.add_argument("--arm", action="store_true", help="show the arm in its home posture")
    add_options(parser, DatasetRecipe, "renderer")
    for kind in ("depth", "labels", "normals"):
        parser.add_argument(f"--{kind}", action="store_true", help=f"also write {kind}")


def run_render(arguments: argparse.Namespace) -> int:
    """Writes the images; 1 if there is none that can be made."""
    from burg_drake.core import InvalidInputError
    from burg_drake.core.files import atomic_write, require_writable
    from burg_drake.dataset.rendering import ImageKind, render, station_view
    from burg_drake.dataset.samples import depth_unit_of, encode_image
    from burg_drake.scene.document import load_scene
    from burg_drake.station.document import load_station

    output = Path(arguments.output)
    if output.suffix.lower() != ".png":
        raise InvalidInputError(f"{output}: only PNG is written; end the name with .png")
    kinds: list[ImageKind] = []
    by_drake = arguments.renderer == "drake"
    if not (by_drake and warn_without_colors(f"{output} is not written, as it has colours")):
        kinds.append("color")
    if arguments.depth:
        kinds.append("depth")
    if arguments.labels:
        kinds.append("labels")
    if arguments.normals:
        kinds.append("normals")
    if not kinds:
        return 1
    scene, station = load_scene(arguments.scene), load_station(arguments.station)
    view = station_view(station, arguments.camera, arm=arguments.arm)
    require_writable(output)
    images = render(scene, station, view, kinds, renderer=arguments.renderer)
    for kind in kinds:
        path = output if kind == "color" else output.with_suffix(f".{kind}.png")
        image = getattr(images, kind)
        atomic_write(path, encode_image(kind, image, depth_unit_of(view.depth_range)))
        print(f"wrote {path}")
    if images.labels is not None:
        _print_numbers(images, [*scene.instances, *scene.background])
    return 0


def _print_numbers(images: Images, names: list[str]) -> None:
    import numpy as np

    assert images.labels is not None
    counts = np.bincount(images.labels.ravel(), minlength=len(names) + 1)
    for number, name in enumerate(names, 1):
        print(f"  {number} {name}: {counts[number]} pixels")
