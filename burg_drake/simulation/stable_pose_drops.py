"""Confirms stable poses of an object by dropping it on a table with small tilts.

The quasi-static stable poses of `objects` ignore momentum and the collision geometry. The object is
dropped in each pose from just above the table, tilted to several sides, first to the one on which
it topples most easily. All drops use one diagram with one object, one after the other.

Table, density and friction are constants: whether an object stands does not depend on its mass, so
that a new mass or friction coefficient needs no new confirmation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.tree import RotationalInertia, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from burg_drake.core import Array, BurgError, make_pose, rot_z, rotation_from_rpy, transform_points
from burg_drake.objects import (
    ObjectLibrary,
    PoseClasses,
    PotentialLandscape,
    StablePose,
    SymmetrySearch,
    primitive_mesh,
)
from burg_drake.scene import Instance, Scene, SceneDocument
from burg_drake.simulation.contacts import assign_friction
from burg_drake.simulation.rest_criterion import settle
from burg_drake.station import (
    Engine,
    Station,
    StationDiagram,
    StationDocument,
    Table,
    build_station_diagram,
    load_hand,
)


class DropSettings:
    """How objects are dropped."""

    tilt = np.deg2rad(2.0)  # Radians. Tilt of an object when it is dropped, as by a careful hand.
    height = 5e-4  # Metres from the table to the lowest point of the object.
    density = 500.0  # kg/m^3, between cardboard boxes and full cans.
    friction = 0.5  # Friction coefficient of object and table.
    time_step = 0.005  # Seconds. Verdicts on 16 objects were the same at 2 ms.
    time_limit = 1.5  # Seconds of simulated time to come to rest.


DROP_TABLE = Table(size=(4.0, 4.0, 0.1), friction=DropSettings.friction)
"""Large enough for rolling objects; the default thickness, which sets the stiffness."""


@dataclass(frozen=True)
class DropResult:
    """Result of a drop.

    Attributes:
        down: (3,) unit vector of O that points down.
        at_rest: whether the object came to rest within the time limit.
        duration: simulated time [s].
    """

    down: Array
    at_rest: bool
    duration: float


class DropTest:
    """Drops of one object.

    Args:
        library: the library; its folder holds the object's SDF.
        name: the object.
        support: (N, 3) points of O whose hull rests on the table [m].

    Raises:
        InvalidInputError: the SDF cannot be loaded.
        RuntimeError, SystemExit: Drake failed.
    """

    def __init__(self, library: ObjectLibrary, name: str, support: Array) -> None:
        self.support = support
        self.built = _build_drop_diagram(library, name)
        self._body = self.built.plant.get_body(self.built.free[name])
        self._default = self.built.diagram.CreateDefaultContext()
        properties = library.entry(name).mass_properties
        plant_context = self.built.plant.GetMyMutableContextFromRoot(self._default)
        moments = np.array(properties.inertia) / properties.mass
        mass = DropSettings.density * properties.volume
        self._body.SetSpatialInertiaInBodyFrame(
            plant_context,
            SpatialInertia.MakeFromCentralInertia(
                mass, np.array(properties.center_of_mass), RotationalInertia(*(mass * moments))
            ),
        )
        assign_friction(self.built, self._default, [self._body.index()], DropSettings.friction)
        self._simulator = Simulator(self.built.diagram, self._default.Clone())

    def run(self, X_SO: Array, side: float) -> DropResult:
        """Drops the object.

        Args:
            X_SO: (4, 4) resting pose.
            side: azimuth in S towards which the object is tilted [rad].

        Raises:
            RuntimeError, SystemExit: Drake failed, or the object flew away.
        """
        plant, context = self.built.plant, self._simulator.get_mutable_context()
        context.SetTimeStateAndParametersFrom(self._default)
        X_WO = self._start_pose(X_SO, side)
        plant_context = plant.GetMyMutableContextFromRoot(context)
        plant.SetFloatingBaseBodyPoseInWorldFrame(plant_context, self._body, RigidTransform(X_WO))
        self._raise_out_of_table(plant_context)
        self._simulator.Initialize()
        return self.resume()

    def resume(self) -> DropResult:
        """Continues until the object is at rest, for at most the time limit once more.

        Raises:
            RuntimeError, SystemExit: Drake failed, or the object flew away.
        """
        plant = self.built.plant
        settled = settle(self._simulator, plant, [self._body.index()], DropSettings.time_limit)
        plant_context = plant.GetMyContextFromRoot(self._simulator.get_context())
        end = plant.EvalBodyPoseInWorld(plant_context, self._body).GetAsMatrix4()
        center = transform_points(end, self.support.mean(axis=0, keepdims=True))[0]
        if not np.isfinite(end).all() or center[2] < 0.0:
            raise RuntimeError("the dropped object left the table")
        return DropResult(-end[2, :3], settled.at_rest, settled.duration)

    def _start_pose(self, X_SO: Array, side: float) -> Array:
        """`X_WO` (4, 4) from which the object is dropped; S is in the world's origin."""
        R = rot_z(side) @ rotation_from_rpy([0.0, DropSettings.tilt, 0.0]) @ rot_z(-side)
        X_WO = make_pose(R) @ X_SO
        X_WO[2, 3] += DropSettings.height - transform_points(X_WO, self.support)[:, 2].min()
        return X_WO

    def _raise_out_of_table(self, plant_context: Context) -> None:
        """Lifts the object if its contact geometry is in the table: the geometry may exceed the
        support points by its fitting error."""
        graph = self.built.scene_graph
        query = graph.get_query_output_port().Eval(
            graph.GetMyContextFromRoot(self._simulator.get_context())
        )
        depth = max((pair.depth for pair in query.ComputePointPairPenetration()), default=0.0)
        if depth > 0.0:
            X_WO = self.built.plant.EvalBodyPoseInWorld(plant_context, self._body)
            x, y, z = X_WO.translation()
            X_WO.set_translation([x, y, z + depth + DropSettings.height])
            self.built.plant.SetFloatingBaseBodyPoseInWorldFrame(plant_context, self._body, X_WO)


def _build_drop_diagram(library: ObjectLibrary, name: str) -> StationDiagram:
    hand = load_hand("panda_hand")  # a station needs a hand; it is left out of the diagram
    document = StationDocument(name="drop", table=DROP_TABLE)
    station = Station(document, hand, Path(hand.model), None, Path("drop"))
    scene = Scene(
        SceneDocument(name="drop", library="", instances=(Instance(object=name),)),
        library,
        Path("drop"),
    )
    engine = Engine(name="drop", time_step=DropSettings.time_step)
    return build_station_diagram(scene, station, robot="none", engine=engine)


@dataclass(frozen=True)
class Confirmation:
    """Result of `confirm_poses`.

    Attributes:
        poses: confirmed poses with their residuals, most probable first; probabilities sum to one.
            The unchanged poses if the simulation failed.
        notes: sentences for the user.
    """

    poses: tuple[StablePose, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class _DropOutcome:
    """Outcome of the drops of one pose.

    Attributes:
        residual: largest angle from the pose [rad].
        end_pose: index of the pose in which the first toppled drop ended; None if that pose is
            unknown, or no drop toppled.
        confirmed: whether no drop toppled.
    """

    residual: float
    end_pose: int | None
    confirmed: bool


def confirm_poses(
    library: ObjectLibrary, name: str, search: SymmetrySearch | None = None
) -> Confirmation:
    """Drops an object in each of its stable poses, and keeps the poses in which it stays.

    Args:
        library: the library; its folder holds the object's SDF, pieces and surface mesh.
        name: the object, with its quasi-static poses.
        search: symmetry search on its surface about its centre of mass; made where needed if None.

    Returns:
        The confirmed poses. The probability of a pose that topples goes to the pose in which it
        ends; if that pose is unknown, the others are scaled to a sum of one. If no pose is
        confirmed, the most probable one is kept. A failure of the simulator is a note.

    Raises:
        UnknownNameError: no such object.
    """
    poses = library.entry(name).stable_poses
    try:
        return _update_probabilities(poses, _drop_all_poses(library, name, search))
    except (BurgError, RuntimeError, SystemExit) as error:  # some Drake checks exit
        reason = " ".join(str(error).split())
        return Confirmation(poses, (f"stable poses are not confirmed by simulation: {reason}",))


def _drop_all_poses(
    library: ObjectLibrary, name: str, search: SymmetrySearch | None
) -> list[_DropOutcome]:
    """Drops the object in all its poses."""
    entry = library.entry(name)
    p_OOcm = np.array(entry.mass_properties.center_of_mass)
    landscape = PotentialLandscape(support_points(library, name), p_OOcm)
    classes = PoseClasses(
        entry.stable_poses,
        landscape,
        lambda: search or SymmetrySearch(library.surface(name), p_OOcm),
    )
    drop = DropTest(library, name, landscape.points + p_OOcm)
    return [_drop_pose(drop, classes, k) for k in range(len(entry.stable_poses))]


def _drop_pose(drop: DropTest, classes: PoseClasses, k: int) -> _DropOutcome:
    tilt_count = 4  # Drops of each pose, tilted to evenly spread sides.
    X_SO, residual = classes.poses[k].X_SO.matrix(), 0.0
    weakest = weakest_side(classes.landscape, X_SO[:3, :3], float(DropSettings.tilt))
    for side in weakest + 2.0 * np.pi * np.arange(tilt_count) / tilt_count:
        dropped = drop.run(X_SO, float(side))
        found = classes.find(dropped.down)
        for _ in range(2):  # more time for objects that topple
            if dropped.at_rest or (found is not None and found[0] == k):
                break
            dropped = drop.resume()
            found = classes.find(dropped.down)
        if found is None or found[0] != k:
            angle = max(residual, classes.angle(k, dropped.down))
            return _DropOutcome(angle, None if found is None else found[0], False)
        residual = max(residual, found[1])
    return _DropOutcome(residual, None, True)


def weakest_side(landscape: PotentialLandscape, R_SO: Array, tilt: float) -> float:
    """Azimuth in S of the tilt that raises the centre of mass least, or lowers it most [rad]."""
    side_count = 72  # Sides among which the weakest is searched.
    azimuth = 2.0 * np.pi * np.arange(side_count) / side_count
    # the down direction after the tilt, in the untilted S
    down_S = np.stack(
        [
            np.sin(tilt) * np.cos(azimuth),
            np.sin(tilt) * np.sin(azimuth),
            np.full(side_count, -np.cos(tilt)),
        ],
        axis=1,
    )
    return float(azimuth[landscape.height(down_S @ R_SO).argmin()])


def support_points(library: ObjectLibrary, name: str) -> Array:
    """Points (N, 3) in O whose hull rests on the table [m]: from the primitive, else the pieces,
    else the surface."""
    entry = library.entry(name)
    if entry.contact.primitive is not None:
        return np.asarray(primitive_mesh(entry.contact.primitive).vertices)
    if not entry.pieces:
        return np.asarray(library.surface(name).vertices)
    return np.vstack([library.mesh(piece).vertices for piece in entry.pieces])


def _update_probabilities(
    poses: Sequence[StablePose], outcomes: Sequence[_DropOutcome]
) -> Confirmation:
    """Moves the probability of each toppled pose to the pose in which it ended."""
    confirmed = [k for k, outcome in enumerate(outcomes) if outcome.confirmed]
    if not confirmed:
        kept = replace(poses[0], probability=1.0, residual=_round_residual(outcomes[0].residual))
        note = (
            "simulation confirms no stable pose; the most probable one is kept, though the object"
            f" tilts by {np.rad2deg(outcomes[0].residual):.0f} degrees from it"
        )
        return Confirmation((kept,), (note,))
    share = {k: 0.0 for k in confirmed}
    lost = 0.0
    for k, pose in enumerate(poses):
        end: int | None = k
        seen: set[int] = set()
        while end is not None and end not in share and end not in seen:
            seen.add(end)
            end = outcomes[end].end_pose
        if end in share:
            share[end] += pose.probability
        else:
            lost += pose.probability
    total = sum(share.values())
    order = sorted(confirmed, key=lambda k: -share[k])
    found = tuple(
        replace(
            poses[k],
            probability=round(share[k] / total, 6),
            residual=_round_residual(outcomes[k].residual),
        )
        for k in order
    )
    notes = (_describe_changes([poses[k] for k in range(len(poses)) if k not in share], lost),)
    return Confirmation(found, notes if len(found) < len(poses) else ())


def _describe_changes(toppled: Sequence[StablePose], lost: float) -> str:
    share = 100.0 * sum(pose.probability for pose in toppled)
    text = f"a stable pose ({share:.1f} %) topples in simulation and is left out"
    if len(toppled) > 1:
        text = f"{len(toppled)} stable poses ({share:.1f} %) topple in simulation and are left out"
    if lost == 0.0:
        return f"{text}; its probability goes to the poses in which the object ends up"
    return (
        f"{text}; {100.0 * lost:.1f} % are shared by all others, because the object ends up in no"
        " known pose"
    )


def _round_residual(residual: float) -> float:
    return round(residual, 4)
