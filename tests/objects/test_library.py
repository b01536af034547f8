"""The library document."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import DocumentError, InvalidInputError, MeshError, Pose, UnknownNameError
from burg_drake.objects import (
    LibraryDocument,
    MassProperties,
    ObjectEntry,
    ObjectLibrary,
    Source,
    StablePose,
    load_library,
)


@pytest.fixture
def entry() -> ObjectEntry:
    return ObjectEntry(
        description="a box: with a colon",
        mesh="box/mesh.obj",
        sdf="box/box.sdf",
        pieces=("box/pieces/000.obj",),
        friction=0.3,
        lower=(-0.05, -0.03, 0.0),
        upper=(0.05, 0.03, 0.1 / 3.0),
        mass_properties=MassProperties(
            mass=0.1 + 0.2,
            source="given",
            volume=2e-4,
            center_of_mass=(1e-17, 0.0, 0.1 / 6.0),
            inertia=(1e-4, 2e-4, 3e-4, 1e-7, 0.0, -1e-7),
        ),
        stable_poses=(
            StablePose(probability=0.75, X_SO=Pose(quaternion_wxyz=(0.5, 0.5, 0.5, 0.5))),
            StablePose(probability=0.25, X_SO=Pose((0.0, 0.0, 0.1))),
        ),
        source=Source(file="box.stl", sha256="ab", scale=0.001, repairs=("scaled by 0.001",)),
        build="cd",
    )


@pytest.fixture
def library(tmp_path: Path, entry: ObjectEntry) -> ObjectLibrary:
    library = ObjectLibrary(LibraryDocument(name="things", objects={"box": entry}), tmp_path / "a")
    library.save()
    return library


def test_documents_come_back_without_loss(library: ObjectLibrary) -> None:
    for reference in (library.root, library.root / "library.yaml"):
        assert load_library(reference).document == library.document


def test_a_library_may_be_moved(library: ObjectLibrary, tmp_path: Path) -> None:
    (library.root / "box").mkdir()
    (library.root / "box" / "box.sdf").write_text("<sdf/>")
    shutil.move(library.root, tmp_path / "b")
    moved = load_library(tmp_path / "b")
    assert moved.path(moved.entry("box").sdf) == (tmp_path / "b/box/box.sdf").resolve()


def test_poses(entry: ObjectEntry) -> None:
    np.testing.assert_allclose(entry.X_SO(0)[:3, :3], [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12)
    assert entry.X_SO(1)[2, 3] == 0.1
    with pytest.raises(InvalidInputError, match="stable pose 2 does not exist; give 0 to 1"):
        entry.X_SO(2)


def test_unknown_objects(library: ObjectLibrary) -> None:
    with pytest.raises(UnknownNameError, match=r"'bax' is not in library .*did you mean 'box'"):
        library.entry("bax")


def test_missing_files(library: ObjectLibrary) -> None:
    with pytest.raises(UnknownNameError, match=r"box.sdf is missing; build library 'things'"):
        library.path("box/box.sdf")


def test_missing_libraries(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="does not exist"):
        load_library(tmp_path / "none")
    with pytest.raises(DocumentError, match=r"library.yaml is missing"):
        load_library(tmp_path)


def test_mass_below_zero_names_the_key(library: ObjectLibrary) -> None:
    file = library.root / "library.yaml"
    file.write_text(file.read_text().replace("mass: 0.30000000000000004", "mass: 0"))
    with pytest.raises(DocumentError, match=r"library\.yaml:\d+: objects\.box\.mass_properties"):
        load_library(library.root)


def test_surfaces_have_no_seams_and_are_in_the_object_frame() -> None:
    library = load_library("household")
    for name, entry in library.objects.items():
        surface = library.surface(name)
        np.testing.assert_allclose(surface.bounds, [entry.lower, entry.upper], atol=1e-6)
        assert len(np.unique(surface.vertices, axis=0)) == len(surface.vertices)
        assert surface.is_watertight
        assert surface.volume == pytest.approx(entry.mass_properties.volume, rel=1e-4)
    with pytest.raises(UnknownNameError, match=r"'bax' is not in library .*did you mean 'box'"):
        library.surface("bax")


@pytest.mark.parametrize(
    "content",
    [
        b"\x8b\x00 garbage",
        b"v 0 0 0\n",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
        b"v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n",
    ],
)
def test_damaged_meshes(library: ObjectLibrary, content: bytes) -> None:
    (library.root / "box").mkdir()
    (library.root / "box" / "mesh.obj").write_bytes(content)
    with pytest.raises(MeshError, match=r"box/mesh.obj is damaged"):
        library.surface("box")


def test_a_folder_in_place_of_a_mesh(library: ObjectLibrary) -> None:
    (library.root / "box" / "mesh.obj").mkdir(parents=True)
    with pytest.raises(UnknownNameError, match=r"box/mesh.obj is not a file; build library"):
        library.surface("box")
