"""Mass properties against closed forms and against Drake's own integrals."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from pydrake.geometry import Mesh as DrakeMesh
from pydrake.multibody.tree import CalcSpatialInertia

from burg_drake.core.errors import InvalidInputError
from burg_drake.objects.mass import (
    DEFAULT_DENSITY,
    mass_properties,
    solid_of_pieces,
    solid_of_surface,
)


def _tensor(inertia: tuple[float, ...]) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


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
    np.testing.assert_allclose(_tensor(m.inertia), R[:3, :3] @ principal @ R[:3, :3].T, atol=1e-15)


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
    np.testing.assert_allclose(_tensor(m.inertia), about_com, rtol=1e-5, atol=1e-9)


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
    with pytest.raises(InvalidInputError, match=r"mass is .* kg; a free object needs one above 0"):
        mass_properties(box, mass=mass)


def test_inside_out_is_refused() -> None:
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    box.invert()
    with pytest.raises(InvalidInputError, match="normals must point outward"):
        solid_of_surface(box)
