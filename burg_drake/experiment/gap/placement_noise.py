"""Scenes whose objects are not quite where they should be: a normal error of place and turn each.

Errors follow from the seed, the object's name and the number of the scene alone. What would overlap
something, or not stand on the board, is drawn again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from burg_drake.core import DEGREES, THOUSANDTHS, Array, InvalidInputError, rng_from, rot_z, setting
from burg_drake.experiment.gap.displacement import displaced_scene
from burg_drake.scene.document import Scene, SceneIssue

MOST_DRAWS = 200
"""Draws of one object; then it stays where it was planned."""


@dataclass(frozen=True, kw_only=True)
class PlacementNoise:
    """How far objects are from where they should be.

    Attributes:
        place: standard deviation along x and along y of the scene frame [m].
        turn: standard deviation of the turn about z [rad].
        seed: of the errors.
    """

    place: float = setting(
        0.002,
        "standard deviation along x and y",
        unit=THOUSANDTHS,
        name="placement_sd_mm",
        low=0,
    )
    turn: float = setting(
        math.radians(2.0),
        "standard deviation about the vertical",
        unit=DEGREES,
        name="placement_sd_deg",
        low=0,
    )
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("place", "turn"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise InvalidInputError(
                    f"noise of the {name} is {getattr(self, name):g}; give 0 or more"
                )


@dataclass(frozen=True, eq=False)
class NoisyScene:
    """One scene of displaced objects.

    Attributes:
        scene: the scene.
        draws: how often each object was drawn again.
        kept: objects that stay as planned, because all `MOST_DRAWS` draws were refused.
    """

    scene: Scene
    draws: dict[str, int]
    kept: tuple[str, ...] = ()

    @property
    def redrawn(self) -> int:
        """Number of draws that were refused."""
        return sum(self.draws.values())


def noisy_scene(
    scene: Scene,
    noise: PlacementNoise,
    number: int,
    issues: Callable[[Scene], Iterable[SceneIssue]],
) -> NoisyScene:
    """Displaces every free object.

    Args:
        scene: as planned; sound.
        noise: how far.
        number: of the scene among those with this noise.
        issues: what is wrong with a scene, such as `SceneCheck.issues`. What is wrong with the
            scene as planned already is nobody's fault here.

    Returns:
        A scene without errors; objects that had a part in one were drawn again, until there was
        none.
    """
    if noise.place == noise.turn == 0.0:
        return NoisyScene(scene, dict.fromkeys(scene.instances, 0))
    draws = dict.fromkeys(scene.instances, 0)
    while True:
        X_SO = {
            name: displaced(scene, name, noise, number, draws[name])
            for name in scene.instances
            if draws[name] < MOST_DRAWS
        }
        drawn = displaced_scene(scene, X_SO)
        wrong = _at_fault(issues(drawn), X_SO)
        if not wrong:
            kept = tuple(name for name in draws if name not in X_SO)
            return NoisyScene(drawn, draws, kept)
        for name in wrong:
            draws[name] += 1


def displaced(scene: Scene, name: str, noise: PlacementNoise, number: int, draw: int) -> Array:
    """(4, 4) pose of an object in the scene frame with an error of place, and of turn about the
    vertical through its middle."""
    rng = rng_from("placement noise", noise.seed, name, number, draw)
    x, y, turn = rng.standard_normal(3)
    return moved(scene, name, noise.place * np.array([x, y, 0.0]), noise.turn * float(turn))


def moved(scene: Scene, name: str, p_S: Array, angle: float) -> Array:
    """(4, 4) pose of an object in the scene frame, moved by `p_S` (3,) [m] and turned by `angle`
    [rad] about the vertical through the middle of its box."""
    entry, X_SO = scene.entry(name), scene.X_SO(name)
    if angle == 0.0 and not np.any(p_S):
        return X_SO
    p_SM = X_SO[:3, :3] @ (np.add(entry.lower, entry.upper) / 2.0) + X_SO[:3, 3]
    R = rot_z(angle)
    X = X_SO.copy()
    X[:3, :3] = R @ X_SO[:3, :3]
    X[:3, 3] = p_SM + R @ (X_SO[:3, 3] - p_SM) + p_S
    return X


def _at_fault(issues: Iterable[SceneIssue], movable: Iterable[str]) -> set[str]:
    """Objects that had a part in errors and can be drawn again: both of two that overlap."""
    pairs = ((issue.instance, issue.other) for issue in issues if issue.is_error)
    return {name for pair in pairs for name in pair}.intersection(movable)
