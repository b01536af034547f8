"""`burg-drake scene import-burg`: a scene of BURG-Toolkit made of household objects."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from burg_drake.apps import main
from burg_drake.core import builtin_names
from burg_drake.motion import require_usable_arm
from burg_drake.pipeline import check_library
from burg_drake.scene import load_scene
from burg_drake.station import check_scene, load_station
from tests.apps.burg_kitchen import write_kitchen

Capture = pytest.CaptureFixture[str]

TURNED = [[0, -1, 0, 0.12], [1, 0, 0, 0.11], [0, 0, 1, 0], [0, 0, 0, 1]]
UPRIGHT = [[1, 0, 0, 0.29], [0, 1, 0, 0.11], [0, 0, 1, 0], [0, 0, 0, 1]]


@pytest.fixture
def burg_scene(tmp_path: Path) -> Path:
    """As `Scene.to_yaml` writes it."""
    data = {
        "object_library_fn": "../object_library.yaml",
        "ground_area_x": 0.594,
        "ground_area_y": 0.42,
        "objects": [
            {"object_type": "Mug", "pose": np.array(TURNED, float).tolist()},
            {"object_type": "bottle", "pose": np.array(UPRIGHT, float).tolist()},
        ],
        "bg_objects": [],
        "printout": {
            "size": [0.594, 0.42],
            "marker_info": {
                "aruco_dict": "DICT_4X4_250",
                "marker_count_x": 7,
                "marker_count_y": 5,
                "marker_size_mm": 57,
                "marker_spacing_mm": 19,
            },
        },
        "yaml_file_version": "1.0",
        "yaml_file_type": "Scene",
    }
    path = tmp_path / "burg.yaml"
    path.write_text(yaml.dump(data))
    return path


def test_it_becomes_a_sound_scene(burg_scene: Path, tmp_path: Path, capsys: Capture) -> None:
    output = tmp_path / "kitchen.yaml"
    options = ["--library", "household", "-o", str(output)]
    assert main(["scene", "import-burg", str(burg_scene), *options]) == 0
    wrote, fits = capsys.readouterr().out.splitlines()
    assert wrote == f"wrote {output}: 2 objects"
    assert fits == "station panda_tabletop fits: --station panda_tabletop"
    scene = load_scene(output)
    assert (scene.name, scene.document.library) == ("kitchen", "household")
    markers = scene.board.markers
    assert scene.board.size == (0.594, 0.42)
    assert (markers.dictionary, markers.count, markers.first_id) == ("4X4_250", (7, 5), 0)
    assert (markers.side, markers.spacing) == (0.057, 0.019)
    np.testing.assert_allclose(scene.X_SO("mug"), TURNED, atol=1e-15)
    np.testing.assert_allclose(scene.X_SO("bottle"), UPRIGHT, atol=1e-15)
    assert main(["scene", "validate", str(output)]) == 0


def test_a_library_is_found_from_the_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine").mkdir()
    Path("mine/library.yaml").write_text("version: 1\nname: mine\n")
    Path("burg.yaml").write_text(
        "ground_area_x: 2\nground_area_y: 1\nobjects: []\n"
        "yaml_file_type: Scene\nyaml_file_version: '1.0'\n"
    )
    options = ["--library", "mine", "-o", "out/scene.yaml", "--name", "empty"]
    assert main(["scene", "import-burg", "burg.yaml", *options]) == 0
    scene = load_scene("out/scene.yaml")
    assert (scene.name, scene.document.library, scene.library.name) == ("empty", "../mine", "mine")


@pytest.mark.thorough
def test_a_scene_with_furniture(tmp_path: Path, capsys: Capture) -> None:
    """From the documents of BURG-Toolkit to a station on which grasps can be judged."""
    burg_library, burg_scene = write_kitchen(tmp_path / "burg")
    library, output, station = (tmp_path / name for name in ("lib", "my.yaml", "station.yaml"))
    build = ["library", "import-burg", str(burg_library), "-o", str(library), "--workers", "1"]
    assert main(build) == 0
    said = capsys.readouterr()
    assert "have mass 0 in BURG-Toolkit and become" in said.out and "table, open_shelf" in said.out
    assert said.out.count("fixed") == 2  # both in the table
    options = ["--library", str(library), "-o", str(output), "--station-out", str(station)]
    assert main(["scene", "import-burg", str(burg_scene), *options]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    assert "instance of object 'table' is called 'table_1'" in said.out
    misfits = [line for line in said.out.splitlines() if "does not fit: " in line]
    assert len(misfits) == len(builtin_names("stations"))
    assert "its table is 1.2 x 1.4 m, and the board would extend 1340 mm over" in misfits[0]
    scene, proposed = load_scene(output), load_station(station)
    assert list(scene.background) == ["table_1", "open_shelf"]
    assert [issue for issue in check_scene(scene, proposed) if issue.is_error] == []
    assert require_usable_arm(scene, proposed) == ()
    assert proposed.document.arm is not None
    assert proposed.document.arm.X_WA.translation[2] == 0.5
    assert check_library(scene.library) == ()


def test_mistakes(burg_scene: Path, tmp_path: Path, capsys: Capture) -> None:
    def error(*options: str) -> str:
        assert main(["scene", "import-burg", *options]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        return line

    scene, output = str(burg_scene), str(tmp_path / "out.yaml")
    assert "choose another file" in error(scene, "--library", "household", "-o", scene)
    assert "houshold does not exist; did you mean 'household'" in error(
        scene, "--library", "houshold", "-o", output
    )
    burg_scene.write_text(burg_scene.read_text().replace("Mug", "Mugg"))
    assert "object 'mugg' ('Mugg') is not in library" in error(
        scene, "--library", "household", "-o", output
    )
    burg_scene.write_text("version: 1\n")
    assert "yaml_file_type: missing" in error(scene, "--library", "household", "-o", output)
    assert not Path(output).exists()
