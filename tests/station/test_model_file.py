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
