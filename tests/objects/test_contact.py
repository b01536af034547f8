"""The choice of the contact geometry."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import trimesh

from burg_drake.core import MeshError
from burg_drake.objects import (
    CONTACT_FILE,
    CONTACT_MESH_FACES,
    MAX_CONTACT_DISTANCE,
    ContactGeometry,
    ObjectLibrary,
    contact_fallback_message,
    contact_geometry,
    describe_pad_contact,
    load_library,
)


def cylinder() -> trimesh.Trimesh:
    return trimesh.creation.cylinder(0.03, 0.1, sections=64)


def torus() -> trimesh.Trimesh:
    return trimesh.creation.torus(0.05, 0.01, major_sections=96, minor_sections=48)


def test_by_itself_it_is_a_primitive_where_one_fits(tmp_path: Path) -> None:
    contact = contact_geometry(None, cylinder(), True, [cylinder()], tmp_path)
    assert contact.kind == "primitive" and list(tmp_path.iterdir()) == []
    assert contact.primitive is not None and contact.primitive.shape == "cylinder"
    assert contact.fit is not None and contact.fit.hausdorff < 1e-4
    contact = contact_geometry(None, torus(), True, [cylinder()], tmp_path)
    assert (contact.kind, contact.mesh) == ("surface", CONTACT_FILE)
    assert contact.fit is not None and contact.fit.hausdorff <= MAX_CONTACT_DISTANCE
    assert contact.reason == "" and (tmp_path / CONTACT_FILE).exists()


def test_pads_meet_the_pieces_where_there_is_no_surface(tmp_path: Path) -> None:
    holey = trimesh.Trimesh(torus().vertices, torus().faces[1:], process=False)
    contact = contact_geometry(None, holey, False, [torus()], tmp_path)
    assert contact == ContactGeometry(reason="its surface is not closed")
    assert list(tmp_path.iterdir()) == []
    assert contact_fallback_message(contact, 12) == (
        "finger pads touch 12 convex pieces, because its surface is not closed; make the"
        " mesh watertight and smooth it, or accept that by 'contact: pieces' in an"
        " objects.yaml"
    )
    assert contact_fallback_message(ContactGeometry(), 12) == ""


def test_what_pads_touch_is_told(tmp_path: Path) -> None:
    household = load_library("household")
    lines = household.path(household.entry("mug").contact.mesh).read_text().splitlines()
    faces = sum(line.startswith("f ") for line in lines)
    fit = household.entry("mug").contact.fit
    assert fit is not None
    expected = (
        f"a surface with {faces} faces, at most {1000.0 * fit.hausdorff:.2g} mm from the mesh"
    )
    assert describe_pad_contact(household, "mug") == expected
    assert describe_pad_contact(household, "can").startswith("a cylinder, at most 1.")
    entry = replace(household.entry("mug"), contact=ContactGeometry())
    document = replace(household.document, objects={"mug": entry})
    assert describe_pad_contact(ObjectLibrary(document, tmp_path), "mug") == (
        f"{len(entry.pieces)} convex pieces"
    )


def test_the_volume_of_an_open_surface_is_that_of_its_pieces(tmp_path: Path) -> None:
    lidless = trimesh.Trimesh(cylinder().vertices, cylinder().faces[3:], process=False)
    contact = contact_geometry(None, lidless, False, [cylinder()], tmp_path)
    assert contact.kind == "primitive"


@pytest.mark.parametrize("kind", ["pieces", "compliant_pieces"])
def test_pieces_are_taken_as_they_are(tmp_path: Path, kind: str) -> None:
    contact = contact_geometry(kind, cylinder(), True, [], tmp_path)  # type: ignore[arg-type]
    assert contact == ContactGeometry(kind=kind)  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_a_mesh_is_written_with_few_faces(tmp_path: Path) -> None:
    fine = torus()
    assert len(fine.faces) > 4 * CONTACT_MESH_FACES
    contact = contact_geometry("mesh", fine, True, [], tmp_path)
    assert contact.mesh == CONTACT_FILE
    mesh = trimesh.load_mesh(tmp_path / CONTACT_FILE)
    assert mesh.is_watertight and mesh.euler_number == 0  # it still has its hole
    assert len(mesh.faces) < len(fine.faces) / 2
    assert contact.fit is not None and contact.fit.hausdorff < 5e-4
    assert contact.fit.volume_ratio == pytest.approx(mesh.volume / fine.volume, rel=1e-6)


def test_what_cannot_be_is_said(tmp_path: Path) -> None:
    holey = trimesh.Trimesh(torus().vertices, torus().faces[1:], process=False)
    with pytest.raises(MeshError, match=r"^contact 'mesh' needs a closed surface"):
        contact_geometry("mesh", holey, False, [torus()], tmp_path)
    with pytest.raises(
        MeshError,
        match=r"^contact 'surface': its surface is not closed",
    ):
        contact_geometry("surface", holey, False, [torus()], tmp_path)
    with pytest.raises(MeshError, match="no box, cylinder or sphere"):
        contact_geometry("primitive", torus(), True, [], tmp_path)
    bottle = load_library("household").surface("bottle")
    with pytest.raises(MeshError, match=r"^contact 'primitive': .*; choose 'pieces'"):
        contact_geometry("primitive", bottle, True, [], tmp_path)
    egg = trimesh.creation.icosphere(subdivisions=4, radius=0.05).apply_scale((1, 1, 0.95))
    with pytest.raises(MeshError, match=r"the nearest, a sphere, is 2\.[56] mm off"):
        contact_geometry("primitive", egg, True, [], tmp_path)
