"""The SDF: what Drake makes of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    Box,
    ProximityProperties,
    Role,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    ContactResults,
    CoulombFriction,
    MultibodyPlantConfig,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from burg_drake.core import Pose, make_pose, rotation_from_rpy
from burg_drake.objects import (
    DEFAULT_CONTACT,
    ContactGeometry,
    ContactParameters,
    Primitive,
    mass_properties,
    model_sdf,
    resolution_hint,
    solid_of_surface,
    write_piece,
    write_visual,
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    box = _box()
    write_visual(box, tmp_path / "mesh.obj")
    write_piece(box, tmp_path / "pieces" / "000.obj")
    return tmp_path


def _box() -> trimesh.Trimesh:
    return trimesh.creation.box((0.1, 0.06, 0.03)).apply_translation([0.01, 0.02, 0.03])


def _text(
    contact: ContactGeometry = ContactGeometry(), material: ContactParameters = DEFAULT_CONTACT
) -> str:
    m = mass_properties(solid_of_surface(_box()), mass=0.2)
    return model_sdf("box", m, 0.31, "mesh.obj", ["pieces/000.obj"], contact, material)


BOX = ContactGeometry(
    kind="primitive",
    primitive=Primitive(shape="box", size=(0.1, 0.06, 0.03), X_OP=Pose((0.01, 0.02, 0.03))),
)


@dataclass
class Parsed:
    """The model and a compliant ground."""

    text: str
    folder: Path

    def __post_init__(self) -> None:
        (self.folder / "box.sdf").write_text(self.text)
        builder = DiagramBuilder()
        config = MultibodyPlantConfig(
            time_step=1e-3,
            contact_model="hydroelastic_with_fallback",
            use_sampled_output_ports=False,
        )
        self.plant, self.scene_graph = AddMultibodyPlant(config, builder)
        parser = Parser(self.plant)
        parser.SetStrictParsing()  # warnings are errors
        (model,) = parser.AddModels(str(self.folder / "box.sdf"))
        self.body = self.plant.GetBodyByName("body", model)
        ground = ProximityProperties()
        AddCompliantHydroelasticProperties(0.05, 1e6, ground)
        AddContactMaterial(friction=CoulombFriction(0.5, 0.5), properties=ground)
        self.plant.RegisterCollisionGeometry(
            self.plant.world_body(),
            RigidTransform([0.0, 0.0, -0.05]),
            Box(1.0, 1.0, 0.1),
            "ground",
            ground,
        )
        self.plant.Finalize()
        self.diagram = builder.Build()

    def settled(self) -> tuple[ContactResults, float]:
        """Contacts and depth [m] in the ground, after half a second on it."""
        simulator = Simulator(self.diagram)
        own = self.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        self.plant.SetFreeBodyPose(own, self.body, RigidTransform([0.0, 0.0, -0.015]))
        simulator.AdvanceTo(0.5)
        contacts = self.plant.get_contact_results_output_port().Eval(own)
        return contacts, -0.015 - self.plant.EvalBodyPoseInWorld(own, self.body).translation()[2]


def test_mass_properties_arrive_in_full_precision(folder: Path) -> None:
    m = mass_properties(solid_of_surface(_box()), mass=0.2)
    inertia = Parsed(_text(), folder).body.default_spatial_inertia()
    assert inertia.get_mass() == 0.2
    np.testing.assert_array_equal(inertia.get_com(), m.center_of_mass)
    about_com = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
    np.testing.assert_allclose(about_com.get_moments(), m.inertia[:3], rtol=1e-12)
    np.testing.assert_allclose(about_com.get_products(), m.inertia[3:], atol=1e-15)


def test_pieces_are_convex_and_have_friction(folder: Path) -> None:
    parsed = Parsed(_text(), folder)
    inspector = parsed.scene_graph.model_inspector()
    (collision,) = parsed.plant.GetCollisionGeometriesForBody(parsed.body)
    assert type(inspector.GetShape(collision)).__name__ == "Convex"
    friction = inspector.GetProximityProperties(collision).GetProperty(
        "material", "coulomb_friction"
    )
    assert (friction.static_friction(), friction.dynamic_friction()) == (0.31, 0.31)


def test_compliant_things_meet_the_pieces_by_a_surface(folder: Path) -> None:
    """Statics: the rigid box sinks until pressure times area is its weight; the pressure is the
    modulus times the depth over the 0.05 m from the ground's surface to its middle."""
    contacts, depth = Parsed(_text(), folder).settled()
    assert contacts.num_point_pair_contacts() == 0
    assert contacts.num_hydroelastic_contacts() == 1
    assert depth == pytest.approx(0.2 * 9.81 / (0.1 * 0.06) * 0.05 / 1e6, rel=0.02)


def test_compliant_pieces_yield_as_well(folder: Path) -> None:
    _, rigid = Parsed(_text(), folder).settled()
    compliant = ContactGeometry(kind="compliant_pieces")
    _, soft = Parsed(_text(compliant, ContactParameters(modulus=1e5)), folder).settled()
    assert soft > 2.0 * rigid


@pytest.mark.parametrize("contact", [BOX, ContactGeometry(kind="mesh", mesh="box/contact.obj")])
def test_a_primitive_and_a_mesh_rest_like_the_piece(folder: Path, contact: ContactGeometry) -> None:
    write_piece(_box(), folder / "contact.obj")
    contacts, depth = Parsed(_text(contact), folder).settled()
    assert contacts.num_point_pair_contacts() == 0
    assert contacts.num_hydroelastic_contacts() == 1
    assert depth == pytest.approx(0.2 * 9.81 / (0.1 * 0.06) * 0.05 / 1e6, rel=0.02)


def test_a_mesh_keeps_its_hollows(folder: Path) -> None:
    """Of a U on the ground, legs down, Drake makes a surface that is not its convex hull."""
    u = trimesh.boolean.union(
        [
            trimesh.creation.box((0.1, 0.06, 0.01)),
            *(
                trimesh.creation.box((0.01, 0.06, 0.03)).apply_translation((x, 0, -0.015))
                for x in (-0.045, 0.045)
            ),
        ]
    )
    write_piece(u, folder / "contact.obj")
    parsed = Parsed(_text(ContactGeometry(kind="mesh", mesh="contact.obj")), folder)
    surface = _hydroelastic_mesh(parsed)
    assert surface.volume == pytest.approx(u.volume, rel=1e-9)
    assert surface.volume < 0.5 * u.convex_hull.volume


def _hydroelastic_mesh(parsed: Parsed) -> trimesh.Trimesh:
    """The surface that Drake cuts of the model's only collision geometry, in its own frame."""
    (collision,) = parsed.plant.GetCollisionGeometriesForBody(parsed.body)
    mesh = parsed.scene_graph.model_inspector().maybe_get_hydroelastic_mesh(collision)
    vertices = [mesh.vertex(i) for i in range(mesh.num_vertices())]
    faces = [[mesh.element(i).vertex(k) for k in range(3)] for i in range(mesh.num_elements())]
    return trimesh.Trimesh(vertices, faces, process=False)


@pytest.mark.parametrize(
    "primitive",
    [
        Primitive(shape="box", size=(0.1, 0.06, 0.03)),
        Primitive(shape="cylinder", size=(0.034, 0.1)),
        Primitive(shape="cylinder", size=(0.004, 0.15)),
        Primitive(shape="sphere", size=(0.015,)),
        Primitive(shape="sphere", size=(0.05,)),
    ],
)
def test_primitives_arrive_in_place_and_fine_enough(folder: Path, primitive: Primitive) -> None:
    X_OP = make_pose(rotation_from_rpy((0.3, -1.2, 2.5)), (0.011, -0.023, 0.17))
    placed = Primitive(
        shape=primitive.shape,
        size=primitive.size,
        X_OP=Pose.from_matrix(X_OP, quaternion=True),
    )
    parsed = Parsed(_text(ContactGeometry(kind="primitive", primitive=placed)), folder)
    inspector = parsed.scene_graph.model_inspector()
    (collision,) = parsed.plant.GetCollisionGeometriesForBody(parsed.body)
    np.testing.assert_allclose(inspector.GetPoseInFrame(collision).GetAsMatrix4(), X_OP, atol=1e-15)
    shape = inspector.GetShape(collision)
    size = {
        "Box": lambda: tuple(shape.size()),
        "Cylinder": lambda: (shape.radius(), shape.length()),
        "Sphere": lambda: (shape.radius(),),
    }[type(shape).__name__]()
    assert size == primitive.size
    if primitive.shape == "box":
        return
    # the middle of each facet is as far inside as the facets' planes are
    surface = _hydroelastic_mesh(parsed)
    planes = (surface.triangles[:, 0] * surface.face_normals).sum(axis=1)
    side = (
        np.abs(surface.face_normals[:, 2]) < 0.99 if primitive.shape == "cylinder" else planes > 0
    )
    inside = primitive.size[0] - planes[side]
    assert 0.2 * DEFAULT_CONTACT.faceting < inside.max() <= DEFAULT_CONTACT.faceting


def test_coarser_facets_need_a_longer_hint() -> None:
    cylinder = Primitive(shape="cylinder", size=(0.03, 0.1))
    sphere = Primitive(shape="sphere", size=(0.03,))
    for primitive in (cylinder, sphere):
        assert resolution_hint(primitive, 1e-3) > resolution_hint(primitive, 1e-4)
        assert resolution_hint(primitive, 1.0) <= 2 * np.pi * 0.03 / 3 + 1e-9


def test_visual_is_the_mesh(folder: Path) -> None:
    parsed = Parsed(_text(), folder)
    inspector = parsed.scene_graph.model_inspector()
    frame = parsed.plant.GetBodyFrameIdOrThrow(parsed.body.index())
    (visual,) = inspector.GetGeometries(frame, Role.kIllustration)
    assert type(inspector.GetShape(visual)).__name__ == "Mesh"


def test_names_are_escaped() -> None:
    m = mass_properties(solid_of_surface(_box()), mass=0.2)
    assert 'name="a&amp;b"' in model_sdf("a&b", m, 0.2, "mesh.obj", [])
