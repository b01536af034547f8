"""Confirmed resting poses against closed forms: what stands, what topples, what rolls.

A prism on a base of width w with its centre of mass h above it topples when it is tilted by more
than arctan(w / 2h); the tilt of a drop is known.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from burg_drake.core import Array, Pose
from burg_drake.objects import (
    LibraryDocument,
    ObjectEntry,
    ObjectLibrary,
    Source,
    StablePose,
    mass_properties,
    model_sdf,
    resting_pose,
    solid_of_surface,
    stable_poses,
    write_piece,
)
from burg_drake.simulation import Confirmation, DropSettings, confirm_poses

X, Y, Z = np.eye(3)


def make_library(
    root: Path,
    mesh: trimesh.Trimesh,
    downs: dict[float, Array] | None = None,
    *,
    p_OOcm: Array | None = None,
    mass: float = 0.2,
    friction: float = 0.3,
) -> ObjectLibrary:
    """A library of one convex object; its poses are the quasi-static ones, or `downs` by their
    probabilities."""
    (root / "thing").mkdir(parents=True, exist_ok=True)
    write_piece(mesh, root / "thing/mesh.obj")
    properties = mass_properties(solid_of_surface(mesh), mass)
    if p_OOcm is not None:
        properties = replace(properties, center_of_mass=tuple(np.asarray(p_OOcm).tolist()))
    center = np.array(properties.center_of_mass)
    poses = stable_poses(mesh, np.asarray(mesh.vertices), center)
    if downs is not None:
        poses = tuple(
            StablePose(
                probability=probability,
                X_SO=Pose.from_matrix(
                    resting_pose(down, float(((mesh.vertices - center) @ down).max()), center),
                    quaternion=True,
                ),
            )
            for probability, down in downs.items()
        )
    sdf = model_sdf("thing", properties, friction, "mesh.obj", ["mesh.obj"])
    (root / "thing/thing.sdf").write_text(sdf, encoding="utf-8")
    lower, upper = mesh.bounds.tolist()
    entry = ObjectEntry(
        mesh="thing/mesh.obj",
        sdf="thing/thing.sdf",
        pieces=("thing/mesh.obj",),
        friction=friction,
        lower=tuple(lower),
        upper=tuple(upper),
        mass_properties=properties,
        stable_poses=poses,
        source=Source(file="", sha256=""),
        build="",
    )
    return ObjectLibrary(LibraryDocument(name="test", objects={"thing": entry}), root)


def confirm(root: Path, mesh: trimesh.Trimesh, *args, **more) -> Confirmation:  # type: ignore[no-untyped-def]
    return confirm_poses(make_library(root, mesh, *args, **more), "thing")


def up(pose: StablePose) -> Array:
    """(3,) direction of O that points up."""
    return pose.X_SO.matrix()[2, :3]


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_a_plate_on_edge_stands_if_its_tilt_is_below_the_closed_form(
    tmp_path: Path, share: float
) -> None:
    height = 0.2
    width = height * np.tan(share * DropSettings.tilt)  # it topples at this share of the tilt
    plate = trimesh.creation.box((height, 0.08, width))
    found = confirm(tmp_path, plate, {0.9: -Z, 0.1: -X})
    if share > 1.0:
        assert [p.probability for p in found.poses] == [0.9, 0.1]
        assert found.notes == ()
    else:
        assert [p.probability for p in found.poses] == [1.0]
        assert found.notes == (
            "a stable pose (10.0 %) topples in simulation and is left out; its probability goes"
            " to the poses in which the object ends up",
        )
    for pose in found.poses:
        assert pose.residual is not None and pose.residual < DropSettings.tilt


@pytest.mark.parametrize(("share", "stands"), [(0.5, False), (8.0, True)])
def test_a_weighted_box_topples_over_the_edge_that_is_near(
    tmp_path: Path, share: float, stands: bool
) -> None:
    """Seen from outside it is a cube. It has to be far within the closed form here: tilted sideways
    it lands on a corner that is nearly below its centre of mass."""
    half = 0.03
    p_OOcm = np.array([half - half * np.tan(share * DropSettings.tilt), 0.0, 0.0])
    cube = trimesh.creation.box((2 * half,) * 3)
    found = confirm(tmp_path, cube, {0.7: X, 0.3: -Z}, p_OOcm=p_OOcm)
    assert [p.probability for p in found.poses] == ([0.7, 0.3] if stands else [1.0])


def test_a_rod_does_not_stand_and_rolls(tmp_path: Path) -> None:
    length = 0.18
    rod = trimesh.creation.cylinder(
        0.5 * length * np.tan(0.5 * DropSettings.tilt), length, sections=32
    )
    (quasi_static,) = make_library(tmp_path, rod).entry("thing").stable_poses
    poses = {0.4: -Z, 0.6: -quasi_static.X_SO.matrix()[2, :3]}
    library = make_library(tmp_path, rod, poses)
    assert [p.rolls for p in library.entry("thing").stable_poses] == [False, False]
    (lying,) = confirm_poses(library, "thing").poses
    assert abs(up(lying)[2]) < 1e-6
    assert lying.probability == 1.0


def test_a_sphere_is_one_class_and_rolls(tmp_path: Path) -> None:
    (pose,) = confirm(tmp_path, trimesh.creation.icosphere(3, 0.02)).poses
    assert pose.probability == 1.0
    assert pose.rolls
    assert pose.residual is not None and pose.residual < np.deg2rad(0.5)


def test_a_can_stands_or_lies(tmp_path: Path) -> None:
    can = trimesh.creation.cylinder(0.03, 0.1, sections=48)
    found = confirm(tmp_path, can)
    assert found.notes == ()
    lying, upright = found.poses
    assert (lying.rolls, upright.rolls) == (True, False)
    assert abs(up(lying)[2]) < 1e-6
    assert abs(up(upright)[2]) > 1.0 - 1e-6
    for pose in found.poses:
        assert pose.residual is not None and pose.residual < np.deg2rad(0.5)


def test_a_roly_poly_rights_itself(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(3, 0.04)
    half = trimesh.convex.convex_hull(ball.vertices[ball.vertices[:, 2] < 1e-9])
    poses = {0.5: -Z, 0.5 - 1e-9: np.array([np.sin(0.6), 0.0, -np.cos(0.6)])}
    (pose,) = confirm(tmp_path, half, poses, p_OOcm=np.array([0, 0, -0.03])).poses
    np.testing.assert_allclose(up(pose), Z)
    assert pose.residual is not None and pose.residual < np.deg2rad(6.0)  # facets of the ball


@pytest.mark.thorough
def test_where_it_ends_up_is_not_a_known_pose(tmp_path: Path) -> None:
    plate = trimesh.creation.box((0.1, 0.04, 0.1 * np.tan(0.5 * DropSettings.tilt)))
    found = confirm(tmp_path, plate, {0.25: -X, 0.75: -Y})  # both are edges, neither stands
    assert len(found.poses) == 1
    assert found.poses[0].probability == 1.0
    assert found.poses[0].residual == pytest.approx(0.5 * np.pi, abs=0.02)
    assert "the most probable one is kept, though the object tilts by 90 degrees" in found.notes[0]


def test_shares_that_are_lost(tmp_path: Path) -> None:
    plate = trimesh.creation.box((0.1, 0.1 * np.tan(3.0 * DropSettings.tilt), 0.2))
    slab = np.array([0.0, -1.0, 0.0])
    # upright on the small face it topples onto the large one, which is not among the poses
    bent = np.array([np.sin(0.5), 0.0, -np.cos(0.5)])
    found = confirm(tmp_path, plate, {0.6: -X, 0.4: bent})
    assert [p.probability for p in found.poses] == [1.0]
    assert found.poses[0].residual is not None and found.poses[0].residual < 0.01
    assert slab @ up(found.poses[0]) == pytest.approx(0.0, abs=1e-9)
    assert "(40.0 %) topples" in found.notes[0]


@pytest.mark.thorough
def test_mass_and_friction_do_not_matter(tmp_path: Path) -> None:
    box = trimesh.creation.box((0.1, 0.06, 0.04))
    light = confirm(tmp_path / "light", box, mass=0.02, friction=0.05)
    heavy = confirm(tmp_path / "heavy", box, mass=20.0, friction=1.5)
    assert light == heavy


def test_the_same_twice_and_for_a_mesh_turned_in_its_frame(tmp_path: Path) -> None:
    """The first tilt is to the weakest side, wherever that is in the object frame."""
    corners = [[0, 0, 0], [9, 0, 0], [2, 6, 0], [4, 2, 5]]
    mesh = trimesh.convex.convex_hull(0.01 * np.array(corners))
    turned = mesh.copy().apply_transform(
        trimesh.transformations.rotation_matrix(2.0, [3, 1, -2], [0.1, 0.2, 0.3])
    )
    before, after = confirm(tmp_path / "a", mesh), confirm(tmp_path / "b", turned)
    assert confirm(tmp_path / "a", mesh) == before
    assert len(before.poses) > 1
    assert [p.probability for p in after.poses] == pytest.approx(
        [p.probability for p in before.poses], abs=2e-6
    )
    for a, b in zip(before.poses, after.poses, strict=True):
        assert a.residual == pytest.approx(b.residual, abs=np.deg2rad(0.6))


def test_a_failure_of_the_simulator_is_a_note(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = make_library(tmp_path, trimesh.creation.box((0.1, 0.06, 0.04)))
    poses = library.entry("thing").stable_poses

    def fail(*_: object) -> None:
        raise SystemExit("Failure at multibody/plant: condition 'x > 0' failed.")

    monkeypatch.setattr("burg_drake.simulation.stable_pose_drops.DropTest.run", fail)
    found = confirm_poses(library, "thing")
    assert found.poses == poses
    assert found.notes == (
        "stable poses are not confirmed by simulation: Failure at multibody/plant: condition 'x >"
        " 0' failed.",
    )
    monkeypatch.undo()
    (tmp_path / "thing/thing.sdf").unlink()
    assert "thing.sdf is missing" in confirm_poses(library, "thing").notes[0]
