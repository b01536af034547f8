"""`burg-drake dataset`: generate, check, show and export training data."""

from __future__ import annotations

import argparse
import glob
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.dataset import export, show
from burg_drake.apps.dataset.colors import with_possible_colors
from burg_drake.apps.options import (
    Parser,
    add_cluster,
    add_group,
    add_options,
    add_quiet,
    add_station,
    add_verb,
    add_workers,
    positive_int,
)

if TYPE_CHECKING:
    from burg_drake.dataset.generating import DatasetRecipe
    from burg_drake.objects.library import ObjectLibrary
    from burg_drake.scene.document import Scene, SceneRecipe
    from burg_drake.station.document import Station


def add_to(verbs: Any) -> None:
    """Adds the verbs."""
    group = add_group(verbs, "dataset", "make training data: images, labels, grasps")
    add_verb(
        group,
        "generate",
        run_generate,
        "render images with labels of many scenes",
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
        options=_add_generate_options,
    )
    add_verb(
        group,
        "check",
        run_check,
        "look for damaged files and wrong depth or labels",
        "burg-drake dataset check data",
        options=_add_data,
    )
    show.add_to(group)
    export.add_to(group)


def _add_data(parser: Parser) -> None:
    parser.add_argument("data", metavar="DATA", help="folder of the data set")


def _add_generate_options(parser: Parser) -> None:
    from burg_drake.dataset.generating import DatasetRecipe
    from burg_drake.scene.document import SceneRecipe

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
        type=positive_int,
        help=f"objects in a sampled scene (default: {SceneRecipe.count})",
    )
    add_station(parser)
    parser.add_argument(
        "-o",
        "--output",
        metavar="DATA",
        required=True,
        help="folder to write; the same command continues it",
    )
    parser.add_argument(
        "--camera",
        metavar="NAME",
        nargs="+",
        help="sphere (around the scene), wrist, or cameras of the station (default: sphere)",
    )
    for name in ("views", "sensor", "renderer", "normals", "colors", "seed"):
        default = getattr(DatasetRecipe(), name)
        shown = None if isinstance(default, bool) or default == "" else default
        add_options(parser, DatasetRecipe, name, unset=True, shown_default=shown)
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
    who = parser.add_mutually_exclusive_group()
    add_workers(who, "worker processes (default: %(default)d)", default=1)
    add_cluster(who)
    add_quiet(parser)


def run_generate(arguments: argparse.Namespace) -> int:
    """Writes a data set; 1 if some scenes have no samples."""
    from burg_drake.core import InvalidInputError
    from burg_drake.core.terminal import Progress, ProgressMeter, Reporter
    from burg_drake.dataset.generating import generate_dataset
    from burg_drake.dataset.samples import load_dataset
    from burg_drake.station.document import load_station

    station = load_station(arguments.station)
    recipe = _recipe(arguments)
    scenes: list[Scene] | ObjectLibrary
    if arguments.sample is not None:
        scenes, count, sampled = _sampling(arguments, recipe, station)
        recipe = _replaced(recipe, sampled=sampled)
    elif arguments.objects is not None:
        raise InvalidInputError(
            f"-n {arguments.objects} is for sampled scenes; leave it out, or give --sample"
        )
    else:
        scenes = _given_scenes(arguments.scenes)
        count = len(scenes)
    recipe = with_possible_colors(recipe, Path(arguments.output))
    arguments.after_interrupt = "; what is done is kept, run the same command to continue"
    with Reporter(not arguments.quiet) as reporter:
        pace = ProgressMeter(reporter.show, Progress("rendering", 0, count, unit="scenes"))
        found = generate_dataset(
            scenes,
            station,
            arguments.output,
            recipe,
            count=None if arguments.sample is None else count,
            workers=arguments.workers,
            cluster=arguments.cluster,
            progress=lambda number, error: pace.step(),
        )
    for number, error in found.failed.items():
        print(f"burg-drake: scene {number}: {error}", file=sys.stderr)
    samples = len(load_dataset(found.folder))
    old = f", {len(found.known)} were there" if found.known else ""
    print(f"{found.folder}: {samples} samples of {len(found.new)} new scenes{old}")
    return 1 if found.failed else 0


def _recipe(arguments: argparse.Namespace) -> DatasetRecipe:
    from dataclasses import replace

    from burg_drake.core import declared
    from burg_drake.core.documents import load_document
    from burg_drake.dataset.generating import DatasetRecipe

    recipe = DatasetRecipe()
    if arguments.recipe is not None:
        recipe = load_document(Path(arguments.recipe), DatasetRecipe)
    given = {name: getattr(arguments, name, None) for name in declared(DatasetRecipe)}
    values: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    values["normals"] = arguments.normals or recipe.normals
    values["colors"] = recipe.colors and not arguments.no_colors
    if arguments.camera:
        values["viewpoints"] = replace(recipe.viewpoints, cameras=tuple(arguments.camera))
    if arguments.plain:
        values["looks"] = None
    return _replaced(recipe, **values, **_grasps(arguments.grasps))


def _replaced(recipe: DatasetRecipe, **values: Any) -> DatasetRecipe:
    from dataclasses import replace

    return replace(recipe, **values)


def _grasps(text: str | None) -> dict[str, Any]:
    from burg_drake.core import InvalidInputError

    if text is None:
        return {}
    if not text.startswith("sample:"):
        return {"run": text, "grasps_per_object": 0}
    number = text.removeprefix("sample:")
    if not number.isdecimal() or int(number) < 1:
        raise InvalidInputError(f"--grasps {text}: give a number of grasps, as in sample:100")
    return {"grasps_per_object": int(number), "run": ""}


def _given_scenes(references: list[str]) -> list[Scene]:
    from burg_drake.core import InvalidInputError
    from burg_drake.scene.document import load_scene

    names: list[str] = []
    for reference in references:
        if glob.has_magic(reference):
            files = sorted(glob.glob(reference))
            if not files:
                raise InvalidInputError(f"--scenes {reference}: there is no such file")
            names += files
        else:
            names.append(reference)
    return [load_scene(name) for name in names]


def _sampling(
    arguments: argparse.Namespace, asked: DatasetRecipe, station: Station
) -> tuple[ObjectLibrary, int, SceneRecipe]:
    from dataclasses import replace

    from burg_drake.apps.scene import library_reference, station_reference
    from burg_drake.core import InvalidInputError
    from burg_drake.objects.library import load_library
    from burg_drake.scene.document import SceneRecipe

    name, colon, count = arguments.sample.rpartition(":")
    if not colon or not count.isdecimal() or int(count) < 1:
        raise InvalidInputError(
            f"--sample {arguments.sample}: give a library and a number of scenes, as in"
            " household:1000"
        )
    library = load_library(name)
    folder = Path(arguments.output) / "scenes"
    reference = library_reference(name, library, folder)
    sampled = asked.sampled or SceneRecipe(library=reference, seed=asked.seed)
    sampled = replace(
        sampled,
        library=reference,
        count=sampled.count if arguments.objects is None else arguments.objects,
        seed=sampled.seed if arguments.seed is None else arguments.seed,
        station=station_reference(arguments.station, station, folder),
    )
    return library, int(count), sampled


def run_check(arguments: argparse.Namespace) -> int:
    """Prints what is wrong with a data set; 1 if anything is."""
    from burg_drake.dataset.generating import check_generated
    from burg_drake.dataset.samples import load_dataset

    found = check_generated(arguments.data)
    for finding in found:
        print(f"{finding.sample or arguments.data}: {finding.file}: {finding.message}")
    if found:
        return 1
    print(f"{arguments.data}: {len(load_dataset(arguments.data))} samples, nothing is wrong")
    return 0
