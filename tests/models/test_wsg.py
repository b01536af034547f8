"""The model of the WSG 50: figures of the data sheet, symmetry, files as their tool writes them."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from pydrake.geometry import Box, Role, VolumeMesh
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.planning import RobotDiagram, RobotDiagramBuilder

from burg_drake.core import resolve_reference
from burg_drake.station import Hand, check_hand, load_hand
from tools.wsg_model.__main__ import model_texts

FINGERS = ("wsg_left_finger", "wsg_right_finger")


@pytest.fixture(scope="module")
def hand() -> Hand:
    return load_hand("wsg_50")


@pytest.fixture(scope="module")
def diagram(hand: Hand) -> RobotDiagram:
    builder = RobotDiagramBuilder(time_step=0.001)
    builder.parser().AddModels(str(resolve_reference(hand.model)))
    builder.plant().WeldFrames(
        builder.plant().world_frame(), builder.plant().GetFrameByName(hand.body)
    )
    builder.plant().Finalize()
    return builder.Build()


def test_files_are_what_the_tool_writes() -> None:
    texts = model_texts()
    for path, text in texts.items():
        if path.endswith(".obj"):  # another platform may round a vertex otherwise
            continue
        assert (
            resolve_reference(f"package://burg_drake/models/{path}").read_text("utf-8") == text
        ), path
    folder = resolve_reference("package://burg_drake/models/wsg/wsg_50.sdf").parent
    written = {name for name in texts if name.startswith("wsg/")}
    assert {f"wsg/{p.relative_to(folder)}" for p in folder.rglob("*") if p.is_file()} == written


def test_figures_of_the_data_sheet(hand: Hand, diagram: RobotDiagram) -> None:
    """146 x 50 x 72.5 mm, 1.2 kg, stroke 110 mm, gripping force up to 80 N, 5 to 420 mm/s; force
    and speed are those of both fingers together."""
    plant = diagram.plant()
    inspector = diagram.scene_graph().model_inspector()
    context = plant.CreateDefaultContext()
    assert plant.CalcTotalMass(context, [ModelInstanceIndex(2)]) == pytest.approx(1.2)
    (body,) = (
        inspector.GetShape(g)
        for g in plant.GetCollisionGeometriesForBody(plant.GetBodyByName(hand.body))
        if inspector.GetName(g).endswith("body")
    )
    assert isinstance(body, Box)
    np.testing.assert_allclose(body.size(), (0.146, 0.050, 0.0725))
    joints = [plant.GetJointByName(finger.joint) for finger in hand.fingers]
    travel = [j.position_upper_limits()[0] - j.position_lower_limits()[0] for j in joints]
    assert sum(travel) == pytest.approx(0.110)
    assert sum(plant.GetJointActuatorByName(j.name()).effort_limit() for j in joints) == 80.0
    assert sum(j.velocity_upper_limits()[0] for j in joints) == pytest.approx(0.420)
    assert 2.5 <= hand.force <= 40.0
    assert 0.0025 <= hand.closing_speed <= 0.210


def test_pads_meet_when_closed_and_open_to_110_mm(hand: Hand) -> None:
    figures = check_hand(hand, resolve_reference(hand.model))
    assert figures.opening == pytest.approx((0.0, 0.110), abs=1e-9)
    assert figures.pad_size == pytest.approx((0.008, 0.020, 0.020), abs=1e-9)


def test_fingers_mirror_each_other(diagram: RobotDiagram) -> None:
    left, right = (diagram.plant().GetBodyByName(name) for name in FINGERS)
    turn = np.diag([-1.0, -1.0, 1.0])
    np.testing.assert_allclose(right.default_com(), turn @ left.default_com(), atol=1e-15)
    I_left, I_right = (
        b.default_spatial_inertia().CalcRotationalInertia().CopyToFullMatrix3()
        for b in (left, right)
    )
    np.testing.assert_allclose(I_right, turn @ I_left @ turn, atol=1e-18)
    # The centre of mass is in the finger, outwards of its pad.
    assert 0.0 < left.default_com()[0] < 0.016 and 0.0 < left.default_com()[2] < 0.083


def test_pads_are_tetrahedra_that_both_fingers_have_alike(diagram: RobotDiagram) -> None:
    """36 of them fill the box, and its front, that alone is divided, looks at the other finger."""
    plant, inspector = diagram.plant(), diagram.scene_graph().model_inspector()
    seen = []
    for finger, inwards in zip(FINGERS, (-1.0, 1.0), strict=True):
        (pad,) = (
            g
            for g in plant.GetCollisionGeometriesForBody(plant.GetBodyByName(finger))
            if inspector.GetName(g).endswith("pad")
        )
        mesh = inspector.maybe_get_hydroelastic_mesh(pad)
        assert isinstance(mesh, VolumeMesh)
        assert mesh.CalcVolume() == pytest.approx(0.008 * 0.020 * 0.020)
        X_FP = inspector.GetPoseInFrame(pad)
        points = np.array([X_FP @ mesh.vertex(i) for i in range(mesh.num_vertices())])
        x = inwards * points[:, 0]
        assert (np.isclose(x, x.max()).sum(), np.isclose(x, x.min()).sum()) == (16, 4)
        seen.append((points, [[t.vertex(i) for i in range(4)] for t in mesh.tetrahedra()]))
    (left, cells), (right, other) = seen
    assert len(cells) == 36
    assert other == cells
    np.testing.assert_allclose(left * (-1.0, -1.0, 1.0), right, atol=1e-12)


def test_collision_geometry_covers_the_looks(diagram: RobotDiagram) -> None:
    """What is seen is not nearer to an object than what collides, by more than a line's breadth."""
    plant, inspector = diagram.plant(), diagram.scene_graph().model_inspector()
    for name in ("wsg_body", *FINGERS):
        frame = plant.GetBodyFrameIdOrThrow(plant.GetBodyByName(name).index())
        bounds = {}
        for role in (Role.kProximity, Role.kIllustration):
            corners = []
            for geometry in inspector.GetGeometries(frame, role):
                shape, X_FG = inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry)
                if isinstance(shape, Box):
                    signs = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1)
                    corners.append(X_FG @ (signs * shape.size()[:, None]))
                else:
                    hull = inspector.GetConvexHull(geometry)
                    vertices = [hull.vertex(i) for i in range(hull.num_vertices())]
                    corners.append(X_FG @ np.array(vertices).T)
            points = np.concatenate(corners, axis=1)
            bounds[role] = np.stack([points.min(axis=1), points.max(axis=1)])
        solid, seen = bounds[Role.kProximity], bounds[Role.kIllustration]
        assert (solid[0] <= seen[0] + 1e-3).all() and (solid[1] >= seen[1] - 1e-3).all(), name


def test_parses_without_a_word(hand: Hand, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, logger="drake"):
        builder = RobotDiagramBuilder(time_step=0.001)
        builder.parser().AddModels(str(resolve_reference(hand.model)))
        assert builder.plant().num_constraints() == 1
    assert [record.getMessage() for record in caplog.records] == []
