"""Contacts of bodies, of the fingers and of the robot, and groups of objects that touch."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    ProximityProperties,
    SceneGraph,
)
from pydrake.multibody.plant import ContactResults, CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from burg_drake.core import Array
from burg_drake.station import (
    StationDiagram,
    assign_contact,
    collision_geometries,
    touching_bodies,
)


@dataclass(frozen=True)
class BodyContact:
    """Contact between two bodies at one pair of geometries.

    Attributes:
        body_A, body_B: the bodies.
        f_B_W: (3,) force on body B in the world [N].
        area: area of the contact patch [m^2]; 0 for contact at a point.
    """

    body_A: BodyIndex
    body_B: BodyIndex
    f_B_W: Array
    area: float = 0.0


@dataclass(frozen=True)
class FingerContact:
    """Contact of the two fingers with the target.

    Attributes:
        touching: whether each finger touches the target.
        force: (2, 3) force of each finger on the target in the world [N].
        area: (2,) area of the patches of each finger [m^2].
    """

    touching: tuple[bool, bool]
    force: Array
    area: Array

    @property
    def both(self) -> bool:
        """Both fingers touch the target."""
        return all(self.touching)

    @property
    def any(self) -> bool:
        """A finger touches the target."""
        return any(self.touching)


NO_FINGER_CONTACT = FingerContact((False, False), np.zeros((2, 3)), np.zeros(2))
"""Neither finger touches anything."""


class ContactReader:
    """Maps the geometries of contact results to bodies.

    Args:
        plant: a finalized plant.
        scene_graph: its scene graph.
    """

    def __init__(self, plant: MultibodyPlant, scene_graph: SceneGraph) -> None:
        inspector = scene_graph.model_inspector()
        self._body_of = {
            geometry: plant.GetBodyFromFrameId(inspector.GetFrameId(geometry)).index()
            for geometry in inspector.GetAllGeometryIds()
        }

    def read(self, results: ContactResults) -> list[BodyContact]:
        """All contacts of a value of the plant's contact results port."""
        contacts = []
        for i in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(i)
            surface = info.contact_surface()
            body_M, body_N = self._body_of[surface.id_M()], self._body_of[surface.id_N()]
            f_M_W = info.F_Ac_W().translational()
            contacts.append(BodyContact(body_N, body_M, f_M_W, surface.total_area()))
        for i in range(results.num_point_pair_contacts()):
            pair = results.point_pair_contact_info(i)
            contacts.append(
                BodyContact(pair.bodyA_index(), pair.bodyB_index(), pair.contact_force())
            )
        return contacts

    @staticmethod
    def has_any(results: ContactResults, geometries: Collection[GeometryId]) -> bool:
        """Whether one of the geometries is in point contact."""
        pairs = map(results.point_pair_contact_info, range(results.num_point_pair_contacts()))
        points = (pair.point_pair() for pair in pairs)
        return any(p.id_A in geometries or p.id_B in geometries for p in points)


def finger_contact(
    contacts: list[BodyContact], fingers: tuple[BodyIndex, BodyIndex], target: BodyIndex
) -> FingerContact:
    """Sums the contacts of each finger with the target."""
    force, area = np.zeros((2, 3)), np.zeros(2)
    touching = [False, False]
    for i, finger in enumerate(fingers):
        for contact in contacts:
            if (contact.body_A, contact.body_B) == (finger, target):
                force[i] += contact.f_B_W
            elif (contact.body_A, contact.body_B) == (target, finger):
                force[i] -= contact.f_B_W
            else:
                continue
            area[i] += contact.area
            touching[i] = True
    return FingerContact((touching[0], touching[1]), force, area)


def touched_bodies(
    contacts: list[BodyContact], moving: Collection[BodyIndex], still: Collection[BodyIndex]
) -> set[BodyIndex]:
    """The bodies in `still` that a body in `moving` touches."""
    found = set()
    for contact in contacts:
        one, other = contact.body_A, contact.body_B
        if one in moving and other in still:
            found.add(other)
        elif other in moving and one in still:
            found.add(one)
    return found


def is_touched_from_outside(contacts: list[BodyContact], bodies: Collection[BodyIndex]) -> bool:
    """Whether one of the bodies touches a body outside the collection."""
    return any((c.body_A in bodies) != (c.body_B in bodies) for c in contacts)


class NamedBodies(Protocol):
    """A world with a robot, and the display names of its bodies; see `StationDiagram`."""

    @property
    def body_names(self) -> Mapping[BodyIndex, str]: ...
    @property
    def robot_bodies(self) -> Collection[BodyIndex]: ...
    @property
    def free(self) -> Mapping[str, BodyIndex]: ...
    @property
    def table(self) -> BodyIndex: ...


class RobotContactWatch:
    """Finds contacts that stop a robot, and its first unplanned contact.

    Args:
        world: a world with a robot.
        links: bodies of the arm without the hand; empty for the hand alone.
        target: the body to be grasped.

    Attributes:
        first: the first unplanned contact, "panda_link5 vs can"; "" if there was none.
    """

    def __init__(self, world: NamedBodies, links: Collection[BodyIndex], target: BodyIndex) -> None:
        self._names = world.body_names
        self._robot = frozenset(world.robot_bodies)
        self._links = frozenset(links)
        self._free = frozenset(world.free.values())
        self._table = world.table
        self._planned = (target, world.table)
        self.first = ""

    def update(self, contacts: Collection[BodyContact], arrived: bool) -> str:
        """Evaluates the contacts of one check.

        Args:
            contacts: all present contacts.
            arrived: whether the hand has reached the grasp; from then on it may touch target and
                table.

        Returns:
            The obstacle that stops the robot: "panda_link5 vs shelf" if a link touches something
            fixed or another link, "shelf" if the hand does; `table` if the hand presses on it with
            more than 20 N on its approach. "" if the robot can go on.
        """
        stops, on_table = [], np.zeros(3)
        for contact in contacts:
            for one, other, sign in (
                (contact.body_A, contact.body_B, 1.0),
                (contact.body_B, contact.body_A, -1.0),
            ):
                link = one in self._links
                if one not in self._robot or (other in self._robot and not link):
                    continue
                name = f"{self._names[one]} vs {self._names[other]}"
                if link or not arrived or other not in self._planned:
                    self.first = self.first or name
                if link and other not in self._free:
                    stops.append(name)
                elif other == self._table:
                    on_table += sign * contact.f_B_W
                elif other not in self._free:
                    stops.append(self._names[other])
        # 20 N is the threshold of a Panda's reflex in the examples of libfranka.
        if not arrived and np.linalg.norm(on_table) > 20.0:
            stops.append(self._names[self._table])
        return min(stops, default="")


class Neighbours:
    """Neighbours in the default context, where objects stand as the scene places them.

    Args:
        station_diagram: a built diagram.
    """

    def __init__(self, station_diagram: StationDiagram) -> None:
        self._beside = touching_bodies(station_diagram, station_diagram.free.values())

    def with_neighbours(self, bodies: Iterable[BodyIndex]) -> set[BodyIndex]:
        """The bodies and all bodies connected to them through neighbours."""
        found, fresh = set(), set(bodies)
        while fresh:
            found |= fresh
            fresh = {other for one in fresh for other in self._beside.get(one, ())} - found
        return found


def contact_islands(built: StationDiagram) -> list[list[BodyIndex]]:
    """Groups the free objects that touch each other where the documents place them.

    Args:
        built: a built diagram.
    """
    neighbours, left = Neighbours(built), list(built.free.values())
    found = []
    while left:
        island = neighbours.with_neighbours([left[0]])
        found.append([index for index in left if index in island])
        left = [index for index in left if index not in island]
    return found


def assign_friction(
    built: StationDiagram, root: Context, bodies: Iterable[BodyIndex], friction: float
) -> None:
    """Sets the friction coefficient of all collision geometries of bodies in a Context.

    Args:
        built: the diagram.
        root: its Context.
        bodies: bodies of the plant.
        friction: static and dynamic coefficient.
    """
    graph = built.scene_graph
    query = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(root))
    changed = {}
    for geometry in collision_geometries(built.plant, bodies):
        properties = ProximityProperties(query.inspector().GetProximityProperties(geometry))
        coulomb = CoulombFriction(friction, friction)
        properties.UpdateProperty("material", "coulomb_friction", coulomb)
        changed[geometry] = properties
    assign_contact(built, root, changed)


def freeze_bodies(built: StationDiagram, root: Context, bodies: Collection[BodyIndex]) -> None:
    """Locks bodies, and excludes contacts among them and with fixed bodies.

    Args:
        built: the diagram.
        root: its Context.
        bodies: free bodies.
    """
    if not bodies:
        return
    plant, graph = built.plant, built.scene_graph
    context = plant.GetMyMutableContextFromRoot(root)
    for index in bodies:
        plant.get_body(index).Lock(context)
    resting = {*bodies, built.table, *built.fixed.values()}
    geometries = GeometrySet(collision_geometries(plant, resting))
    declaration = CollisionFilterDeclaration().ExcludeWithin(geometries)
    graph.collision_filter_manager(graph.GetMyMutableContextFromRoot(root)).Apply(declaration)
