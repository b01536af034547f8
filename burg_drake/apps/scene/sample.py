"""`burg-drake scene sample`: scenes drawn from a recipe, one or thousands."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import Parser, add_quiet, add_verb
from burg_drake.apps.scene.recipe import add_recipe, recipe_defaults, recipe_of, written

if TYPE_CHECKING:
    from burg_drake.generation import ReproducedScene, SampledFolder, SampledScene
    from burg_drake.objects.library import ObjectLibrary
    from burg_drake.scene.document import Scene, SceneDocument, SceneRecipe
    from burg_drake.station.document import Station


def add_to(group: Any) -> None:
    """Adds the verb."""
    add_verb(
        group,
        "sample",
        run_sample,
        "make random scenes from the objects of a library",
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
        options=_add_options,
    )


def _add_options(parser: Parser) -> None:
    parser.add_argument(
        "library",
        metavar="LIBRARY",
        nargs="?",
        help="folder of a library, or the built-in household",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="SCENES",
        required=True,
        help="folder to write, or for one scene a file (.yaml)",
    )
    add_recipe(parser)
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
    add_quiet(parser)


def run_sample(arguments: argparse.Namespace) -> int:
    """Writes scenes; 1 if not all were accepted."""
    from burg_drake.core import InvalidInputError
    from burg_drake.objects.library import load_library
    from burg_drake.station.document import load_station

    single = Path(arguments.output).suffix.lower() in (".yaml", ".yml")
    if (arguments.library is None) == (arguments.again is None):
        raise InvalidInputError("give a LIBRARY to sample from, or --again SCENE")
    if arguments.again is not None:
        _require_no_recipe(arguments)
        return _again(arguments)
    if arguments.force:
        raise InvalidInputError("--force goes with --again")
    if single and arguments.count > 1:
        raise InvalidInputError(
            f"-o {arguments.output} is a file, for a single scene; give a folder for"
            f" {arguments.count}"
        )
    library, station = load_library(arguments.library), load_station(arguments.station)
    output = Path(arguments.output)
    recipe = recipe_of(arguments, library, station, output.parent if single else output)
    if single:
        return _one(arguments, recipe, library, station)
    arguments.after_interrupt = "; what is done is kept, run the same command to continue"
    return _many(arguments, recipe, library, station)


def _one(
    arguments: argparse.Namespace, recipe: SceneRecipe, library: ObjectLibrary, station: Station
) -> int:
    """Writes one file."""
    from burg_drake.core.files import require_writable
    from burg_drake.core.terminal import Progress, ProgressMeter, Reporter
    from burg_drake.generation import SceneSampler
    from burg_drake.scene.document import save_scene

    require_writable(arguments.output)
    with Reporter(not arguments.quiet) as reporter:
        pace = ProgressMeter(
            reporter.show, Progress("sampling", 0, recipe.attempts, unit="attempts at most")
        )
        sampled = SceneSampler(recipe, library, station).sample(0, refused=pace.step)
    if sampled.accepted:
        save_scene(sampled.scene.document, arguments.output)
    _print_refused(Counter(sampled.refused))
    if not sampled.accepted:
        print(f"burg-drake: no scene: {_refusal_text(sampled, recipe)}", file=sys.stderr)
        return 1
    _print_missing(sampled)
    print(f"wrote {arguments.output}: {_objects(sampled.placed)}")
    return 0


def _many(
    arguments: argparse.Namespace, recipe: SceneRecipe, library: ObjectLibrary, station: Station
) -> int:
    """Fills a folder."""
    from burg_drake.core.terminal import Progress, ProgressMeter, Reporter
    from burg_drake.generation import sample_scenes

    with Reporter(not arguments.quiet) as reporter:
        paces: list[ProgressMeter] = []

        def begin(known: int) -> None:
            event = Progress("starting", known, arguments.count, unit="scenes")
            paces.append(ProgressMeter(reporter.show, event, "sampling"))

        found = sample_scenes(
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


def _print_folder(found: SampledFolder, arguments: argparse.Namespace) -> int:
    refused: Counter[str] = Counter()
    for row in found.rows.values():
        refused.update(row.refused)
    _print_refused(refused)
    accepted = sum(row.accepted for row in found.rows.values())
    fewer = sum(bool(row.accepted and row.missing) for row in found.rows.values())
    new = f" ({len(found.new)} new)" if len(found.new) < len(found.rows) else ""
    print(f"{arguments.output}: {accepted} of {arguments.count} scenes accepted{new}")
    if fewer:
        print(f"{fewer} of them have fewer than {_objects(arguments.objects)}; see scenes.csv")
    if found.failed:
        number, reason = min(found.failed.items())
        print(
            f"burg-drake: {len(found.failed)} scenes could not be sampled, and are tried again the"
            f" next time; scene {number}: {reason}",
            file=sys.stderr,
        )
    return 0 if accepted == arguments.count else 1


def _require_no_recipe(arguments: argparse.Namespace) -> None:
    """Refuses options of a recipe beside --again, which has that of its scene.

    Raises:
        InvalidInputError: there is one.
    """
    from burg_drake.core import InvalidInputError

    for name, default in recipe_defaults().items():
        if getattr(arguments, name) != default:
            raise InvalidInputError(
                f"--again takes the recipe of its scene: leave out {written(name)}"
            )


def _again(arguments: argparse.Namespace) -> int:
    """Makes a scene again, and says whether it is the same."""
    from burg_drake.apps.scene.references import require_another_file
    from burg_drake.core import InvalidInputError
    from burg_drake.core.files import require_writable
    from burg_drake.generation import sample_again
    from burg_drake.scene.document import load_scene, save_scene

    scene = load_scene(arguments.again)
    require_another_file(scene.path, arguments.output)
    if Path(arguments.output).suffix.lower() not in (".yaml", ".yml"):
        raise InvalidInputError(f"-o {arguments.output} has to be a scene file (.yaml)")
    require_writable(arguments.output)
    again = sample_again(scene, force=arguments.force)
    for line in again.differences:
        print(f"burg-drake: warning: {scene.path}: {line}", file=sys.stderr)
    if again.scene is None:
        print(f"burg-drake: {scene.path}: no scene was accepted this time", file=sys.stderr)
        return 1
    save_scene(
        _with_references(again, again.scene, Path(arguments.output).parent), arguments.output
    )
    print(f"wrote {arguments.output}: {'the same scene' if again.same else 'another scene'}")
    return 0 if again.same else 1


def _with_references(again: ReproducedScene, scene: Scene, folder: Path) -> SceneDocument:
    """A scene's document whose references start from a folder."""
    from dataclasses import replace

    from burg_drake.apps.scene.references import library_reference, station_reference

    document, origin = scene.document, scene.document.origin
    assert origin is not None
    library = library_reference(document.library, scene.library, folder)
    station = station_reference(origin.recipe.station, again.station, folder)
    recipe = replace(origin.recipe, library=library, station=station)
    return replace(document, library=library, origin=replace(origin, recipe=recipe))


def _print_refused(refused: Counter[str]) -> None:
    """Says on standard error how many attempts were refused, and why."""
    for reason, count in refused.most_common():
        print(f"burg-drake: {count} refused: {reason}", file=sys.stderr)


def _refusal_text(sampled: SampledScene, recipe: SceneRecipe) -> str:
    """Why no attempt was accepted, and what helps."""
    text = f"none of {sampled.attempts} attempts was accepted"
    if sampled.missing:
        text += "; an object found no place (--fewer accepts scenes without it)"
    return f"{text}; give a larger --size, a smaller -n, another --seed or more --attempts"


def _print_missing(sampled: SampledScene) -> None:
    if sampled.missing:
        names = ", ".join(sampled.missing)
        print(f"burg-drake: no place was found for {names}", file=sys.stderr)


def _objects(count: int) -> str:
    return f"{count} object" if count == 1 else f"{count} objects"
