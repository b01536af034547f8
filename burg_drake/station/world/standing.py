"""Objects that only stand there, where a single other one can move: each a hull of its own, welded.

Whoever meets a hull may meet the object; what happens then is not for this world to say. Hulls cost
a fraction of the pieces, as Drake looks at every two geometries that are near each other.
"""

from __future__ import annotations

from pydrake.geometry import (
    Convex,
    GeometryId,
    GeometryInstance,
    IllustrationProperties,
    Mesh,
    ProximityProperties,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia

from burg_drake.core import Array
from burg_drake.objects.collision import hull_corners
from burg_drake.objects.library import LINK
from burg_drake.scene.document import Scene
from burg_drake.station.world.instances import name_taken_error
from burg_drake.station.world.robot import ROBOT_MODELS


def add_standing(plant: MultibodyPlant, scene: Scene, name: str, X_WO: Array) -> RigidBody:
    """Adds an instance as a hull and a mesh to look at, welded where it stands."""
    if plant.HasModelInstanceNamed(name) or name in ROBOT_MODELS:
        raise name_taken_error(scene, name)
    entry, model = scene.entry(name), plant.AddModelInstance(name)
    body = plant.AddRigidBody(LINK, model, SpatialInertia.SolidSphereWithMass(entry.mass, 0.01))
    add_hull(plant, scene, name, body)
    look = GeometryInstance(RigidTransform(), Mesh(str(scene.library.path(entry.mesh))), "visual")
    look.set_illustration_properties(IllustrationProperties())
    plant.RegisterVisualGeometry(body, look)
    plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(X_WO))
    return body


def add_hull(plant: MultibodyPlant, scene: Scene, name: str, body: RigidBody) -> GeometryId:
    """Adds the convex hull of all that touches others of an instance."""
    shape = Convex(hull_corners(scene.library, scene.entry(name)).T, name)
    X = RigidTransform()
    return plant.RegisterCollisionGeometry(body, X, shape, "hull", ProximityProperties())
