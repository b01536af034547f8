"""Models as Drake's parser reads them from files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import Mesh, Role
from pydrake.planning import RobotDiagramBuilder

from burg_drake.core import InvalidInputError, data_root
from burg_drake.station import add_models

OBJECTS = ("box", "mug", "scissors")


def geometry(path: Path, *, by_drake: bool) -> list[tuple[str, str, list[float]]]:
    """Names, shapes or mesh files, and poses."""
    builder = RobotDiagramBuilder(time_step=1e-3)
    if by_drake:
        builder.parser().AddModels(str(path))
    else:
        add_models(builder.parser(), path)
    inspector = builder.scene_graph().model_inspector()
    found = []
    for g in inspector.GetAllGeometryIds():
        shape = inspector.GetShape(g)
        text = str(shape.source().path()) if isinstance(shape, Mesh) else repr(shape)
        proximity = inspector.GetProperties(g, Role.kProximity)
        pose = inspector.GetPoseInFrame(g).GetAsMatrix4().ravel().tolist()
        found.append((inspector.GetName(g), f"{text} {proximity}", pose))
    return found


@pytest.mark.parametrize("name", OBJECTS)
def test_as_drake_reads_the_file(name: str) -> None:
    path = data_root() / "models/household" / name / f"{name}.sdf"
    ours, drakes = geometry(path, by_drake=False), geometry(path, by_drake=True)
    assert len(ours) > 1
    for a, b in zip(ours, drakes, strict=True):
        assert a[0] == b[0]
        np.testing.assert_array_equal(a[2], b[2])


@pytest.mark.parametrize("folder", ["with space", "this & that"])
@pytest.mark.parametrize("absolute", [False, True])
def test_where_files_are(folder: str, absolute: bool, tmp_path: Path) -> None:
    source = data_root() / "models/household/box"
    place = tmp_path / folder
    place.mkdir()
    text = (source / "box.sdf").read_text(encoding="utf-8")
    if absolute:
        text = text.replace("mesh.obj", str(source / "mesh.obj"))
    else:
        (place / "mesh.obj").write_bytes((source / "mesh.obj").read_bytes())
    (place / "box.sdf").write_text(text, encoding="utf-8")
    assert len(geometry(place / "box.sdf", by_drake=False)) == 2


def test_errors_name_the_file(tmp_path: Path) -> None:
    parser = RobotDiagramBuilder(time_step=1e-3).parser()
    source = data_root() / "models/household/box/box.sdf"
    lacking = tmp_path / "lacking.sdf"  # its mesh is not there
    lacking.write_text(source.read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(RuntimeError, match=str(lacking)):
        add_models(parser, lacking)
    with pytest.raises(InvalidInputError, match=r"none\.sdf: No such file"):
        add_models(parser, tmp_path / "none.sdf")


@pytest.mark.parametrize(
    ("name", "body", "found", "target"),
    [
        ("arm.urdf.xacro", '<xacro:arm arm_id="fr3"/>', "xacro:arm", "arm.urdf"),
        ("arm.urdf", '<link name="$(arg prefix)base"/>', "$(arg prefix)", "arm_expanded.urdf"),
        ("arm.urdf", "<link name='${prefix}base'/>", "${prefix}", "arm_expanded.urdf"),
    ],
)
def test_xacro_has_to_be_expanded(
    tmp_path: Path, name: str, body: str, found: str, target: str
) -> None:
    path = tmp_path / name
    path.write_text(f'<robot name="arm">\n<!-- made with $(arg x) -->\n{body}</robot>')
    with pytest.raises(InvalidInputError) as refused:
        add_models(RobotDiagramBuilder(time_step=1e-3).parser(), path)
    assert str(refused.value) == (
        f"{path}:3: '{found}' is xacro, not URDF; expand the file first, and name the new one:"
        f" xacro {name} > {target}"
    )


def test_expanded_files_may_tell_where_they_are_from(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(
        '<robot name="arm" xmlns:xacro="http://ros.org/wiki/xacro"><!-- ${prefix} <xacro:x/> -->'
        '<link name="base"/><gazebo><plugin name="p">$(find arm)/x.yaml</plugin></gazebo></robot>'
    )
    assert add_models(RobotDiagramBuilder(time_step=1e-3).parser(), path)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("m.urdf", '<robot name="m"><link name="base"><collision name="hull"><geometry>'
         '<mesh filename="meshes/link0.dae"/></geometry></collision></link></robot>'),
        ("m.sdf", '<sdf version="1.9"><model name="m"><link name="base"><collision name="hull">'
         "<geometry><mesh><uri>meshes/link0.dae</uri></mesh></geometry></collision></link>"
         "</model></sdf>"),
    ],
)  # fmt: skip
def test_collision_meshes_that_drake_does_not_read(tmp_path: Path, name: str, text: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InvalidInputError) as refused:
        add_models(RobotDiagramBuilder(time_step=1e-3).parser(), path)
    assert str(refused.value) == (
        f"{path}:1: link 'base', collision 'hull': 'meshes/link0.dae' cannot be used for"
        " collisions; convert the .dae mesh to .obj or .gltf, for example with Blender, and name"
        " the new file"
    )
