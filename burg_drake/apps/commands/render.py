"""`burg-drake render`: images of a scene; without colours where Drake cannot render them."""

from __future__ import annotations

import argparse
from pathlib import Path

from burg_drake import core, dataset
from burg_drake.apps import options
from burg_drake.apps.terminal import print_warning


def warn_without_colors(consequence: str) -> bool:
    """Whether colours cannot be rendered here; if so, prints to stderr what to install.

    Args:
        consequence: start of the line, such as `the data set has no colours`.
    """
    from burg_drake.system_libraries import describe_missing, missing_render_libraries

    missing = missing_render_libraries()
    if missing:
        print_warning(f"{consequence}: {describe_missing(missing)}")
    return bool(missing)


def without_unavailable_colors(
    recipe: dataset.DatasetRecipe, folder: Path
) -> dataset.DatasetRecipe:
    """The recipe, without colours if they cannot be rendered; a line on stderr says so.

    Args:
        recipe: requested recipe.
        folder: folder of the data set, which may exist.

    Raises:
        MissingDependencyError: the folder has samples with colours, and cannot be continued here.
        DocumentError: its document is damaged, or of another version.
    """
    from dataclasses import replace

    from burg_drake.system_libraries import describe_missing, missing_render_libraries

    missing = missing_render_libraries()
    if not recipe.colors or recipe.renderer != "drake" or not missing:
        return recipe

    document = folder / dataset.DATASET_FILE
    if document.exists() and (dataset.load_dataset_document(document).recipe or {}).get("colors"):
        raise core.MissingDependencyError(
            f"the samples of {folder} have colours, and so must new ones:"
            f" {describe_missing(missing)}"
        )
    dark = ", and its sensor depth no holes at dark surfaces" if recipe.sensor else ""
    warn_without_colors(f"the data set has no colours{dark}")
    return replace(recipe, colors=False)


def add_render_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake render`."""
    parser.epilog = options.examples_text(
        "burg-drake render tabletop_six --camera board -o view.png",
        "burg-drake render tabletop_six --camera overview --arm -o view.png --depth --labels",
        "burg-drake render tabletop_six --renderer blender -o view.png",
        "",
        "Depth, labels and normals are written beside it: view.depth.png (16 bit, 0.1 mm, 0:"
        " none), view.labels.png (instances from 1, 0: the rest), view.normals.png (16 bit,"
        " component = (value - 32768) / 32767, camera frame).",
    )
    options.add_scene(parser)
    options.add_station(parser)
    parser.add_argument(
        "--camera",
        metavar="NAME",
        default="board",
        help="camera of the station (default: %(default)s)",
    )
    options.add_output(parser, "FILE", "file to write (.png)")
    parser.add_argument("--arm", action="store_true", help="show the arm in its home posture")
    options.add_settings_options(parser, dataset.DatasetRecipe, "renderer")
    for kind in ("depth", "labels", "normals"):
        parser.add_argument(f"--{kind}", action="store_true", help=f"also write {kind}")


def run_render(arguments: argparse.Namespace) -> int:
    """Writes the images; returns 1 if none can be rendered."""
    import numpy as np

    from burg_drake.scene import load_scene
    from burg_drake.station import load_station

    output = Path(arguments.output)
    if output.suffix.lower() != ".png":
        raise core.InvalidInputError(f"{output}: only PNG is written; end the name with .png")
    by_drake = arguments.renderer == "drake"
    missing = by_drake and warn_without_colors(f"{output} is not written, as it has colours")
    extra: tuple[dataset.ImageKind, ...] = ("depth", "labels", "normals")
    kinds: list[dataset.ImageKind] = [] if missing else ["color"]
    kinds += [kind for kind in extra if getattr(arguments, kind)]
    if not kinds:
        return 1
    scene, station = load_scene(arguments.scene), load_station(arguments.station)
    view = dataset.station_view(station, arguments.camera, arm=arguments.arm)
    core.require_writable(output)
    images = dataset.render(scene, station, view, kinds, renderer=arguments.renderer)
    for kind in kinds:
        path = output if kind == "color" else output.with_suffix(f".{kind}.png")
        image = getattr(images, kind)
        core.atomic_write(
            path, dataset.encode_image(kind, image, dataset.depth_unit_of(view.depth_range))
        )
        print(f"wrote {path}")
    if images.labels is not None:
        names = [*scene.instances, *scene.background]
        counts = np.bincount(images.labels.ravel(), minlength=len(names) + 1)
        for number, name in enumerate(names, 1):
            print(f"  {number} {name}: {counts[number]} pixels")
    return 0
