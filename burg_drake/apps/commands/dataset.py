"""`burg-drake dataset`: generate, check, show and export training data."""

from __future__ import annotations

import argparse
import glob
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake import core
from burg_drake.apps import options
from burg_drake.apps.commands.render import without_unavailable_colors
from burg_drake.apps.terminal import print_remark, print_warning, show_progress

if TYPE_CHECKING:
    from burg_drake.dataset import DatasetRecipe, ReadableSamples
    from burg_drake.objects import ObjectLibrary
    from burg_drake.scene import Scene, SceneRecipe
    from burg_drake.station import Station


def warn_of_damage(samples: ReadableSamples) -> bool:
    """Prints each damaged shard or file to stderr; returns whether samples were left out."""
    for message, count in samples.damaged.items():
        left_out = f"{count} sample{'s are' if count > 1 else ' is'} left out"
        print_warning(f"{left_out}: {message}")
    return bool(samples.damaged)


def add_dataset_show_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake dataset show`."""
    parser.epilog = options.examples_text(
        "burg-drake dataset show data",
        "burg-drake dataset show data --sample 000012_003 --html sample.html",
        "burg-drake dataset show data -o sheet.html",
        "burg-drake dataset show data -o sheet.png --rows 6",
    )
    parser.add_argument("data", metavar="DATA", help="folder of the data set")
    parser.add_argument("--sample", metavar="KEY", help="sample to show (default: the first)")
    options.add_output(parser, "FILE", "write a sheet of samples (.png, .html)", required=False)
    parser.add_argument(
        "--rows",
        metavar="N",
        type=options.positive_int,
        default=4,
        help="rows of the sheet (default: 4)",
    )
    parser.add_argument(
        "--columns",
        metavar="N",
        type=options.positive_int,
        default=1,
        help="columns of the sheet (default: 1)",
    )
    options.add_view_options(parser)


def run_dataset_show(arguments: argparse.Namespace) -> int:
    """Shows a sample in 3D, or writes a sheet; leaves out damaged samples, and lists them."""
    from burg_drake.apps.terminal import open_view, present_view, print_legend
    from burg_drake.dataset import (
        ReadableSamples,
        contact_sheet,
        evenly_spaced_indices,
        load_dataset,
        sample_caption,
        show_sample,
    )

    dataset = load_dataset(arguments.data)
    if not len(dataset):
        raise core.InvalidInputError(f"{arguments.data} has no samples to show")
    samples, key = ReadableSamples(dataset), arguments.sample
    chosen = None if key is None else dataset[dataset.index(key)]
    rows, columns = arguments.rows, arguments.columns
    if arguments.output is not None:
        indices = evenly_spaced_indices(len(dataset), rows * columns)
        shown = [chosen] if chosen is not None else list(samples.read(indices))
        contact_sheet(shown, arguments.output, rows, columns, title=dataset.name)
        print(f"wrote {arguments.output}")
        if arguments.html is None:
            warn_of_damage(samples)
            return 0
    sample = chosen if chosen is not None else next(iter(samples))
    warn_of_damage(samples)
    scene, station = dataset.scene(sample.scene), dataset.station
    meshcat = open_view(arguments)
    legend = show_sample(sample, scene, station, meshcat)
    print_legend(legend)
    title = f"{dataset.name} {sample.key}"
    present_view(meshcat, arguments, title=title, caption=[sample_caption(sample)], legend=legend)
    return 0


EXPORT_FORMATS = {
    "bop": ("sensor_depth", "depth_unit"),
    "coco": (),
    "graspnet": ("sensor_depth",),
    "webdataset": ("depth_unit",),
}
"""Depth options by export format."""


def add_dataset_export_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake dataset export`."""
    parser.epilog = options.examples_text(
        "burg-drake dataset export data --to bop -o data_bop",
        "burg-drake dataset export data --to graspnet --sensor-depth -o data_graspnet",
        "",
        "Damaged samples are named and left out; the exit code is then 1.",
    )
    parser.add_argument("data", metavar="DATA", help="folder of the data set")
    parser.add_argument("--to", required=True, choices=tuple(EXPORT_FORMATS), help="format")
    options.add_output(parser, "FOLDER", "folder to write, new or empty")
    parser.add_argument(
        "--sensor-depth",
        action="store_true",
        help="write the depth of the imitated camera, not the exact one",
    )
    parser.add_argument(
        "--depth-unit",
        metavar="METRES",
        type=options.positive,
        help="unit of depth images (default: 0.0001; graspnet: 0.001)",
    )


def run_dataset_export(arguments: argparse.Namespace) -> int:
    """Writes a data set in another format; prints what the format cannot store to stderr. Returns
    1 if damaged samples were left out."""
    from burg_drake.dataset import (
        ReadableSamples,
        load_dataset,
        write_bop,
        write_coco,
        write_graspnet,
        write_webdataset,
    )

    writers: dict[str, Any] = {
        "bop": write_bop,
        "coco": write_coco,
        "graspnet": write_graspnet,
        "webdataset": write_webdataset,
    }
    given = {"sensor_depth": arguments.sensor_depth or None, "depth_unit": arguments.depth_unit}
    depth = {name: value for name, value in given.items() if value is not None}
    for name in depth:
        if name not in EXPORT_FORMATS[arguments.to]:
            known = [one for one, taken in EXPORT_FORMATS.items() if name in taken]
            raise core.InvalidInputError(
                f"{arguments.to} takes no {name.replace('_', ' ')}, which"
                f" {' and '.join(known)} take"
            ).about(name)
    samples = ReadableSamples(load_dataset(arguments.data))
    for remark in writers[arguments.to](samples, arguments.output, **depth):
        print_warning(remark)
    damaged = warn_of_damage(samples)
    written = len(samples) - sum(samples.damaged.values())
    print(f"wrote {arguments.output}: {written} samples")
    return int(damaged)


def add_dataset_check_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake dataset check`."""
    parser.epilog = options.examples_text("burg-drake dataset check data")
    parser.add_argument("data", metavar="DATA", help="folder of the data set")


def add_dataset_generate_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake dataset generate`."""
    from burg_drake.dataset import DatasetRecipe
    from burg_drake.scene import SceneRecipe

    parser.epilog = options.examples_text(
        "burg-drake dataset generate --scenes 'scenes/*.yaml' --views 20 -o data",
        "burg-drake dataset generate --sample household:1000 -n 6 --workers 2 -o data",
        "burg-drake dataset generate --scenes tabletop_six --sensor d435 --grasps sample:100"
        " -o data",
        "burg-drake dataset generate --scenes tabletop_six --camera wrist --grasps runs/first"
        " -o data",
        "burg-drake dataset generate --scenes scenes/*.yaml --cluster cluster.yaml -o data",
        "",
        "The same command continues where an interrupted one stopped. The same seed gives the"
        " same data. data/dataset.yaml has a recipe for --recipe.",
    )
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument(
        "--scenes",
        metavar="SCENE",
        nargs="+",
        help="scene files, patterns of files, or built-in scenes",
    )
    source.add_argument(
        "--sample", metavar="LIBRARY:COUNT", help="sample COUNT scenes from a library"
    )
    parser.add_argument(
        "-n",
        metavar="N",
        dest="objects",
        type=options.positive_int,
        help=f"objects in a sampled scene (default: {SceneRecipe.count})",
    )
    options.add_station(parser)
    options.add_output(parser, "DATA", "folder to write; the same command continues it")
    parser.add_argument(
        "--camera",
        metavar="NAME",
        nargs="+",
        help="sphere (around the scene), wrist, or cameras of the station (default: sphere)",
    )
    for name in ("views", "sensor", "renderer", "normals", "colors", "seed"):
        default = getattr(DatasetRecipe(), name)
        shown = None if isinstance(default, bool) or default == "" else default
        options.add_settings_options(parser, DatasetRecipe, name, unset=True, shown_default=shown)
    parser.add_argument(
        "--plain",
        action="store_true",
        help="no variation of light, textures, distractors and noise",
    )
    parser.add_argument(
        "--grasps",
        metavar="RUN|sample:N",
        help="grasps of a run with outcomes, or N sampled on each object",
    )
    parser.add_argument(
        "--recipe", metavar="FILE", help="YAML file with settings that have no option"
    )
    workers_group = parser.add_mutually_exclusive_group()
    options.add_workers(workers_group, "worker processes (default: %(default)d)", default=1)
    options.add_cluster(workers_group)
    options.add_quiet(parser)


def run_dataset_generate(arguments: argparse.Namespace) -> int:
    """Writes a data set; 1 if some scenes have no samples."""
    from burg_drake.dataset import generate_dataset, load_dataset
    from burg_drake.station import load_station

    station = load_station(arguments.station)
    recipe = _recipe_from_options(arguments)
    scenes: list[Scene] | ObjectLibrary
    if arguments.sample is not None:
        scenes, count, sampled = _parse_sample_option(arguments, recipe, station)
        recipe = replace(recipe, sampled=sampled)
    elif arguments.objects is not None:
        raise core.InvalidInputError(
            f"-n {arguments.objects} is for sampled scenes; leave it out, or give --sample"
        )
    else:
        scenes = _load_scenes(arguments.scenes)
        count = len(scenes)
    recipe = without_unavailable_colors(recipe, Path(arguments.output))
    arguments.after_interrupt = "; what is done is kept, run the same command to continue"
    with show_progress("rendering", "scenes", count, quiet=arguments.quiet) as pace:
        generated = generate_dataset(
            scenes,
            station,
            arguments.output,
            recipe,
            count=None if arguments.sample is None else count,
            workers=arguments.workers,
            cluster=arguments.cluster,
            progress=lambda number, error: pace.step(),
        )
    for number, error in generated.failed.items():
        print_remark(f"scene {number}: {error}")
    samples = len(load_dataset(generated.folder))
    known = len(generated.known)
    old = f", {known} {'was' if known == 1 else 'were'} there" if known else ""
    new = core.count_with_noun(len(generated.new), "new scene")
    print(f"{generated.folder}: {core.count_with_noun(samples, 'sample')} in all; {new}{old}")
    return 1 if generated.failed else 0


def _recipe_from_options(arguments: argparse.Namespace) -> DatasetRecipe:
    from burg_drake.dataset import DatasetRecipe

    recipe = DatasetRecipe()
    if arguments.recipe is not None:
        recipe = core.load_document(Path(arguments.recipe), DatasetRecipe)
    given = {name: getattr(arguments, name, None) for name in core.declared_fields(DatasetRecipe)}
    values: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    values["normals"] = arguments.normals or recipe.normals
    values["colors"] = recipe.colors and not arguments.no_colors
    if arguments.camera:
        values["viewpoints"] = replace(recipe.viewpoints, cameras=tuple(arguments.camera))
    if arguments.plain:
        values["looks"] = None
    return replace(recipe, **values, **_parse_grasps_option(arguments.grasps))


def _parse_grasps_option(text: str | None) -> dict[str, Any]:
    if text is None:
        return {}
    if not text.startswith("sample:"):
        return {"run": text, "grasps_per_object": 0}
    number = text.removeprefix("sample:")
    if not number.isdecimal() or int(number) < 1:
        raise core.InvalidInputError(f"--grasps {text}: give a number of grasps, as in sample:100")
    return {"grasps_per_object": int(number), "run": ""}


def _load_scenes(references: list[str]) -> list[Scene]:
    from burg_drake.scene import load_scene

    names: list[str] = []
    for reference in references:
        if glob.has_magic(reference):
            files = sorted(glob.glob(reference))
            if not files:
                raise core.InvalidInputError(f"--scenes {reference}: there is no such file")
            names += files
        else:
            names.append(reference)
    return [load_scene(name) for name in names]


def _parse_sample_option(
    arguments: argparse.Namespace, requested: DatasetRecipe, station: Station
) -> tuple[ObjectLibrary, int, SceneRecipe]:
    from burg_drake.objects import load_library
    from burg_drake.scene import SceneRecipe

    name, colon, count = arguments.sample.rpartition(":")
    if not colon or not count.isdecimal() or int(count) < 1:
        raise core.InvalidInputError(
            f"--sample {arguments.sample}: give a library and a number of scenes, as in"
            " household:1000"
        )
    library = load_library(name)
    folder = Path(arguments.output) / "scenes"
    reference = core.name_or_reference(name, "models", library.root, folder)
    sampled = requested.sampled or SceneRecipe(library=reference, seed=requested.seed)
    sampled = replace(
        sampled,
        library=reference,
        count=sampled.count if arguments.objects is None else arguments.objects,
        seed=sampled.seed if arguments.seed is None else arguments.seed,
        station=core.name_or_reference(arguments.station, "stations", station.path, folder),
    )
    return library, int(count), sampled


def run_dataset_check(arguments: argparse.Namespace) -> int:
    """Prints the errors of a data set; returns 1 if there are any."""
    from burg_drake.dataset import check_generated, load_dataset

    found = check_generated(arguments.data)
    for finding in found:
        print(f"{finding.sample or arguments.data}: {finding.file}: {finding.message}")
    if found:
        return 1
    print(f"{arguments.data}: {len(load_dataset(arguments.data))} samples, nothing is wrong")
    return 0
