"""Makes a sampled scene again, from what its file says of its origin."""

from __future__ import annotations

from dataclasses import dataclass

from burg_drake.core import InvalidInputError
from burg_drake.core.paths import resolve
from burg_drake.generation.sample import SceneSampler, provenance_of
from burg_drake.scene.document import Scene
from burg_drake.station.document import Station, load_station


@dataclass(frozen=True)
class ReproducedScene:
    """A scene that was made again.

    Attributes:
        scene: as it comes out now; None if no attempt was accepted.
        station: that it was sampled for.
        same: it has the same content, bit for bit, and so has its origin.
        differences: what is not as it was when the scene was made, in words; and, if it does not
            come out the same though all is as it was, that its file was changed.
    """

    scene: Scene | None
    station: Station
    same: bool
    differences: tuple[str, ...]


def sample_again(scene: Scene, *, force: bool = False) -> ReproducedScene:
    """Makes a scene again.

    Args:
        scene: a sampled one, with its library.
        force: try even though library, station or versions are others.

    Raises:
        InvalidInputError: it does not say how it was made; or, without `force`, what it was made
            with is not there any more: the message names every difference.
        UnknownNameError: there is no such station.
    """
    origin = scene.document.origin
    if origin is None:
        raise InvalidInputError(
            f"{scene.path} has no `origin`, so it was not sampled, or was edited since; it cannot"
            " be made again"
        )
    station = load_station(resolve(origin.recipe.station, "stations", scene.path.parent))
    here = provenance_of(origin.recipe, scene.library, station)
    differences = origin.differences(here)
    if differences and not force:
        raise InvalidInputError(
            f"the inputs of {scene.path} have changed ({'; '.join(differences)}), so the scene may"
            " come out differently; force it to make the scene anyway"
        ).about("force")
    sampler = SceneSampler(origin.recipe, scene.library, station)
    sampled = sampler.sample(origin.number, scene.path.parent)
    if not sampled.accepted:
        return ReproducedScene(None, station, False, tuple(differences))
    same = sampled.scene.document == scene.document
    if not same and not differences:
        differences = ["the file was changed after it was sampled"]
    return ReproducedScene(sampled.scene, station, same, tuple(differences))
