"""Balls meet table and objects at a point, as they do in the world, and pads on a patch.

Drake's patches come from a polyhedron. A ball among them rolls by itself: over its facets, 2 mm in
the first five seconds on a level table, and on for as long as one looks. At a point it stands. What
grips it needs the patch, which a point does not replace: it bears no torque.
"""

from __future__ import annotations

from pydrake.geometry import AddContactMaterial, ProximityProperties, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.tree import RigidBody
from pydrake.planning import RobotDiagramBuilder

from burg_drake.scene.document import Scene

ROLLING = "rolling"
"""Name of the geometry of a ball that meets things at points."""


def is_ball(scene: Scene, name: str) -> bool:
    """Whether `name` is an instance whose contact geometry is a sphere."""
    if name not in scene.instances and name not in scene.background:
        return False
    contact = scene.entry(name).contact
    return (
        contact.kind == "primitive"
        and contact.primitive is not None
        and contact.primitive.shape == "sphere"
    )


def add_rolling(builder: RobotDiagramBuilder, scene: Scene, name: str, body: RigidBody) -> None:
    """Adds the sphere by which a ball rolls; `separate_contact` says what it meets."""
    primitive = scene.entry(name).contact.primitive
    assert primitive is not None
    plant = builder.plant()
    (patch,) = plant.GetCollisionGeometriesForBody(body)
    rigid = builder.scene_graph().model_inspector().GetProximityProperties(patch)
    properties = ProximityProperties()
    AddContactMaterial(
        dissipation=rigid.GetProperty("material", "hunt_crossley_dissipation"),
        friction=rigid.GetProperty("material", "coulomb_friction"),
        properties=properties,
    )
    X_OP = RigidTransform(primitive.X_OP.matrix())
    plant.RegisterCollisionGeometry(body, X_OP, Sphere(primitive.size[0]), ROLLING, properties)
