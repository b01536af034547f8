"""Mass properties against closed forms and against Drake's own integrals."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Mesh as DrakeMesh
from pydrake.multibody.tree import CalcSpatialInertia

from burg_drake.core import InvalidInputError
from burg_drake.objects import (
    DEFAULT_DENSITY,
    implausible_properties,
    inertia_matrix,
    mass_properties,
    solid_of_pieces,
    solid_of_surface,
)


def test_box() -> None:
    a, b, c = 0.1, 0.06, 0.03
    box = trimesh.creation.box((a, b, c)).apply_translation([0.3, -0.2, 0.5])
    m = mass_properties(solid_of_surface(box), mass=0.6)
    assert m.volume == pytest.approx(a * b * c, rel=1e-12)
    np.testing.assert_allclose(m.center_of_mass, [0.3, -0.2, 0.5], atol=1e-13)
    expected = 0.6 / 12.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b, 0, 0, 0])
    np.testing.assert_allclose(m.inertia, expected, atol=1e-15, rtol=1e-11)


def test_inertia_is_in_the_axes_of_O() -> None:
    a, b, c = 0.1, 0.06, 0.03
    R = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])
    box = trimesh.creation.box((a, b, c)).apply_transform(R)
    m = mass_properties(solid_of_surface(box), mass=1.0)
    principal = np.diag([b * b + c * c, a * a + c * c, a * a + b * b]) / 12.0
    np.testing.assert_allclose(
        inertia_matrix(m.inertia), R[:3, :3] @ principal @ R[:3, :3].T, atol=1e-15
    )


def test_cylinder() -> None:
    r, h = 0.03, 0.12
    cylinder = trimesh.creation.cylinder(r, h, sections=400)
    m = mass_properties(solid_of_surface(cylinder), mass=0.5)
    assert m.volume == pytest.approx(np.pi * r * r * h, rel=1e-4)
    side = 0.5 * (3 * r * r + h * h) / 12.0
    np.testing.assert_allclose(m.inertia[:3], [side, side, 0.25 * r * r], rtol=1e-4)


def test_hollow_sphere() -> None:
    r1, r2 = 0.05, 0.04
    inner = trimesh.creation.icosphere(subdivisions=4, radius=r2)
    inner.invert()
    shell = trimesh.util.concatenate([trimesh.creation.icosphere(subdivisions=4, radius=r1), inner])
    m = mass_properties(solid_of_surface(shell), mass=0.2)
    expected = 2.0 / 5.0 * 0.2 * (r1**5 - r2**5) / (r1**3 - r2**3)
    np.testing.assert_allclose(m.inertia[:3], [expected] * 3, rtol=3e-3)


def test_agrees_with_drake(tmp_path) -> None:  # type: ignore[no-untyped-def]
    ring = trimesh.creation.torus(0.05, 0.015).apply_translation([0.02, 0.0, -0.1])
    ring.export(tmp_path / "ring.obj")
    drake = CalcSpatialInertia(DrakeMesh(str(tmp_path / "ring.obj")), 700.0)
    m = mass_properties(solid_of_surface(ring), density=700.0)
    assert m.mass == pytest.approx(drake.get_mass(), rel=1e-6)
    np.testing.assert_allclose(m.center_of_mass, drake.get_com(), atol=1e-7)
    about_com = drake.Shift(drake.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    np.testing.assert_allclose(inertia_matrix(m.inertia), about_com, rtol=1e-5, atol=1e-9)


def test_pieces_add_up_to_the_whole() -> None:
    whole = trimesh.creation.box((0.1, 0.06, 0.04))
    left = trimesh.creation.box((0.03, 0.06, 0.04)).apply_translation([-0.035, 0, 0])
    right = trimesh.creation.box((0.07, 0.06, 0.04)).apply_translation([0.015, 0, 0])
    a, b = solid_of_surface(whole), solid_of_pieces([left, right])
    assert b.volume == pytest.approx(a.volume, rel=1e-12)
    np.testing.assert_allclose(b.p_OOcm, a.p_OOcm, atol=1e-14)
    np.testing.assert_allclose(b.G_OOcm, a.G_OOcm, rtol=1e-10, atol=1e-16)


def test_density() -> None:
    box = solid_of_surface(trimesh.creation.box((0.1, 0.1, 0.1)))
    assert mass_properties(box, density=800.0).mass == pytest.approx(0.8)
    assert mass_properties(box, density=800.0).source == "density"
    assert mass_properties(box).mass == pytest.approx(DEFAULT_DENSITY * 1e-3)
    given = mass_properties(box, mass=0.3, density=800.0)
    assert (given.mass, given.source) == (0.3, "given")


@pytest.mark.parametrize("mass", [0.0, -1.0, float("nan"), float("inf")])
def test_masses_that_no_object_has(mass: float) -> None:
    box = solid_of_surface(trimesh.creation.box((0.1, 0.1, 0.1)))
    with pytest.raises(InvalidInputError, match=r"mass is .* kg; .* above 0"):
        mass_properties(box, mass=mass)


def test_inside_out_is_refused() -> None:
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    box.invert()
    with pytest.raises(InvalidInputError, match="normals must point outward"):
        solid_of_surface(box)


def _lump() -> trimesh.Trimesh:
    """A closed surface without any symmetry."""
    lump = trimesh.creation.icosphere(subdivisions=2, radius=0.04)
    rng = np.random.default_rng(4)
    lump.vertices *= rng.uniform(0.7, 1.3, (len(lump.vertices), 1))
    return lump.apply_transform(np.diag([1.0, 0.6, 1.7, 1.0]))


def test_turned_and_moved_meshes_have_turned_and_moved_mass_properties() -> None:
    X = trimesh.transformations.rotation_matrix(1.1, [3, -1, 2])
    X[:3, 3] = [0.4, -0.3, 0.2]
    a = mass_properties(solid_of_surface(_lump()), mass=0.4)
    b = mass_properties(solid_of_surface(_lump().apply_transform(X)), mass=0.4)
    assert b.volume == pytest.approx(a.volume, rel=1e-12)
    expected = X[:3, :3] @ np.array(a.center_of_mass) + X[:3, 3]
    np.testing.assert_allclose(b.center_of_mass, expected, atol=1e-13)
    turned = X[:3, :3] @ inertia_matrix(a.inertia) @ X[:3, :3].T
    np.testing.assert_allclose(inertia_matrix(b.inertia), turned, atol=1e-15)


def test_other_triangles_of_the_same_surface_have_the_same_mass_properties() -> None:
    lump = _lump()
    fine = lump.subdivide().subdivide()
    order = np.random.default_rng(0).permutation(len(fine.faces))
    shuffled = trimesh.Trimesh(fine.vertices, np.roll(fine.faces[order], 1, axis=1), process=False)
    a, b = (mass_properties(solid_of_surface(m), density=500.0) for m in (lump, shuffled))
    assert b.mass == pytest.approx(a.mass, rel=1e-12)
    np.testing.assert_allclose(b.center_of_mass, a.center_of_mass, atol=1e-14)
    np.testing.assert_allclose(b.inertia, a.inertia, rtol=1e-9, atol=1e-16)


def test_what_is_given_goes_before_what_is_computed() -> None:
    solid = solid_of_surface(trimesh.creation.box((0.1, 0.1, 0.1)))
    given = (2e-4, 3e-4, 4e-4, 1e-5, 0.0, -1e-5)
    m = mass_properties(
        solid, mass=0.3, center_of_mass=(0.0, 0.01, 0.02), inertia=given, wall_thickness=0.001
    )
    assert (m.center_of_mass, m.inertia) == ((0.0, 0.01, 0.02), given)
    assert m.overridden == ("center_of_mass", "inertia")
    assert m.wall_thickness == 0.001
    assert mass_properties(solid, mass=0.3).overridden == ()


def test_a_given_centre_of_mass_alone_leaves_the_inertia() -> None:
    solid = solid_of_surface(trimesh.creation.box((0.1, 0.1, 0.1)))
    m = mass_properties(solid, mass=0.3, center_of_mass=(0.0, 0.0, 0.03))
    np.testing.assert_allclose(m.inertia[:3], 0.3 * 0.1**2 / 6.0)
    assert m.overridden == ("center_of_mass",)


@pytest.mark.parametrize(
    ("inertia", "expected"),
    [
        (
            (1e-4, 1e-4, 3e-4, 0.0, 0.0, 0.0),
            (
                "no body has this inertia: its principal moments are 0.0001, 0.0001 and"
                " 0.0003 kg m^2; the largest must be at most the sum of the others"
            ),
        ),
        (
            (1e-4, 1e-4, 1e-4, 2e-4, 0.0, 0.0),
            (
                "inertia is not positive definite: its principal moments are -0.0001, 0.0001"
                " and 0.0003 kg m^2; all must be above 0"
            ),
        ),
        (
            (1e-4, 1e-4, float("nan"), 0.0, 0.0, 0.0),
            "inertia is [0.0001, 0.0001, nan, 0.0, 0.0, 0.0]; expected Ixx, Iyy, Izz, Ixy, Ixz,"
            " Iyz [kg m^2]",
        ),
        ((1e-4,), "inertia is [0.0001]; expected Ixx, Iyy, Izz, Ixy, Ixz, Iyz [kg m^2]"),
    ],
)
def test_inertias_that_no_body_has(inertia: tuple[float, ...], expected: str) -> None:
    solid = solid_of_surface(trimesh.creation.box((0.1, 0.1, 0.1)))
    with pytest.raises(InvalidInputError) as caught:
        mass_properties(solid, mass=0.3, inertia=inertia)  # type: ignore[arg-type]
    assert str(caught.value) == expected


def test_a_flat_plate_just_meets_the_triangle_inequality() -> None:
    solid = solid_of_surface(trimesh.creation.box((0.1, 0.1, 0.1)))
    mass_properties(solid, mass=0.3, inertia=(1e-4, 2e-4, 3e-4, 0.0, 0.0, 0.0))


def test_centres_of_mass_outside_the_bounding_box() -> None:
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    with pytest.raises(InvalidInputError) as caught:
        mass_properties(
            solid_of_surface(box), 0.3, center_of_mass=(0.0, 0.0, 10.0), bounds=box.bounds
        )
    assert str(caught.value) == (
        "center_of_mass [0.0, 0.0, 10.0] lies outside the bounding box [-0.05, -0.05, -0.05] to"
        " [0.05, 0.05, 0.05] (metres, object frame)"
    )
    with pytest.raises(InvalidInputError, match="expected three numbers"):
        mass_properties(solid_of_surface(box), 0.3, center_of_mass=(0.0, float("nan"), 0.0))


def _remarks(size: float, **given: object) -> tuple[str, ...]:
    box = trimesh.creation.box((size, size, size))
    m = mass_properties(solid_of_surface(box), **given)  # type: ignore[arg-type]
    return implausible_properties(m, *(tuple(b) for b in box.bounds.tolist()))


@pytest.mark.parametrize("density", [15.0, 300.0, 1000.0, 7850.0, 8960.0])
def test_foam_water_steel_and_copper_are_plausible(density: float) -> None:
    assert _remarks(0.05, density=density) == ()


def test_ycb_masses_are_plausible() -> None:
    """A cracker box, 0.411 kg and 60 x 158 x 210 mm, as published with the YCB set."""
    box = trimesh.creation.box((0.06, 0.158, 0.21))
    m = mass_properties(solid_of_surface(box), mass=0.411)
    assert implausible_properties(m, *(tuple(b) for b in box.bounds.tolist())) == ()


def test_what_is_implausible_is_said() -> None:
    assert _remarks(0.1, mass=30.0) == (
        (
            "density is 3e+04 kg/m^3 (30 kg in 1e+03 cm^3), denser than copper: usual are 10"
            " to 9000; check the mass and the unit of length"
        ),
        (
            "mass is 30 kg, more than a bounding box full of copper has; check the mass and"
            " the unit of length"
        ),
    )
    assert _remarks(0.1, mass=0.001) == (
        (
            "density is 1 kg/m^3 (0.001 kg in 1e+03 cm^3), lighter than foam: usual are 10 to"
            " 9000; check the mass and the unit of length"
        ),
        (
            "mass is 0.001 kg, less than that of the air in its bounding box; check the mass"
            " and the unit of length"
        ),
    )
    g_mm2 = 1e9 * 0.3 * 0.1**2 / 6.0
    for wrong in (g_mm2, 1e-9 * 0.3 * 0.1**2 / 6.0):
        (remark,) = _remarks(0.1, mass=0.3, inertia=(wrong, wrong, wrong, 0.0, 0.0, 0.0))
        assert remark.startswith("inertia is too large: its radius of gyration is ")
        assert "half the diagonal of the bounding box is 86.6 mm" in remark
    assert _remarks(0.1, mass=0.3, center_of_mass=(0.0, 0.0, 0.051)) == (
        "centre of mass [0.0, 0.0, 0.051] lies outside the bounding box [-0.05, -0.05, -0.05] to"
        " [0.05, 0.05, 0.05] (metres, object frame)",
    )
