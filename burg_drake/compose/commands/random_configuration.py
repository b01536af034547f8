"""The command that throws the objects of a scene, or new ones, onto the board at random."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from burg_drake.compose.commands.command import require_number
from burg_drake.compose.document import (
    State,
    Surroundings,
    known_scene,
    object_vertices,
    shapes_for,
)
from burg_drake.core import Array, InvalidInputError, listing, transform_points
from burg_drake.scene.arrangement import ObjectRequest, area, arrange, choose
from burg_drake.scene.document import LayoutName, PoseChoice
from burg_drake.station.document import boxes_in_scene

MAX_OBJECTS = 60
"""Objects of one configuration."""


@dataclass(frozen=True)
class RandomConfiguration:
    """Gives free objects random places and stable poses; the background stays.

    Attributes:
        seed: the same one gives the same configuration.
        count: so many objects of the library take the place of the free ones; those that are there
            stay, elsewhere, if None.
        layout: how they stand to one another; see `scene.document.layout.LayoutName`.
        poses: how stable poses are drawn.
        repeat: an object of the library may come several times.
    """

    seed: int = 0
    count: int | None = None
    layout: LayoutName = "random"
    poses: PoseChoice = "probability"
    repeat: bool = False

    label = "random configuration"

    def apply(self, state: State, surroundings: Surroundings) -> State:
        rng = np.random.default_rng(int(require_number(self.seed, "seed", 0, 2**63, "")))
        wanted = self._wanted(state, surroundings, rng)
        shapes, board = shapes_for(surroundings.checker, state), state.document.board
        covered = sum(min(map(area, shapes[one.object].shadows)) for one in wanted)
        if self.layout != "heap" and covered > board.size[0] * board.size[1]:
            raise InvalidInputError(
                f"{len(wanted)} objects need more area than the board has; choose fewer, or a"
                " larger board"
            )
        found = arrange(
            wanted,
            shapes,
            board,
            rng,
            layout=self.layout,
            poses=self.poses,
            obstacles=_obstacles(state, surroundings),
            needs_all=True,
        )
        if found.missing:
            raise InvalidInputError(
                f"the board has no room for {len(found.missing)} of {len(wanted)} objects"
                f" ({listing(found.missing)}); choose fewer, another seed, or a larger board"
            )
        document = replace(state.document, instances=found.instances)
        return replace(state, document=document, selection=())

    def _wanted(
        self, state: State, surroundings: Surroundings, rng: np.random.Generator
    ) -> tuple[ObjectRequest, ...]:
        scene = known_scene(state, surroundings.path)
        if self.count is None:
            if not scene.instances:
                raise InvalidInputError(
                    "there are no objects to arrange; add some, or give a count"
                )
            return tuple(ObjectRequest(name=n, object=i.object) for n, i in scene.instances.items())
        count = int(require_number(self.count, "number of objects", 1, MAX_OBJECTS, ""))
        taken = set(surroundings.taken_names(state)) - set(scene.instances)
        return choose(state.library, count, rng, repeat=self.repeat, taken=sorted(taken))


def _obstacles(state: State, surroundings: Surroundings) -> list[Array]:
    """Points (N, 3) of convex bodies that are in the way: hulls of the background, and boxes of the
    station that reach above the board [m]."""
    scene = known_scene(state, surroundings.path)
    bodies = [
        transform_points(scene.X_SO(name), object_vertices(state.library, instance.object))
        for name, instance in scene.background.items()
    ]
    bodies += boxes_in_scene(surroundings.station)
    return [p_SV for p_SV in bodies if p_SV[:, 2].max() > 0.0]
