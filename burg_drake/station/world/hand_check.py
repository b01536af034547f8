"""Holds a hand document against its model: pads, opening, grasp frame, joint limits, coupling."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
from pydrake.geometry import Convex, GeometryId, Mesh, VolumeMesh
from pydrake.math import RigidTransform
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.analysis import Simulator

from burg_drake.core import Array, InvalidInputError, content_hash, inverse, transform_points
from burg_drake.core.paths import NO_PACKAGES, Packages, named_files, named_packages
from burg_drake.station.document import Hand
from burg_drake.station.world.hand_model import add_hand, find_hand

TOLERANCE = 5e-4
"""How far lengths of a document may be off those of its model [m]; the pads of franka_ros, for one,
overlap by 0.04 mm when closed."""
TIME_STEP = 1e-3
STEPS = 20
"""Of the plant in which fingers are let go to see whether they are coupled."""
STILL = 1e-6
"""A finger that moves less in these steps is at rest [m]."""
ASIDE = 2e-3
"""How far one finger is put aside to see whether the other one follows [m]."""


@dataclass(frozen=True)
class HandFigures:
    """What a hand measures.

    Attributes:
        opening: smallest and largest distance between the pads [m].
        pad_bounds: smallest and largest coordinates of the first pad in the grasp frame G [m];
            those along x depend on how far the hand is open.
        pad_modulus: hydroelastic modulus of the first pad [Pa].
    """

    opening: tuple[float, float]
    pad_bounds: tuple[tuple[float, float, float], tuple[float, float, float]]
    pad_modulus: float

    @property
    def pad_size(self) -> tuple[float, float, float]:
        """Extents of the first pad in G [m]."""
        (x0, y0, z0), (x1, y1, z1) = self.pad_bounds
        return x1 - x0, y1 - y0, z1 - z0


def check_hand(
    hand: Hand, path: Path, document: Path | None = None, packages: Packages = NO_PACKAGES
) -> HandFigures:
    """Holds a hand document against its model file; a pair that was found right is remembered.

    Args:
        hand: the document.
        path: the model file.
        document: the document's file, for messages.
        packages: what a station says of packages.

    Raises:
        InvalidInputError: they do not fit; one line says where.
    """
    try:
        found = tuple(sorted(named_packages(path, packages).items()))
        return _check(hand, path, content_hash([path, *named_files(path, packages)]), found)
    except InvalidInputError as error:
        if document is None:
            raise
        raise InvalidInputError(f"{document}: {error}") from error


@lru_cache(maxsize=16)
def _check(
    hand: Hand, path: Path, content: str, found: tuple[tuple[str, Path], ...]
) -> HandFigures:
    bench = _Bench(hand, path, Packages(dict(found)))
    bench.check_limits()
    bench.check_pads()
    bench.check_closing_direction()
    largest, smallest = bench.check_opening("open"), bench.check_opening("closed")
    bench.check_approach()
    bench.check_coupling()
    (x0, y0, z0), (x1, y1, z1) = bench.bounds(0).tolist()
    bounds = (x0, y0, z0), (x1, y1, z1)
    return HandFigures((smallest, largest), bounds, bench.pad_modulus())


class _Bench:
    """The hand alone, its body held fast, without gravity."""

    def __init__(self, hand: Hand, path: Path, packages: Packages) -> None:
        self._hand = hand
        builder = RobotDiagramBuilder(time_step=TIME_STEP)
        self._plant = plant = builder.plant()
        with _silence():  # what the parser warns of is said when the hand is added to a scene
            instance = add_hand(builder, hand, path, packages).instance
        body = plant.GetBodyByName(hand.body, instance)
        plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform())
        plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, 0.0])
        plant.Finalize()
        self._diagram = builder.Build()
        self._inspector = self._diagram.scene_graph().model_inspector()
        self._model = find_hand(plant, self._inspector, hand, instance)
        self._simulator = Simulator(self._diagram)
        self._plant_context = plant.GetMyMutableContextFromRoot(
            self._simulator.get_mutable_context()
        )

    def check_limits(self) -> None:
        """`closed` and `open` are within the joints' limits."""
        for i, (finger, joint) in enumerate(
            zip(self._hand.fingers, self._model.joints, strict=True)
        ):
            low, high = joint.position_lower_limits()[0], joint.position_upper_limits()[0]
            for key in ("closed", "open"):
                q = getattr(finger, key)
                if not low - TOLERANCE <= q <= high + TOLERANCE:
                    raise self._error(
                        f"fingers[{i}].{key} is {q:g} m, but joint {finger.joint!r} goes"
                        f" from {low:g} to {high:g} m"
                    )

    def check_pads(self) -> None:
        """The pads have an elastic volume, without which rigid objects touch them in points."""
        for i, pad in enumerate(self._model.pads):
            if not isinstance(self._inspector.maybe_get_hydroelastic_mesh(pad), VolumeMesh):
                raise self._error(
                    f"fingers[{i}].pad {self._hand.fingers[i].pad!r} is not compliant; give it"
                    " drake:compliant_hydroelastic and a drake:hydroelastic_modulus (1e7 for"
                    " rubber) in its drake:proximity_properties"
                )

    def check_closing_direction(self) -> None:
        """The fingers move apart along x of G, in either order."""
        gaps = []
        for closed in (0.0, 1.0):
            self._put(self._at(closed))
            one, other = (self.bounds(i).mean(axis=0) for i in (0, 1))
            gaps.append(one - other)
        gap = gaps[0] - gaps[1]
        if np.hypot(gap[1], gap[2]) > TOLERANCE:
            x, y, z = np.round(gap / np.linalg.norm(gap), 2) + 0.0
            raise self._error(
                "x of G is not the closing direction: the fingers open along"
                f" ({x:.2f}, {y:.2f}, {z:.2f}) of G; turn X_HG"
            )

    def check_opening(self, end: Literal["open", "closed"]) -> float:
        """With the fingers at one end of their ways the pads are to both sides of G, as far apart
        as the document says; returns their distance [m]."""
        opening = self._hand.opening[1 if end == "open" else 0]
        self._put(self._at(0.0 if end == "open" else 1.0))
        one, other = self.bounds(0), self.bounds(1)
        if one[:, 0].mean() < other[:, 0].mean() - TOLERANCE:
            raise self._error(
                "the first finger is on the side of -x of G; exchange the fingers, or turn X_HG by"
                " 180 deg about its z"
            )
        distance, middle = one[0, 0] - other[1, 0], (one[0, 0] + other[1, 0]) / 2
        if abs(distance - opening) > TOLERANCE:
            raise self._error(
                f"with both fingers {end} the pads are {_mm(distance)} apart along x of"
                f" G, but opening says {_mm(opening)}"
            )
        if abs(middle) > TOLERANCE:
            raise self._error(
                f"with both fingers {end} the middle between the pads is at x = "
                f"{_mm(middle)} of G; it must be at 0"
            )
        for i, bounds in enumerate((one, other)):
            for name, (low, high) in zip("yz", bounds.T[1:], strict=True):
                if not low - TOLERANCE <= 0.0 <= high + TOLERANCE:
                    raise self._error(
                        f"G is not between the pads: with both fingers {end} the pad of"
                        f" fingers[{i}] reaches from {_mm(low)} to {_mm(high)} along {name} of G"
                    )
        return float(distance)

    def check_approach(self) -> None:
        """The hand's body lies behind G, seen along its +z."""
        X_GH = inverse(self._hand.X_HG.matrix())
        geometries = self._plant.GetCollisionGeometriesForBody(self._model.body)
        heights = [self._points(X_GH, geometry)[:, 2].mean() for geometry in geometries]
        if heights and max(heights) > 0.0:
            raise self._error(
                f"+z of G, the approach direction, points towards {self._hand.body!r}; turn X_HG"
            )

    def check_coupling(self) -> None:
        """Fingers that the document places stay; of one that is put aside the other one follows,
        if they are coupled."""
        one, other = self._at(0.5)
        aside = one + ASIDE * np.sign(self._hand.fingers[0].open - self._hand.fingers[0].closed)
        follows = self._moves((aside, other))
        if follows and not self._hand.coupled:
            raise self._error(
                "coupled is false, but in the model one finger follows the other; write"
                " coupled: true"
            )
        if not follows and self._hand.coupled:
            raise self._error(
                "coupled is true, but no constraint of the model couples the fingers; write"
                " coupled: false"
            )
        for closed in (0.25, 0.75):
            if self._moves(self._at(closed)):
                raise self._error(
                    "the mimic joint of the model moves the fingers in another"
                    " proportion than closed and open of the two fingers say"
                )

    def bounds(self, index: int) -> Array:
        """(2, 3) smallest and largest coordinates of a finger's pad in G [m], as it stands."""
        X_HB = self._plant.CalcRelativeTransform(
            self._plant_context,
            self._model.body.body_frame(),
            self._model.fingers[index].body_frame(),
        )
        X_GB = inverse(self._hand.X_HG.matrix()) @ X_HB.GetAsMatrix4()
        p_GV = self._points(X_GB, self._model.pads[index])
        return np.stack([p_GV.min(axis=0), p_GV.max(axis=0)])

    def pad_modulus(self) -> float:
        """Hydroelastic modulus of the first pad [Pa]."""
        properties = self._inspector.GetProximityProperties(self._model.pads[0])
        return float(properties.GetProperty("hydroelastic", "hydroelastic_modulus"))

    def _points(self, X_GB: Array, geometry: GeometryId) -> Array:
        """(N, 3) corners of a geometry of body B in G [m]; those of the smallest box about it if it
        is round."""
        X_BC = self._inspector.GetPoseInFrame(geometry).GetAsMatrix4()
        shape = self._inspector.GetShape(geometry)
        if isinstance(shape, (Mesh, Convex)):
            hull = self._inspector.GetConvexHull(geometry)
            p_CV = np.array([hull.vertex(i) for i in range(hull.num_vertices())])
            return transform_points(X_GB @ X_BC, p_CV)
        box = self._inspector.GetObbInGeometryFrame(geometry)
        corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T * box.half_width()
        return transform_points(X_GB @ X_BC @ box.pose().GetAsMatrix4(), corners)

    def _at(self, closed: float) -> tuple[float, float]:
        """Joint positions of the document, from open (0) to closed (1) [m]."""
        one, other = (f.open + closed * (f.closed - f.open) for f in self._hand.fingers)
        return one, other

    def _put(self, positions: tuple[float, float]) -> None:
        for joint, position in zip(self._model.joints, positions, strict=True):
            joint.set_translation(self._plant_context, position)
            joint.set_translation_rate(self._plant_context, 0.0)

    def _moves(self, positions: tuple[float, float]) -> bool:
        """Whether the second finger leaves its place when both are let go."""
        self._simulator.get_mutable_context().SetTime(0.0)
        self._put(positions)
        self._simulator.Initialize()
        self._simulator.AdvanceTo(STEPS * TIME_STEP)
        q = self._model.joints[1].get_translation(self._plant_context)
        return bool(abs(q - positions[1]) > STILL)

    def _error(self, message: str) -> InvalidInputError:
        return InvalidInputError(f"hand {self._hand.name!r}: {message} ({self._hand.model})")


@contextmanager
def _silence() -> Iterator[None]:
    """Keeps Drake's warnings off the screen."""
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


def _mm(length: float) -> str:
    return f"{round(1e3 * length, 1) + 0.0:.1f} mm"
