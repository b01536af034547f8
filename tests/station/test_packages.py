"""Robots and objects whose files are in packages of their own."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from pydrake.geometry import Mesh
from pydrake.multibody.parsing import PackageMap

from burg_drake.core import InvalidInputError, UnknownNameError, resolve_reference
from burg_drake.objects import load_library
from burg_drake.scene import load_scene
from burg_drake.station import StationDiagram, build_station_diagram, load_station

STATION = """\
version: 1
name: mine
hand: hands/hand.yaml
arm: {model: MODEL, X_WA: {translation: [0.0, 0.0, 0.0]},
      home: [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]}
X_WS: {translation: [0.24, 0.297, 0.0], rpy_deg: [0.0, 0.0, -90.0]}
table: {center: [0.3, 0.0], size: [1.2, 1.4, 0.1]}
"""
MANIFEST = "<package format='3'><name>{}</name></package>\n"


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """An arm in ws/src/arm_1, its meshes in ws/src/arm_meshes; a hand in hands, its meshes in
    pads; each group of meshes a package."""
    models = resolve_reference("package://burg_drake/models/panda/panda_arm.sdf").parent.parent
    arm, meshes = tmp_path / "ws/src/arm_1", tmp_path / "ws/src/arm_meshes"
    hands, pads = tmp_path / "hands", tmp_path / "share/pads"
    shutil.copytree(models / "panda/meshes", meshes / "panda")
    shutil.copytree(models / "wsg/meshes", pads / "wsg")
    for folder, name in ((arm, "arm"), (meshes, "arm_meshes"), (pads, "pads")):
        folder.mkdir(exist_ok=True)
        (folder / "package.xml").write_text(MANIFEST.format(name))
    hands.mkdir()
    text = (models / "panda/panda_arm.sdf").read_text()
    (arm / "arm.sdf").write_text(text.replace("<uri>meshes/", "<uri>package://arm_meshes/panda/"))
    text = (models / "wsg/wsg_50.sdf").read_text()
    (hands / "hand.sdf").write_text(text.replace("<uri>meshes/", "<uri>model://pads/wsg/"))
    text = (models / "hands/wsg_50.yaml").read_text()
    (hands / "hand.yaml").write_text(
        text.replace("package://burg_drake/models/wsg/wsg_50.sdf", "hand.sdf")
    )
    return tmp_path


def station_file(place: Path, more: str = "", model: str = "ws/src/arm_1/arm.sdf") -> Path:
    (place / "station.yaml").write_text(STATION.replace("MODEL", model) + more)
    return place / "station.yaml"


def meshes(built: StationDiagram) -> set[Path]:
    """Files of all meshes of the robot."""
    inspector, plant = built.scene_graph.model_inspector(), built.plant
    shapes = [
        inspector.GetShape(geometry)
        for index in built.robot_bodies
        for of_body in (plant.GetVisualGeometriesForBody, plant.GetCollisionGeometriesForBody)
        for geometry in of_body(plant.get_body(index))
    ]
    return {Path(shape.source().path()).resolve() for shape in shapes if isinstance(shape, Mesh)}


def test_arm_and_hand_of_packages(place: Path) -> None:
    station = load_station(station_file(place, "packages: {pads: share/pads}\n"))
    built = build_station_diagram(load_scene("tabletop_six"), station)
    known = PackageMap.MakeEmpty()
    known.PopulateFromFolder(str(place))
    found = meshes(built)
    assert Path(known.ResolveUrl("package://pads/wsg/pad.vtk")).resolve() in found
    assert {path.parent for path in found} == {
        Path(known.GetPath("arm_meshes")).resolve() / "panda",
        Path(known.GetPath("pads")).resolve() / "wsg",
    }


def test_content_counts_files_of_packages_wherever_they_are(place: Path) -> None:
    path = station_file(place, "packages: {pads: share/pads}\n")
    before = load_station(path).content
    (place / "share").rename(place / "moved")
    path = station_file(place, "packages: {pads: moved/pads}\n")
    assert load_station(path).content == before
    for file in ("moved/pads/wsg/pad.vtk", "ws/src/arm_meshes/panda/link3.obj"):
        with (place / file).open("a") as stream:
            stream.write("\n# changed\n")
        changed = load_station(path).content
        assert changed != before
        before = changed


def test_a_model_that_includes_another_counts_both(place: Path) -> None:
    """By name of the package, as in Gazebo, in a package that ROS finds."""
    whole = (
        '<sdf version="1.9"><model name="whole"><include merge="true">'
        "<uri>package://arm/arm.sdf</uri></include></model></sdf>"
    )
    (place / "ws/src/arm_1/whole.sdf").write_text(whole)
    station = station_file(place, "packages: {pads: share/pads}\n", "ws/src/arm_1/whole.sdf")
    before = load_station(station).content
    with (place / "ws/src/arm_meshes/panda/link3.obj").open("a") as stream:
        stream.write("\n# changed\n")
    assert load_station(station).content != before
    built = build_station_diagram(load_scene("tabletop_six"), load_station(station))
    assert len(built.arm_joints) == 7
    assert any(path.is_relative_to(place / "ws/src/arm_meshes") for path in meshes(built))


def test_the_reference_to_the_model_itself(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(place / "ws"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(place))
    station = load_station(station_file(place, model="package://arm/arm.sdf"))
    assert station.arm_model == (place / "ws/src/arm_1/arm.sdf").resolve()
    assert station.packages.find("pads") == place / "share/pads"


def test_what_is_nowhere_is_said_with_what_was_searched(place: Path) -> None:
    with pytest.raises(UnknownNameError) as caught:
        load_station(station_file(place))
    assert str(caught.value).startswith(
        f"{place}/station.yaml: hand: {place}/hands/hand.yaml: model: {place}/hands/hand.sdf"
        f" refers to model://pads/wsg/body.obj: package 'pads' is not found in {place}/hands"
        " and the folders above it, ROS_PACKAGE_PATH ("
    )
    assert str(caught.value).endswith(
        f"name its folder by packages: {{pads: FOLDER}} in {place}/station.yaml"
    )
    with pytest.raises(UnknownNameError, match=r"yaml: packages\.pads: nowhere does not exist"):
        load_station(station_file(place, "packages: {pads: nowhere}\n"))
    with pytest.raises(InvalidInputError, match=r"packages\.pads: hands/hand\.yaml is not a"):
        load_station(station_file(place, "packages: {pads: hands/hand.yaml}\n"))


def test_an_object_of_a_library(tmp_path: Path) -> None:
    """Its mesh is in a package beside the library."""
    household = load_library("household").root
    shutil.copytree(household, tmp_path / "things")
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/package.xml").write_text(MANIFEST.format("meshes"))
    (tmp_path / "things/box/mesh.obj").rename(tmp_path / "meshes/box.obj")
    sdf = tmp_path / "things/box/box.sdf"
    sdf.write_text(sdf.read_text().replace("<uri>mesh.obj", "<uri>package://meshes/box.obj"))
    scene_file = tmp_path / "scene.yaml"
    scene_file.write_text(
        "version: 1\nname: one\nlibrary: things\ninstances:\n"
        "  - {object: box, X_SO: {translation: [0.2, 0.2, 0.0]}}\n"
    )
    scene, station = load_scene(scene_file), load_station("panda_tabletop")
    before = scene.content
    built = build_station_diagram(scene, station, robot="none")
    body = built.plant.get_body(built.free["box"])
    (visual,) = built.plant.GetVisualGeometriesForBody(body)
    shape = built.scene_graph.model_inspector().GetShape(visual)
    assert Path(shape.source().path()).samefile(tmp_path / "meshes/box.obj")
    with (tmp_path / "meshes/box.obj").open("a") as stream:
        stream.write("\n# changed\n")
    assert load_scene(scene_file).content != before
    (tmp_path / "meshes/package.xml").unlink()
    with pytest.raises(UnknownNameError, match="package 'meshes' is not found in"):
        build_station_diagram(scene, station, robot="none")
