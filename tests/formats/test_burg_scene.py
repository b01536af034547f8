"""Scenes as BURG-Toolkit writes them, and what can be wrong with them."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from burg_drake.core import DocumentError, InvalidInputError
from burg_drake.formats import read_burg_scene

# What `yaml.dump` makes of a Scene: sorted keys, block lists, null for what is not known.
WRITTEN = """\
bg_objects:
- object_type: wall_segment_80
  pose:
  - - 1.0
    - 0.0
    - 0.0
    - 0.04
  - - 0.0
    - 1.0
    - 0.0
    - 0.5
  - - 0.0
    - 0.0
    - 1.0
    - 0.0
  - - 0.0
    - 0.0
    - 0.0
    - 1.0
ground_area_x: 2
ground_area_y: 1.5
object_library_fn: ..\\object_library\\object_library.yaml
objects:
- object_type: 004_sugar_box
  pose:
  - - 0.0
    - -1.0
    - 0.0
    - 1.0
  - - 1.0
    - 0.0
    - 0.0
    - 0.75
  - - 0.0
    - 0.0
    - 1.0
    - 0.030935906279074443
  - - 0.0
    - 0.0
    - 0.0
    - 1.0
printout: null
yaml_file_type: Scene
yaml_file_version: '1.0'
"""


def changed(folder: Path, **values: Any) -> Path:
    """The document with some of its values replaced; None takes a key out."""
    data = yaml.safe_load(WRITTEN) | values
    path = folder / "scene.yaml"
    path.write_text(yaml.dump({k: v for k, v in data.items() if v is not None}))
    return path


def test_a_file_as_burg_toolkit_writes_it(tmp_path: Path) -> None:
    library = tmp_path / "object_library" / "object_library.yaml"
    library.parent.mkdir()
    library.write_text("")
    path = tmp_path / "scenes" / "scene.yaml"
    path.parent.mkdir()
    path.write_text(WRITTEN)
    scene = read_burg_scene(path)
    assert (scene.path, scene.ground_area, scene.notes) == (path, (2.0, 1.5), ())
    assert scene.library is not None and scene.library.samefile(library)
    (box,), (wall,) = scene.objects, scene.bg_objects
    assert (box.object_type, wall.object_type) == ("004_sugar_box", "wall_segment_80")
    turned = [[0, -1, 0, 1], [1, 0, 0, 0.75], [0, 0, 1, 0.030935906279074443], [0, 0, 0, 1]]
    np.testing.assert_allclose(box.X_SO.matrix(), turned, atol=1e-15)
    np.testing.assert_allclose(wall.X_SO.matrix()[:3, 3], [0.04, 0.5, 0.0], atol=1e-15)
    lines = WRITTEN.splitlines()
    assert lines[box.line - 1] == "- object_type: 004_sugar_box"
    assert lines[wall.line - 1] == "- object_type: wall_segment_80"


def test_poses_in_single_precision(tmp_path: Path) -> None:
    s = float(np.float32(2**-0.5))
    pose = [[s, -s, 0, 0.1], [s, s, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]
    scene = read_burg_scene(changed(tmp_path, objects=[{"object_type": "a", "pose": pose}]))
    assert scene.notes == ()
    X_SO = scene.objects[0].X_SO.matrix()
    np.testing.assert_allclose(X_SO, pose, atol=1e-7)
    np.testing.assert_allclose(X_SO[:3, :3] @ X_SO[:3, :3].T, np.eye(3), atol=1e-15)


def test_what_it_may_lack_and_have(tmp_path: Path) -> None:
    scene = read_burg_scene(changed(tmp_path, object_library_fn=None, bg_objects=None, objects=[]))
    assert (scene.library, scene.objects, scene.bg_objects) == (None, (), ())
    (unknown,) = read_burg_scene(changed(tmp_path, lights=3)).notes
    assert "key 'lights' was ignored" in unknown


MARKERS = {
    "aruco_dict": "DICT_4X4_250",
    "marker_count_x": 7,
    "marker_count_y": 5,
    "marker_size_mm": 57,
    "marker_spacing_mm": 19,
}


def test_its_printed_board(tmp_path: Path) -> None:
    printout = {"size": [2, 1.5], "marker_info": MARKERS}
    scene = read_burg_scene(changed(tmp_path, printout=printout))
    board = scene.printout
    assert board is not None and scene.notes == ()
    assert (board.size, dataclasses.asdict(board.marker_info)) == ((2.0, 1.5), MARKERS)
    path = changed(tmp_path, printout=printout | {"size": [2.1, 1.6]})
    (note,) = read_burg_scene(path).notes
    line = path.read_text().splitlines().index("printout:") + 1
    assert note == (
        f"{path}:{line}: the board gets the size of the printout, 2100 x 1600 mm; the ground"
        " area of 2000 x 1500 mm was ignored"
    )


def instance(**values: Any) -> list[dict[str, Any]]:
    return [{"object_type": "a", "pose": np.eye(4).tolist()} | values]


MIRROR = np.diag([1.0, 1.0, -1.0, 1.0]).tolist()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"yaml_file_type": "ObjectLibrary"}, "'ObjectLibrary' cannot be read; expected 'Scene'; "),
        ({"yaml_file_type": None}, "yaml_file_type: missing; if this is a scene of an early"),
        ({"yaml_file_version": "2.0"}, "'2.0' cannot be read; expected '1.0'"),
        ({"ground_area_x": 0}, "the ground area is 0 x 1.5 m; both sides must be above 0"),
        ({"ground_area_y": None}, "key 'ground_area_y' is missing"),
        ({"objects": None}, "key 'objects' is missing"),
        ({"objects": "box"}, "objects: expected a list"),
        ({"objects": instance(pose=[[1, 0, 0, 0]])}, r"objects\[0\].pose: has 1 entries; expected"),
        ({"objects": [{"object_type": "a"}]}, r"objects\[0\]: key 'pose' is missing"),
        (
            {"printout": {"size": [0, 1], "marker_info": MARKERS}},
            r"size \[0.0, 1.0\] must be above 0",
        ),
        ({"printout": {"size": [1, 1]}}, "printout: key 'marker_info' is missing"),
        (
            {"printout": {"size": [1, 1], "marker_info": MARKERS | {"marker_size_mm": -57}}},
            r":\d+: printout.marker_info: marker_size_mm is -57; it must be above 0",
        ),
        (
            {"objects": instance(pose=MIRROR)},
            r"scene.yaml:\d+: pose of 'a'\[0\] is a reflection",
        ),
    ],
)
def test_malformed(values: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=message):
        read_burg_scene(changed(tmp_path, **values))


def test_no_yaml(tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text("{")
    with pytest.raises(DocumentError, match="not valid YAML"):
        read_burg_scene(tmp_path / "scene.yaml")
    with pytest.raises(DocumentError, match="cannot read"):
        read_burg_scene(tmp_path / "missing.yaml")
