"""`burg-drake scene sample`: random scenes from a recipe, one or thousands."""

from __future__ import annotations

import argparse
import os
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake import core, generation
from burg_drake.apps import options
from burg_drake.apps.terminal import print_remark, print_warning, show_progress

if TYPE_CHECKING:
    from burg_drake.objects import ObjectLibrary
    from burg_drake.scene import Scene, SceneDocument, SceneRecipe
    from burg_drake.station import Station


def require_another_file(scene: Path, output: str) -> None:
    """Refuses to overwrite the scene that is read.

    Raises:
        InvalidInputError: both paths are the same file.
    """
    if os.path.realpath(output) == os.path.realpath(scene):
        raise core.InvalidInputError(f"-o {output} is the scene itself; choose another file")


def add_scene_sample_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake scene sample`."""
    parser.epilog = options.examples_text(
        "burg-drake scene sample household -n 5 --seed 7 -o scene.yaml",
        "burg-drake scene sample household -n 6 --spacing close --count 1000 --workers 2 -o close/",
        "burg-drake scene sample household -n 10 --heap --station panda_bin -o heap.yaml",
        "burg-drake scene sample household -n 3 --within-reach --clear-grasps 5 --visible-from"
        " board -o scene.yaml",
        "burg-drake scene sample --again close/scene_0007.yaml -o same.yaml",
        "",
        "A scene is sampled again until it meets all rules, and is settled in simulation. The"
        " same command continues where an interrupted one stopped; a larger --count adds scenes."
        " Exit code 1 if scenes are missing; scenes.csv says why.",
    )
    parser.add_argument(
        "library",
        metavar="LIBRARY",
        nargs="?",
        help="folder of a library, or the built-in household",
    )
    options.add_output(parser, "SCENES", "folder to write, or for one scene a file (.yaml)")
    options.add_recipe_options(parser)
    parser.add_argument(
        "--again",
        metavar="SCENE",
        help="make this scene again, from the origin recorded in its file",
    )
    parser.add_argument(
        "--force",
        action="store_true",
        help="with --again, even if library, station or versions differ",
    )
    options.add_quiet(parser)


def run_scene_sample(arguments: argparse.Namespace) -> int:
    """Writes random scenes; returns 1 if not all were accepted."""
    from burg_drake.objects import load_library
    from burg_drake.station import load_station

    single = Path(arguments.output).suffix.lower() in (".yaml", ".yml")
    if (arguments.library is None) == (arguments.again is None):
        raise core.InvalidInputError("give a LIBRARY to sample from, or --again SCENE")
    if arguments.again is not None:
        _refuse_recipe_options(arguments)
        return _reproduce_scene(arguments)
    if arguments.force:
        raise core.InvalidInputError("--force goes with --again")
    if single and arguments.count > 1:
        raise core.InvalidInputError(
            f"-o {arguments.output} is a file, for a single scene; give a folder for"
            f" {arguments.count}"
        )
    library, station = load_library(arguments.library), load_station(arguments.station)
    output = Path(arguments.output)
    recipe = options.recipe_from_options(
        arguments, library, station, output.parent if single else output
    )
    if single:
        return _sample_one(arguments, recipe, library, station)
    arguments.after_interrupt = "; what is done is kept, run the same command to continue"
    return _sample_many(arguments, recipe, library, station)


def _sample_one(
    arguments: argparse.Namespace, recipe: SceneRecipe, library: ObjectLibrary, station: Station
) -> int:
    """Samples one scene and writes its file."""
    from burg_drake.scene import save_scene

    core.require_writable(arguments.output)
    attempts, quiet = recipe.attempts, arguments.quiet
    with show_progress("sampling", "attempts at most", attempts, quiet=quiet) as pace:
        sampled = generation.SceneSampler(recipe, library, station).sample(0, refused=pace.step)
    if sampled.accepted:
        save_scene(sampled.scene.document, arguments.output)
    _print_refused(Counter(sampled.refused))
    if not sampled.accepted:
        print_remark(f"no scene: {_refusal_text(sampled, recipe)}")
        return 1
    if sampled.missing:
        print_remark(f"no place was found for {', '.join(sampled.missing)}")
    print(f"wrote {arguments.output}: {core.count_with_noun(sampled.placed, 'object')}")
    return 0


def _sample_many(
    arguments: argparse.Namespace, recipe: SceneRecipe, library: ObjectLibrary, station: Station
) -> int:
    """Samples many scenes into a folder."""
    with core.Reporter(not arguments.quiet) as reporter:
        paces: list[core.ProgressMeter] = []

        def begin(known: int) -> None:
            event = core.Progress("starting", known, arguments.count, unit="scenes")
            paces.append(core.ProgressMeter(reporter.show, event, "sampling"))

        found = generation.sample_scenes(
            recipe,
            library,
            station,
            arguments.output,
            arguments.count,
            workers=arguments.workers,
            known=begin,
            progress=lambda sampled: paces[0].step(),
        )
    return _print_folder(found, arguments)


def _print_folder(found: generation.SampledFolder, arguments: argparse.Namespace) -> int:
    refused: Counter[str] = Counter()
    for row in found.rows.values():
        refused.update(row.refused)
    _print_refused(refused)
    accepted = sum(row.accepted for row in found.rows.values())
    fewer = sum(bool(row.accepted and row.missing) for row in found.rows.values())
    new = f" ({len(found.new)} new)" if len(found.new) < len(found.rows) else ""
    print(f"{arguments.output}: {accepted} of {arguments.count} scenes accepted{new}")
    if fewer:
        print(
            f"{fewer} of them have fewer than {core.count_with_noun(arguments.objects, 'object')};"
            " see scenes.csv"
        )
    if found.failed:
        number, reason = min(found.failed.items())
        print_remark(
            f"{len(found.failed)} scenes could not be sampled, and are tried again the"
            f" next time; scene {number}: {reason}"
        )
    return 0 if accepted == arguments.count else 1


def _refuse_recipe_options(arguments: argparse.Namespace) -> None:
    """Refuses options of a recipe with --again, which uses the recipe of its scene.

    Raises:
        InvalidInputError: such an option is given.
    """
    parser = argparse.ArgumentParser(add_help=False)
    options.add_recipe_options(parser)
    for name, default in vars(parser.parse_args([])).items():
        if getattr(arguments, name) != default:
            raise core.InvalidInputError(
                f"--again takes the recipe of its scene: leave out {arguments.flags[name]}"
            )


def _reproduce_scene(arguments: argparse.Namespace) -> int:
    """Reproduces a scene, and prints whether it is the same."""
    from burg_drake.scene import load_scene, save_scene

    scene = load_scene(arguments.again)
    require_another_file(scene.path, arguments.output)
    if Path(arguments.output).suffix.lower() not in (".yaml", ".yml"):
        raise core.InvalidInputError(f"-o {arguments.output} has to be a scene file (.yaml)")
    core.require_writable(arguments.output)
    again = generation.sample_again(scene, force=arguments.force)
    for line in again.differences:
        print_warning(f"{scene.path}: {line}")
    if again.scene is None:
        print_remark(f"{scene.path}: no scene was accepted this time")
        return 1
    save_scene(
        _with_references(again, again.scene, Path(arguments.output).parent), arguments.output
    )
    print(f"wrote {arguments.output}: {'the same scene' if again.same else 'another scene'}")
    return 0 if again.same else 1


def _with_references(
    again: generation.ReproducedScene, scene: Scene, folder: Path
) -> SceneDocument:
    """A scene's document with references relative to a folder."""
    from dataclasses import replace

    document, origin = scene.document, scene.document.origin
    assert origin is not None
    library = core.name_or_reference(document.library, "models", scene.library.root, folder)
    station = core.name_or_reference(origin.recipe.station, "stations", again.station.path, folder)
    recipe = replace(origin.recipe, library=library, station=station)
    return replace(document, library=library, origin=replace(origin, recipe=recipe))


def _print_refused(refused: Counter[str]) -> None:
    """Prints to standard error how many attempts were refused, and why."""
    for reason, count in refused.most_common():
        print_remark(f"{count} refused: {reason}")


def _refusal_text(sampled: generation.SampledScene, recipe: SceneRecipe) -> str:
    """Text on why no attempt was accepted, with advice."""
    text = f"none of {sampled.attempts} attempts was accepted"
    if sampled.missing:
        text += "; an object found no place (--fewer accepts scenes without it)"
    return f"{text}; give a larger --size, a smaller -n, another --seed or more --attempts"
