"""Pictures of the trials of a file: each grasp on its scene, and the set-up of each block.

All are made with one painter, which belongs to the thread that made it. They depend on the grasps
alone, so that they are the same each time.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from burg_drake.core import Array, inverse, transform_points
from burg_drake.experiment.pages.highlight import jpeg, shaded, with_names, with_target
from burg_drake.experiment.pages.painting import Painter, Painting, Viewpoint
from burg_drake.experiment.pages.ray_painter import RayPainter
from burg_drake.experiment.pages.scene_bodies import GROUND, PlacedBody, SceneBodies, stock
from burg_drake.experiment.pages.tried_runs import TriedRuns
from burg_drake.experiment.pages.viewpoints import (
    Subject,
    above,
    direction,
    fitted,
    grasp_viewpoint,
)
from burg_drake.experiment.trials import RealTrial
from burg_drake.geometry import RayCaster
from burg_drake.system_libraries import missing_render_libraries

SIZE = (520, 390)
"""Width and height of the picture of a grasp [pixel]."""
SETUP_SIZE = (760, 500)
"""Of the pictures of a set-up [pixel]."""
FRONT = np.deg2rad(33.0)
"""By which the picture from the front looks down [rad]."""


class TrialPictures:
    """Makes the pictures of a trials file.

    Args:
        runs: of the file.
        rays: paint by rays, even where Drake's renderer has its libraries.

    Raises:
        InvalidInputError: a run or grasp is gone, or Drake cannot load a mesh.
    """

    def __init__(self, runs: TriedRuns, *, rays: bool = False) -> None:
        self.runs = runs
        self._scenes: dict[str, _Scenery] = {}
        shown = []
        for trial in runs.sheet.trials:
            if trial.run not in self._scenes:
                tried = runs.of(trial)
                self._scenes[trial.run] = _Scenery(SceneBodies(tried.scene, tried.station))
                shown.append(self._scenes[trial.run].with_hand(np.eye(4), np.nan))
        self._painter: Painter
        if rays or missing_render_libraries():
            self._painter = RayPainter()
        else:
            from burg_drake.experiment.pages.vtk_painter import VtkPainter

            self._painter = VtkPainter(stock(shown))

    def paint_grasp(
        self, trial: RealTrial, size: tuple[int, int] = SIZE
    ) -> tuple[Painting, tuple[PlacedBody, ...], Viewpoint]:
        """The hand at a trial's grasp among the objects, what of it each pixel shows, and from
        where."""
        scenery, X_SG = self._scenes[trial.run], self.runs.X_SG(trial)
        width = self.runs.width(trial)
        view = scenery.viewpoint(trial.instance, X_SG, width, size)
        placed = scenery.with_hand(X_SG, width)
        painting = self._painter.paint(placed, view)
        hulls = [*scenery.hulls, scenery.bodies.corners(X_SG)]
        return shaded(painting, placed, view, hulls), placed, view

    def grasp(self, trial: RealTrial, size: tuple[int, int] = SIZE) -> bytes:
        """JPEG of the hand at a trial's grasp among the objects; the target has a rim."""
        painting, placed, _ = self.paint_grasp(trial, size)
        return jpeg(with_target(painting, placed, trial.instance))

    def setup(self, trial: RealTrial, size: tuple[int, int] = SETUP_SIZE) -> tuple[bytes, bytes]:
        """JPEGs of the scene of a trial without a hand, from above and from the front."""
        scenery = self._scenes[trial.run]
        standing = scenery.bodies.standing
        front = fitted(scenery.corners, direction(0.0, FRONT), size)
        pictures = []
        for view in (above(scenery.corners, size), front):
            painting = shaded(self._painter.paint(standing, view), standing, view, scenery.hulls)
            pictures.append(jpeg(with_names(painting, standing)))
        return pictures[0], pictures[1]


class _Scenery:
    """A scene's bodies, with what is computed of them once."""

    def __init__(self, bodies: SceneBodies) -> None:
        self.bodies = bodies
        self._surfaces: dict[str, Array] = {}

    def with_hand(self, X_SG: Array, width: float) -> tuple[PlacedBody, ...]:
        return (*self.bodies.standing, *self.bodies.hand(X_SG, width))

    def viewpoint(
        self, instance: str, X_SG: Array, width: float, size: tuple[int, int]
    ) -> Viewpoint:
        if instance not in self._surfaces:
            scene = self.bodies.scene
            surface = scene.library.surface(scene.instance(instance).object)
            corners = np.asarray(surface.triangles_center)
            self._surfaces[instance] = transform_points(scene.X_SO(instance), corners)
        subject = Subject(X_SG, width, self._surfaces[instance], self.bodies.corners(X_SG))
        return grasp_viewpoint(subject, self._rays, self._hand_rays, inverse(X_SG), size)

    @cached_property
    def hulls(self) -> list[Array]:
        """(N, 3) corners in S of the objects' convex pieces."""
        scene, found = self.bodies.scene, []
        for name in (*scene.instances, *scene.background):
            for piece in scene.entry(name).pieces:
                corners = np.asarray(scene.library.mesh(piece).vertices)
                found.append(transform_points(scene.X_SO(name), corners))
        return found

    @cached_property
    def corners(self) -> Array:
        """(N, 3) corners of the sheet and of all that stands on it, in S [m]."""
        x, y = self.bodies.scene.board.size
        sheet = np.array([[0.0, 0.0, 0.0], [x, 0.0, 0.0], [0.0, y, 0.0], [x, y, 0.0]])
        return np.vstack([sheet, *self.hulls])

    @cached_property
    def _rays(self) -> RayCaster:
        standing = [one for one in self.bodies.standing if one.name != GROUND]
        vertices, faces, _ = RayPainter().joined(standing)
        return RayCaster(vertices, faces)

    @cached_property
    def _hand_rays(self) -> RayCaster:
        """The open hand, in the frame of the grasp."""
        vertices, faces, _ = RayPainter().joined(self.bodies.hand(np.eye(4), np.nan))
        return RayCaster(vertices, faces)
