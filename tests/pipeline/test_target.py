"""Where a library may be built: nobody else's folder, and by one build at a time."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import trimesh

from burg_drake.core import InvalidInputError
from burg_drake.objects import load_library
from burg_drake.pipeline import ObjectSource, build_library, open_for_build


def _contents(root: Path) -> dict[str, bytes | None]:
    return {
        str(p.relative_to(root)): p.read_bytes() if p.is_file() else None for p in root.rglob("*")
    }


@pytest.fixture
def cube(tmp_path: Path) -> Path:
    """A mesh in a folder of the name that the object gets, beside other work."""
    folder = tmp_path / "work" / "cube"
    folder.mkdir(parents=True)
    trimesh.creation.box((0.05, 0.05, 0.05)).export(folder / "cube.obj")
    (folder / "notes.txt").write_text("years of work")
    return folder / "cube.obj"


def _source(name: str = "cube", **options: object) -> ObjectSource:
    box = trimesh.creation.box((0.05, 0.05, 0.05))
    return ObjectSource(**{"name": name, "mesh": box, "mass": 0.1, **options})  # type: ignore[arg-type]


def test_a_folder_of_the_users_is_not_replaced(cube: Path) -> None:
    work = cube.parent.parent
    before = _contents(work)
    for source in (cube, _source()):
        with pytest.raises(
            InvalidInputError, match="work/cube exists and is not an object of this"
        ):
            build_library([_source("aaa"), source], work)
        assert _contents(work) == before


def test_a_file_or_link_of_the_users_is_not_replaced(tmp_path: Path, cube: Path) -> None:
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "cube").symlink_to(tmp_path / "nowhere")
    (tmp_path / "lib" / "file").write_text("mine")
    before = _contents(tmp_path)
    for name in ("cube", "file"):
        with pytest.raises(InvalidInputError, match=f"lib/{name} exists and is not an object"):
            build_library([_source(name)], tmp_path / "lib")
    assert _contents(tmp_path) == before
    assert os.readlink(tmp_path / "lib" / "cube") == str(tmp_path / "nowhere")


def test_links_in_a_circle(tmp_path: Path, cube: Path) -> None:
    """Of the mesh it is one failure, of the folder nothing is begun."""
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(InvalidInputError, match=r"cannot write to folder .*loop"):
        build_library([_source()], tmp_path / "loop")
    (tmp_path / "loop.obj").symlink_to("loop.obj")
    report = build_library([tmp_path / "loop.obj"], tmp_path / "lib", confirm=False)
    assert report.failed["loop"].endswith(
        "loop.obj: this link points to a file that does not exist, or to itself"
    )


def test_a_refused_build_does_not_rename_the_library(tmp_path: Path) -> None:
    build_library([_source()], tmp_path / "lib", name="things")
    (tmp_path / "lib" / "mine").mkdir()
    with pytest.raises(InvalidInputError):
        build_library([_source("mine")], tmp_path / "lib", name="others")
    assert load_library(tmp_path / "lib").name == "things"


@pytest.mark.parametrize("linked", [False, True])
def test_a_source_in_the_folder_that_is_replaced(tmp_path: Path, linked: bool) -> None:
    library = tmp_path / "lib"
    build_library([_source()], library)
    scan = library / "cube" / "scans" / "cube.stl"
    scan.parent.mkdir()
    trimesh.creation.box((0.06, 0.05, 0.05)).export(scan)
    before = _contents(library)
    if linked:
        (tmp_path / "alias").symlink_to(library)
        scan = tmp_path / "alias" / "cube" / "scans" / "cube.stl"
    with pytest.raises(InvalidInputError, match=r"cube\.stl lies in .*lib/cube, which the build"):
        build_library([scan], library)
    assert _contents(library) == before


def test_objects_that_the_library_forgot_are_its_own(tmp_path: Path) -> None:
    build_library([_source()], tmp_path / "lib")
    (tmp_path / "lib" / "library.yaml").unlink()  # as after a kill just before it is written
    assert build_library([_source()], tmp_path / "lib").built == ("cube",)
    (tmp_path / "lib" / "cube" / "build.json").unlink()
    assert build_library([_source(mass=0.2)], tmp_path / "lib").built == ("cube",)


def test_nothing_is_left_of_a_new_library_without_objects(tmp_path: Path) -> None:
    report = build_library([tmp_path / "missing.obj"], tmp_path / "a" / "b")
    assert (list(report.failed), report.library.objects) == (["missing"], {})
    assert _contents(tmp_path) == {}


def test_a_folder_that_was_there_stays(tmp_path: Path) -> None:
    (tmp_path / "lib").mkdir()
    build_library([tmp_path / "missing.obj"], tmp_path / "lib")
    assert _contents(tmp_path) == {"lib": None}


def test_a_library_that_was_there_stays(tmp_path: Path) -> None:
    build_library([_source()], tmp_path / "lib")
    before = _contents(tmp_path)
    assert list(build_library([tmp_path / "missing.obj"], tmp_path / "lib").failed) == ["missing"]
    assert _contents(tmp_path) == before


def test_one_build_at_a_time(tmp_path: Path) -> None:
    build_library([_source()], tmp_path / "lib")
    with open_for_build(tmp_path / "lib"):
        before = _contents(tmp_path)
        with pytest.raises(InvalidInputError, match="lib is being written by another build; wait"):
            build_library([_source("other")], tmp_path / "lib")
        assert _contents(tmp_path) == before
    report = build_library([_source("other")], tmp_path / "lib")
    assert list(report.library.objects) == ["cube", "other"]
    assert not (tmp_path / "lib" / ".library.lock").exists()


@pytest.mark.thorough
def test_the_lock_of_a_killed_build_is_free(tmp_path: Path) -> None:
    script = (
        "import os, sys; from burg_drake.pipeline.library_build import open_for_build\n"
        "with open_for_build(sys.argv[1]): os._exit(9)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    command = [sys.executable, "-c", script, str(tmp_path / "lib")]
    assert subprocess.run(command, env=environment, check=False).returncode == 9
    assert (tmp_path / "lib" / ".library.lock").exists()
    assert build_library([_source()], tmp_path / "lib").built == ("cube",)
    assert not (tmp_path / "lib" / ".library.lock").exists()
