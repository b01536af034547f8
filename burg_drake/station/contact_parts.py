"""Contact geometries of objects in trials: surfaces for the hand, feet for the table.

All other bodies meet the convex pieces.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Cylinder,
    GeometryId,
    Mesh,
    ProximityProperties,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody

from burg_drake.core import Array, make_pose, transform_points
from burg_drake.objects import (
    DEFAULT_CONTACT,
    SUPPORT_HEIGHT_TOLERANCE,
    ObjectEntry,
    carrying_corners,
    support_corners,
    support_feet,
)
from burg_drake.scene import Scene
from burg_drake.station.object_bodies import add_hull, is_ball
from burg_drake.station.station_document import Station


@dataclass(frozen=True)
class ContactParts:
    """Geometries of objects that only some bodies collide with.

    Attributes:
        surfaces: surface meshes, which collide with the hand instead of the pieces.
        feet: feet, which collide with the table instead of all other geometries.
        hulls: convex hulls, which collide with all but the hand and the table instead of the
            pieces.
    """

    surfaces: tuple[GeometryId, ...] = ()
    feet: tuple[GeometryId, ...] = ()
    hulls: tuple[GeometryId, ...] = ()

    @property
    def all(self) -> frozenset[GeometryId]:
        """Geometries of all kinds."""
        return frozenset((*self.surfaces, *self.feet, *self.hulls))


def add_contact_parts(
    plant: MultibodyPlant,
    scene: Scene,
    station: Station,
    free: Mapping[str, RigidBody],
    fixed: Mapping[str, RigidBody],
    *,
    own_surfaces: bool = True,
    hulls: bool = False,
) -> ContactParts:
    """Adds surface meshes to objects, and feet to those that can move.

    If an object is placed slightly in the table, as after settling, its feet are shortened, so that
    it stands at its pose in the document. Balls have no feet: they roll on a point.

    Args:
        plant: the plant with the robot, not finalized.
        scene: the scene.
        station: the station.
        free: bodies of objects that can move, by name.
        fixed: bodies that cannot move, by name; the station's obstacles are not changed.
        own_surfaces: add the surface meshes of objects; with point contact Drake would use their
            convex hulls.
        hulls: add hulls that replace the pieces of free objects.
    """
    surfaces, feet, hull_geometries = [], [], []
    for name, body in {**free, **fixed}.items():
        if name in station.document.background:
            continue
        if own_surfaces and scene.entry(name).contact.kind == "surface":
            surfaces.append(_add_surface(plant, scene, name, body))
        if name in free and not is_ball(scene, name):
            feet += _add_feet(plant, scene, station, name, body)
        if name in free and hulls:
            hull_geometries.append(add_hull(plant, scene, name, body))
    return ContactParts(tuple(surfaces), tuple(feet), tuple(hull_geometries))


def needs_no_pieces(scene: Scene, station: Station, name: str) -> bool:
    """Whether surface, feet and hull of an object replace its pieces in all contacts."""
    return scene.entry(name).contact.kind == "surface" and is_on_table(scene, station, name)


def _add_surface(plant: MultibodyPlant, scene: Scene, name: str, body: RigidBody) -> GeometryId:
    entry = scene.entry(name)
    mesh = Mesh(str(scene.library.path(entry.contact.mesh)))
    properties = _contact_properties(entry, DEFAULT_CONTACT.dissipation)
    AddRigidHydroelasticProperties(properties)
    return plant.RegisterCollisionGeometry(body, RigidTransform(), mesh, "surface", properties)


def _add_feet(
    plant: MultibodyPlant, scene: Scene, station: Station, name: str, body: RigidBody
) -> list[GeometryId]:
    stiffness = 1e5  # N/m; four feet carry 0.4 kg 10 um below the table's top.
    dissipation = 20.0  # s/m, Hunt-Crossley; placed objects do not bounce.
    if not is_on_table(scene, station, name):
        return []
    X_WO = station.document.X_WS.matrix() @ scene.X_SO(name)
    properties = _contact_properties(scene.entry(name), dissipation, stiffness)
    return [
        plant.RegisterCollisionGeometry(body, RigidTransform(X_OF), shape, label, properties)
        for label, X_OF, shape in _foot_shapes(scene, name, X_WO)
    ]


def is_on_table(scene: Scene, station: Station, name: str) -> bool:
    """Whether an object is placed well within the table's edge."""
    edge_distance = 0.05  # Metres; objects nearer to the edge keep their pieces.
    X_WO = station.document.X_WS.matrix() @ scene.X_SO(name)
    table, entry = station.document.table, scene.entry(name)
    corners = np.array(np.meshgrid(*zip(entry.lower, entry.upper, strict=True))).reshape(3, -1).T
    away = np.abs(transform_points(X_WO, corners)[:, :2] - table.center)
    return bool((away <= np.array(table.size[:2]) / 2 - edge_distance).all())


def _foot_shapes(scene: Scene, name: str, X_WO: Array) -> Iterator[tuple[str, Array, Shape]]:
    """Names, poses (4, 4) in O and shapes of the feet of an object at `X_WO`."""
    disc_thickness = 1e-4  # Metres: thickness of the rolling discs, and gap to the ends.
    entry, up = scene.entry(name), np.round(X_WO[2, :3], 9)
    primitive = entry.contact.primitive
    if primitive is None:
        feet = _corner_feet(scene, name, X_WO)
    elif primitive.shape == "box":
        corners = np.array(list(product(*((-s / 2, s / 2) for s in primitive.size))))
        corners = transform_points(primitive.X_OP.matrix(), corners)
        feet = _raise_to_table(corners, X_WO, corners)
    else:
        radius, length = primitive.size
        apart = max(0.0, length - 3.0 * disc_thickness)
        for k, end in enumerate((-0.5, 0.5)):
            X_OD = primitive.X_OP.matrix() @ make_pose(p_AB=(0.0, 0.0, end * apart))
            axis_height = float(up @ X_OD[:3, 2])
            reach = radius * math.sqrt(max(0.0, 1.0 - axis_height**2)) + disc_thickness / 2 * abs(
                axis_height
            )
            sunk = max(0.0, reach - X_WO[2, 3] - float(up @ X_OD[:3, 3]))
            lies = abs(axis_height) < math.sqrt(0.5)
            sunk = min(sunk, (radius if lies else apart) / 2)
            X_OD[:3, 3] += 0.0 if lies else sunk * up
            yield f"rim_{k}", X_OD, Cylinder(radius - (sunk if lies else 0.0), disc_thickness)
        rims = transform_points(primitive.X_OP.matrix(), _rim_points(radius, length))
        feet = _raise_to_table(rims, X_WO, rims)
    for k, foot in enumerate(feet):
        yield f"foot_{k:03d}", make_pose(p_AB=foot), Sphere(0.0)


def _corner_feet(scene: Scene, name: str, X_WO: Array) -> Array:
    """Feet (F, 3) of an object of pieces or a surface, in O [m]."""
    settled_tolerance = 1e-3  # Metres above the lowest corner, of corners that carry the object.
    entry, up = scene.entry(name), np.round(X_WO[2, :3], 9)
    corners = support_corners(scene.library, entry)
    ups = [pose.X_SO.matrix()[2, :3] for pose in entry.stable_poses]
    rolling = [up_O for up_O, pose in zip(ups, entry.stable_poses, strict=True) if pose.rolls]
    center = np.array(entry.mass_properties.center_of_mass)
    carrying = carrying_corners(corners, up, center, settled_tolerance)
    placed = corners.copy()
    placed[carrying] = _raise_to_table(corners[carrying], X_WO, corners, settled_tolerance)
    chosen = support_feet(corners, [up, *ups], rolling, carrying)
    return _raise_to_table(placed[chosen], X_WO, corners)


def _raise_to_table(
    points: Array, X_WO: Array, corners: Array, max_gap: float = SUPPORT_HEIGHT_TOLERANCE
) -> Array:
    """Moves points (N, 3) in O vertically to the table's top if they are below it, or less than
    `max_gap` above it. Only points in the lower half of the object with corners (M, 3) move, and no
    farther than to its middle, so that thin objects keep some height."""
    up = np.round(X_WO[2, :3], 9)
    heights, reach = X_WO[2, 3] + points @ up, X_WO[2, 3] + corners @ up
    middle = (reach.min() + reach.max()) / 2
    shift = heights - min(0.0, middle)
    low = (heights < max_gap) & (heights <= middle)
    moved: Array = points - np.where(low, shift, 0.0)[:, None] * up
    return moved


def _rim_points(radius: float, length: float) -> Array:
    """Points (N, 3) on the two rims of a cylinder along z [m]."""
    foot_count = 8  # Feet on each rim of a cylinder.
    angle = 2.0 * np.pi * np.arange(foot_count) / foot_count
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    ends = np.full(foot_count, length / 2)
    return np.concatenate([np.stack([x, y, -ends], axis=1), np.stack([x, y, ends], axis=1)])


def _contact_properties(
    entry: ObjectEntry, dissipation: float, stiffness: float | None = None
) -> ProximityProperties:
    properties = ProximityProperties()
    friction = CoulombFriction(entry.friction, entry.friction)
    AddContactMaterial(
        dissipation=dissipation, point_stiffness=stiffness, friction=friction, properties=properties
    )
    return properties
