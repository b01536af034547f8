"""The gallery in Meshcat: a path for each thing, no more, and a page that needs nothing else."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import Meshcat

from burg_drake.core import InvalidInputError, UnknownNameError, transform_points
from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.visualization import open_meshcat, save_html, show_library

ROOT = "/drake/library"
NAMES = ["mug", "can", "marble"]


@pytest.fixture(scope="module")
def library() -> ObjectLibrary:
    return load_library("household")


@pytest.fixture(scope="module")
def meshcat(library: ObjectLibrary) -> Meshcat:
    meshcat = open_meshcat()
    show_library(library, meshcat, NAMES)
    return meshcat


@pytest.mark.parametrize("name", NAMES)
def test_all_pieces_and_poses_are_there(
    library: ObjectLibrary, meshcat: Meshcat, name: str
) -> None:
    entry = library.entry(name)
    for path in (f"labels/{name}", f"visual/{name}/object", f"contact/{name}/object/surface"):
        assert meshcat.HasPath(f"{ROOT}/{path}"), path
    for count, form in (
        (len(entry.pieces), f"{ROOT}/pieces/{name}/object/{{:03d}}"),
        (len(entry.stable_poses), f"{ROOT}/poses/{name}/{{}}/object"),
        (len(entry.stable_poses), f"{ROOT}/poses/{name}/{{}}/ground"),
        (len(entry.stable_poses), f"{ROOT}/poses/{name}/{{}}/caption"),
    ):
        assert all(meshcat.HasPath(form.format(k)) for k in range(count))
        assert not meshcat.HasPath(form.format(count))


def test_only_what_was_asked_for(meshcat: Meshcat) -> None:
    assert not meshcat.HasPath(f"{ROOT}/visual/bowl")


def test_showing_again_replaces(library: ObjectLibrary) -> None:
    meshcat = open_meshcat()
    show_library(library, meshcat, ["mug"])
    show_library(library, meshcat, ["box"])
    assert meshcat.HasPath(f"{ROOT}/visual/box") and not meshcat.HasPath(f"{ROOT}/visual/mug")


def test_poses_rest_on_their_ground(
    library: ObjectLibrary, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The transforms that Meshcat is told put the lowest point of the mesh on the tile."""
    told = {}
    meshcat = open_meshcat()
    real = meshcat.SetTransform

    class Spy:
        def __getattr__(self, name: str) -> object:
            return getattr(meshcat, name)

        def SetTransform(self, path: str, X: object) -> None:
            told[path] = X.GetAsMatrix4()  # type: ignore[attr-defined]
            real(path, X)

    show_library(library, Spy(), ["mug"])  # type: ignore[arg-type]
    points = library.surface("mug").vertices
    heights = []
    for k, pose in enumerate(library.entry("mug").stable_poses):
        X_WO = told[f"{ROOT}/poses/mug/{k}/object"]
        placed = transform_points(X_WO, points)
        heights.append(placed[:, 2].min())
        # turned about the vertical only: the same points are as high as in the entry's pose
        known = transform_points(pose.X_SO.matrix(), points)[:, 2]
        assert np.ptp(placed[:, 2] - known) == pytest.approx(0.0, abs=1e-9)
    assert heights == pytest.approx([0.002] * len(heights), abs=1e-4)


def test_the_page_needs_nothing_else(
    library: ObjectLibrary, meshcat: Meshcat, tmp_path: Path
) -> None:
    legend = show_library(library, meshcat, NAMES)
    for entry in legend:
        assert all(meshcat.HasPath(path) for path in entry.paths), entry
    path = tmp_path / "gallery.html"
    save_html(meshcat, path, title="household", legend=legend)
    page = path.read_text()
    assert 'src="http' not in page and "url(http" not in page and "@import" not in page


def test_a_mesh_is_stored_once_however_many_poses_show_it(library: ObjectLibrary) -> None:
    entry = library.entry("mug")
    sizes = []
    for poses in (entry.stable_poses[:1], entry.stable_poses[:1] * 4):
        changed = dataclasses.replace(entry, stable_poses=poses)
        document = dataclasses.replace(library.document, objects={"mug": changed})
        meshcat = open_meshcat()
        show_library(ObjectLibrary(document, library.root), meshcat)
        sizes.append(len(meshcat.StaticHtml()))
    assert sizes[1] - sizes[0] < 0.25 * library.path(entry.mesh).stat().st_size


def test_without_poses_and_unknown_names(library: ObjectLibrary) -> None:
    entry = dataclasses.replace(library.entry("box"), stable_poses=())
    document = dataclasses.replace(library.document, objects={"box": entry})
    meshcat = open_meshcat()
    show_library(ObjectLibrary(document, library.root), meshcat)
    assert meshcat.HasPath(f"{ROOT}/visual/box") and not meshcat.HasPath(f"{ROOT}/poses/box")
    with pytest.raises(UnknownNameError, match="'cup' is not in library"):
        show_library(library, meshcat, ["cup"])
    with pytest.raises(InvalidInputError, match="has no objects to show"):
        show_library(library, meshcat, [])
