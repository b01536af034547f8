"""Scenes and stations as zips: the same bytes from anywhere, the same world wherever unpacked."""

from __future__ import annotations

import hashlib
import io
import os
import shutil
import zipfile
from pathlib import Path

import pytest

from burg_drake.core import InvalidInputError, data_root
from burg_drake.evaluation import (
    BUNDLES_FOLDER,
    bundle_folder,
    load_bundle,
    make_bundle,
    require_same_content,
    unpack,
)
from burg_drake.scene import load_scene
from burg_drake.station import load_station, world_content

SCENE = """version: 1
name: two
library: {library}
instances:
  - {{object: mug, X_SO: {{translation: [0.1, 0.1, 0.0]}}}}
background:
  - {{object: box, X_SO: {{translation: [0.3, 0.3, 0.0]}}}}
"""


def scene_in(folder: Path) -> Path:
    shutil.copytree(data_root() / "models/household", folder / "things")
    path = folder / "two.yaml"
    path.write_text(SCENE.format(library="things"))
    return path


@pytest.mark.parametrize("station", ["panda_tabletop", "ur5e_tabletop", "wsg_tabletop"])
def test_what_is_unpacked_is_what_was_packed(station: str, tmp_path: Path) -> None:
    scene = load_scene(scene_in(tmp_path / "here"))
    bundle = make_bundle(scene, load_station(station))
    folder = unpack(bundle.data, tmp_path / "there", bundle.name)
    shutil.rmtree(tmp_path / "here")
    there, station_there = load_bundle(folder)
    require_same_content(bundle, there, station_there)
    assert world_content(there, station_there) == bundle.content
    assert list(there.instances) == ["mug"]
    assert set(there.library.objects) == {"mug", "box"}
    robot = (station_there.hand_model, station_there.arm_model)
    assert all(model is None or model.is_relative_to(folder) for model in robot)
    assert str(tmp_path / "here") not in str(
        [path.read_bytes() for path in folder.rglob("*") if path.is_file()]
    )


def test_the_bytes_follow_from_the_content_alone(tmp_path: Path) -> None:
    station = load_station("panda_tabletop")
    names = []
    for place in ("a", "somewhere/else"):
        (tmp_path / place).mkdir(parents=True)
        path = scene_in(tmp_path / place)
        for file in path.parent.rglob("*"):
            os.utime(file, (1e9, 1e9 + len(place)))
        names.append(make_bundle(load_scene(path), station).name)
    assert names[0] == names[1]
    mesh = tmp_path / "a/things/mug/mug.sdf"
    mesh.write_text(mesh.read_text() + "\n")
    assert make_bundle(load_scene(tmp_path / "a/two.yaml"), station).name != names[0]


@pytest.mark.thorough
def test_packages_travel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An arm's model that names meshes of a package, which no worker has."""
    package = tmp_path / "ws/my_robot"
    (package / "urdf").mkdir(parents=True)
    (package / "meshes").mkdir()
    (package / "package.xml").write_text("<package><name>my_robot</name></package>")
    models = data_root() / "models/panda"
    text = (models / "panda_arm.sdf").read_text()
    (package / "urdf/arm.sdf").write_text(
        text.replace("<uri>meshes/", "<uri>package://my_robot/meshes/")
    )
    for mesh in (models / "meshes").iterdir():
        shutil.copy(mesh, package / "meshes")
    station = tmp_path / "station.yaml"
    builtin = (data_root() / "stations/panda_tabletop.yaml").read_text()
    model = "  model: package://my_robot/urdf/arm.sdf\n"
    station.write_text(builtin.replace("\narm:\n", f"\narm:\n{model}"))
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ws"))
    bundle = make_bundle(load_scene("tabletop_six"), load_station(station))
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    folder = unpack(bundle.data, tmp_path / "there", bundle.name)
    shutil.rmtree(tmp_path / "ws")
    scene, there = load_bundle(folder)
    require_same_content(bundle, scene, there)
    assert there.arm_model == folder / "my_robot/urdf/arm.sdf"
    assert (folder / "my_robot/meshes/link0.obj").is_file()


def test_a_world_that_changed_on_the_way_is_refused(tmp_path: Path) -> None:
    bundle = make_bundle(load_scene("tabletop_six"), load_station("panda_tabletop"))
    with pytest.raises(InvalidInputError, match="was damaged on the way"):
        unpack(bundle.data[:-1], tmp_path, bundle.name)
    folder = unpack(bundle.data, tmp_path, bundle.name)
    assert unpack(bundle.data, tmp_path, bundle.name) == folder
    assert bundle_folder(tmp_path, bundle.name) == folder
    assert [path.name for path in (tmp_path / BUNDLES_FOLDER).iterdir()] == [bundle.name]
    mesh = next(folder.glob("library.d/mug/pieces/*.obj"))
    mesh.write_bytes(mesh.read_bytes() + b"\n")
    with pytest.raises(InvalidInputError, match=r"files of the objects of 'tabletop_six' on"):
        require_same_content(bundle, *load_bundle(folder))
    model = next(folder.glob("arm.d/*.sdf"))
    model.write_bytes(model.read_bytes() + b"\n")
    with pytest.raises(InvalidInputError, match=r"the station of 'tabletop_six' on .* changed"):
        require_same_content(bundle, *load_bundle(folder))


def test_the_zip_is_plain() -> None:
    bundle = make_bundle(load_scene("tabletop_six"), load_station("panda_tabletop"))
    with zipfile.ZipFile(io.BytesIO(bundle.data)) as archive:
        infos = archive.infolist()
    assert [info.filename for info in infos] == sorted(info.filename for info in infos)
    assert {info.date_time for info in infos} == {(1980, 1, 1, 0, 0, 0)}
    assert {info.external_attr >> 16 for info in infos} == {0o644}


def test_what_is_in_the_place_of_a_bundle_is_mended_or_told_of(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("a/one.txt", "1")
        archive.writestr("two.txt", "2")
    data = buffer.getvalue()
    name = hashlib.sha256(data).hexdigest()
    folder = unpack(data, tmp_path, name)
    (folder / "a/one.txt").unlink()
    (folder / "two.txt").write_text("3")
    assert unpack(data, tmp_path, name) == folder
    assert [(folder / f).read_text() for f in ("a/one.txt", "two.txt")] == ["1", "2"]
    shutil.rmtree(folder)
    folder.write_text("a file")
    with pytest.raises(InvalidInputError, match="cannot unpack the scene into"):
        unpack(data, tmp_path, name)
