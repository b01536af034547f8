"""`burg-drake camera locate`: a station's camera, located from its own picture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

from burg_drake.apps import build_parser
from burg_drake.cameras import camera_intrinsics, save_intrinsics
from burg_drake.core import InvalidInputError, resolve_reference, rotation_angle
from burg_drake.scene import load_scene
from burg_drake.station import build_station_diagram, load_station
from burg_drake.system_libraries import missing_render_libraries
from tests.cameras.synthetic import board_image

Capture = pytest.CaptureFixture[str]

pytestmark = pytest.mark.skipif(
    bool(missing_render_libraries()), reason="the renderer's system libraries are missing"
)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`photo.png` and `nothing.png` of the camera, and its `K.yaml`."""
    folder = tmp_path_factory.mktemp("pictures")
    station = load_station("panda_tabletop")
    built = build_station_diagram(load_scene("tabletop_six"), station, robot="none", cameras=True)
    port = built.diagram.GetOutputPort("camera.board.color_image")
    pixels = port.Eval(built.diagram.CreateDefaultContext()).data[..., :3]
    Image.fromarray(np.ascontiguousarray(pixels)).save(folder / "photo.png")
    Image.new("RGB", (640, 480)).save(folder / "nothing.png")
    Image.new("RGB", (320, 240)).save(folder / "small.png")
    save_intrinsics(camera_intrinsics(station.camera("board")), folder / "K.yaml")
    return folder


def locate(folder: Path, *words: str) -> int:
    arguments = build_parser().parse_args(
        ["camera", "locate", "tabletop_six", *words, "--intrinsics", str(folder / "K.yaml")]
    )
    return int(arguments.run(arguments))


def test_lines_make_a_station_document(pictures: Path, tmp_path: Path, capsys: Capture) -> None:
    photo = str(pictures / "photo.png")
    assert locate(pictures, photo, photo, "--name", "seen") == 0
    out, err = capsys.readouterr()
    assert "photo.png: " in err and "markers" in err and "of the mean" in err
    text = resolve_reference("panda_tabletop", "stations").read_text(encoding="utf-8")
    (tmp_path / "mine.yaml").write_text(text[: text.index("cameras:")] + out, encoding="utf-8")
    document = load_station(tmp_path / "mine.yaml").document
    truth = load_station("panda_tabletop").camera("board")
    seen = document.cameras["seen"]
    X_CD = np.linalg.inv(truth.X_WC.matrix()) @ seen.X_WC.matrix()
    assert np.linalg.norm(X_CD[:3, 3]) < 1e-3
    assert rotation_angle(X_CD[:3, :3]) < np.deg2rad(0.05)
    assert replace(seen, X_WC=truth.X_WC) == replace(truth, center=truth.principal_point)


def test_a_folder_of_a_measured_print(pictures: Path, tmp_path: Path, capsys: Capture) -> None:
    scene = load_scene("tabletop_six")
    station = load_station("panda_tabletop")
    camera = station.camera("board")
    X_SC = np.linalg.inv(station.document.X_WS.matrix()) @ camera.X_WC.matrix()
    drawn = board_image(scene.board, camera_intrinsics(camera), X_SC, scale=(0.97, 0.97))
    for name in ("1.png", "2.png"):
        Image.fromarray(drawn).save(tmp_path / name)
    found = []
    for words in ([], ["--measured-mm", "97"]):
        assert locate(pictures, str(tmp_path), *words) == 0
        out, err = capsys.readouterr()
        assert f"{tmp_path / '1.png'}: " in err and f"{tmp_path / '2.png'}: " in err
        data = yaml.safe_load(out)["cameras"]["board"]["X_WC"]["translation"]
        found.append(np.linalg.norm(np.array(data) - camera.X_WC.matrix()[:3, 3]))
    assert found[0] > 0.015
    assert found[1] < 1e-3


def test_a_picture_without_a_board(pictures: Path, capsys: Capture) -> None:
    with pytest.raises(InvalidInputError, match="the camera cannot be located: "):
        locate(pictures, str(pictures / "nothing.png"))
    with pytest.raises(InvalidInputError, match=r"small\.png has 320 x 240 pixels"):
        locate(pictures, str(pictures / "small.png"))
