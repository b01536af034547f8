"""The hand screen against an oracle that knows nothing of Drake: points sampled in the hand."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Capsule, GeometryInstance, SceneGraph
from pydrake.math import RigidTransform

from burg_drake.core import (
    InvalidInputError,
    Outcome,
    Pose,
    grasp_from_axes,
    inverse,
    make_pose,
    resolve_reference,
    rotation_from_rpy,
    swap_fingers,
    transform_points,
)
from burg_drake.grasping import HandClearance, shape_of
from burg_drake.pipeline import ObjectSource, build_library
from burg_drake.scene import Instance, SceneDocument, load_scene, save_scene
from burg_drake.station import Station, StationDocument, Table, build_station_diagram, load_hand

SIZES = {"box": (0.05, 0.08, 0.10), "plate": (0.2, 0.2, 0.02)}
PLACES = {"box": (0.2, 0.2), "plate": (0.38, 0.2)}


@pytest.fixture(scope="module")
def clearance(tmp_path_factory: pytest.TempPathFactory) -> HandClearance:
    folder = tmp_path_factory.mktemp("clearance")
    lift = trimesh.transformations.translation_matrix
    sources = [
        ObjectSource(name=n, mesh=trimesh.creation.box(s, lift((0, 0, s[2] / 2))), mass=0.2)
        for n, s in SIZES.items()
    ]
    build_library(sources, folder / "library", confirm=False)
    instances = tuple(Instance(object=n, X_SO=Pose((*PLACES[n], 0.0))) for n in SIZES)
    document = SceneDocument(name="test", library="library", instances=instances)
    save_scene(document, folder / "scene.yaml")
    hand = load_hand("panda_hand")
    station = Station(
        StationDocument(name="test", table=Table(center=(0.3, 0.2))),
        hand,
        resolve_reference(hand.model),
        None,
        Path("test.yaml"),
    )
    scene = load_scene(folder / "scene.yaml")
    return HandClearance(build_station_diagram(scene, station, robot="hand"))


def hand_points() -> np.ndarray:
    """Points that fill the collision boxes of the open hand, in the grasp frame, from the model
    file alone; boxes written as meshes are taken by their bounds."""
    hand = load_hand("panda_hand")
    path = resolve_reference(hand.model)
    model = ElementTree.parse(path).getroot().find("model")
    assert model is not None
    X_HL = {"panda_hand": np.eye(4)}
    for side, finger in zip((1.0, -1.0), hand.fingers, strict=True):
        X_HL[finger.body] = make_pose(p_AB=(0.0, side * finger.open, 0.0584))
    clouds = []
    for link in model.findall("link"):
        for collision in link.findall("collision"):
            numbers = [float(v) for v in (collision.findtext("pose") or "0 0 0 0 0 0").split()]
            X_LB = make_pose(rotation_from_rpy(numbers[3:]), numbers[:3])
            size = collision.findtext("geometry/box/size")
            if size:
                half = np.array([float(v) for v in size.split()]) / 2
            else:
                half = pad_half_size(path.parent / (collision.findtext("geometry/mesh/uri") or ""))
            grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 12)] * 3), -1).reshape(-1, 3)
            clouds.append(transform_points(X_HL[link.get("name", "")] @ X_LB, grid * half))
    return transform_points(inverse(hand.X_HG.matrix()), np.concatenate(clouds))


def pad_half_size(vtk: Path) -> np.ndarray:
    """Half extents of a tetrahedral mesh in VTK's text format."""
    lines = vtk.read_text().splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("POINTS"))
    count = int(lines[start].split()[1])
    points = np.array([[float(v) for v in s.split()] for s in lines[start + 1 : start + 1 + count]])
    return np.ptp(points, axis=0) / 2


def deepest(points_W: np.ndarray) -> dict[str, float]:
    """How deep points are in the table and in the two boxes [m]; negative outside."""
    depth = {"table": float(-points_W[:, 2].min())}
    for name, size in SIZES.items():
        half = np.array(size) / 2
        centre = np.array([*PLACES[name], half[2]])
        depth[name] = float((half - np.abs(points_W - centre)).min(axis=1).max())
    return depth


def random_grasps(n: int) -> np.ndarray:
    rng = np.random.default_rng(1)
    position = np.column_stack(
        [rng.uniform(0.1, 0.5, n), rng.uniform(0.1, 0.3, n), rng.uniform(0.0, 0.15, n)]
    )
    approach = rng.normal(size=(n, 3)) - (0, 0, 1.5)
    return grasp_from_axes(rng.normal(size=(n, 3)), approach, position)


def test_agrees_with_points_in_the_hand(clearance: HandClearance) -> None:
    points_G = hand_points()
    found = 0
    for X_WG in random_grasps(200):
        depth = deepest(transform_points(X_WG, points_G))
        verdict = clearance.check("box", X_WG)
        if verdict.outcome is None:
            assert max(depth.values()) <= 1e-9
            found += 1
        elif verdict.overlap < 0.004:
            continue  # a corner may lie between the points
        else:
            assert max(depth.values()) > 0.0
            assert depth[verdict.blocker] > 0.0
    assert found > 20


def test_swapped_fingers_get_the_same_verdict(clearance: HandClearance) -> None:
    for X_WG in random_grasps(80):
        one, other = (clearance.check("box", X) for X in (X_WG, swap_fingers(X_WG)))
        assert (one.outcome, one.blocker) == (other.outcome, other.blocker)
        assert one.overlap == pytest.approx(other.overlap, abs=1e-7)


def test_agrees_with_drake_and_is_the_same_in_a_batch(clearance: HandClearance) -> None:
    grasps = random_grasps(300)
    verdicts = clearance.check_all("box", grasps)
    assert verdicts[:40] == [clearance.check("box", X_WG) for X_WG in grasps[:40]]
    assert 30 < sum(v.outcome is None for v in verdicts) < 270
    for X_WG, verdict in zip(grasps, verdicts, strict=True):
        touched = clearance.touched(X_WG)
        assert verdict.overlap < 1e-6 or verdict.blocker in touched
        assert bool(touched) == (verdict.outcome is not None) or verdict.overlap < 1e-6
        if {"box", "table"} <= touched.keys():
            assert verdict.blocker == "box"


def test_what_is_not_a_pose_is_refused(clearance: HandClearance) -> None:
    X_WG = np.eye(4)
    X_WG[0, 3] = np.nan
    with pytest.raises(InvalidInputError, match=r"X_WG\[0\] has NaN"):
        clearance.check("box", X_WG)
    assert clearance.check_all("box", np.empty((0, 4, 4))) == []


def test_a_shape_that_the_screen_does_not_know_is_named() -> None:
    graph = SceneGraph()
    source = graph.RegisterSource("test")
    tip = GeometryInstance(RigidTransform(), Capsule(0.01, 0.02), "tip")
    geometry = graph.RegisterAnchoredGeometry(source, tip)
    with pytest.raises(
        InvalidInputError,
        match=r"'tip' is a Capsule; .* boxes, cylinders",
    ):
        shape_of(graph.model_inspector(), geometry, np.eye(4))


def test_depth_in_the_table_is_that_of_the_lowest_point(clearance: HandClearance) -> None:
    points_G = hand_points()
    down = make_pose(np.diag([1.0, -1.0, -1.0]), (0.0, 0.45, 0.0))
    for tilt in (0.0, 0.2, -0.4):
        X_WG = down @ make_pose(rotation_from_rpy((0.0, tilt, 0.3)), (0.0, 0.0, -0.005))
        verdict = clearance.check("box", X_WG)
        assert verdict.outcome is Outcome.COLLISION_TABLE
        lowest = transform_points(X_WG, points_G)[:, 2].min()
        assert verdict.overlap == pytest.approx(-lowest, abs=1e-6)


def test_target_and_clutter_are_told_apart(clearance: HandClearance) -> None:
    down = make_pose(np.diag([1.0, -1.0, -1.0]), (0.2, 0.2, 0.03))
    assert clearance.check("box", down).outcome is Outcome.COLLISION_TARGET
    assert clearance.check("plate", down).outcome is Outcome.COLLISION_CLUTTER
    assert clearance.check("plate", down).blocker == "box"
