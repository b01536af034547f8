"""The station document, and the stations that the package installs."""

from __future__ import annotations

import math
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import (
    DocumentError,
    FieldError,
    Pose,
    UnknownNameError,
    builtin_names,
    inverse,
    load_document,
    plain_data,
    resolve_reference,
    save_document,
)
from burg_drake.scene import Board
from burg_drake.station import Arm, Camera, Station, StationDocument, load_station

A2 = np.array([[0, 0, 0], [0.594, 0, 0], [0.594, 0.42, 0], [0, 0.42, 0]])
"""Corners of the sheet in the scene frame [m]."""

STATION = """\
version: 1
name: mine
hand: panda_hand
arm:
  X_WA: {translation: [0.0, 0.0, 0.0]}
  home: [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
table: {center: [0.3, 0.0], size: [1.2, 1.4, 0.1]}
cameras:
  top: {X_WC: {translation: [0.4, 0.0, 1.0], rpy_deg: [180.0, 0.0, 0.0]}}
background:
  wall: {X_WB: {translation: [0.9, 0.0, 0.2]}, size: [0.02, 1.0, 0.4]}
"""


def station_file(folder: Path, *replaced: tuple[str, str]) -> Path:
    text = STATION
    for old, new in replaced:
        assert old in text
        text = text.replace(old, new)
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(params=builtin_names("stations"))
def builtin(request: pytest.FixtureRequest) -> Station:
    return load_station(request.param)


def board_corners(station: Station) -> np.ndarray:
    X_WS = station.document.X_WS.matrix()
    return A2 @ X_WS[:3, :3].T + X_WS[:3, 3]


def test_the_sheet_lies_on_the_table(builtin: Station) -> None:
    corners = board_corners(builtin)
    table = builtin.document.table
    np.testing.assert_allclose(corners[:, 2], 0.0, atol=1e-12)
    assert (np.abs(corners[:, :2] - table.center) < np.array(table.size[:2]) / 2).all()


def test_the_sheet_is_in_front_of_the_arm(builtin: Station) -> None:
    if builtin.document.arm is None:
        assert builtin.arm_model is None
        return
    X_WA = builtin.document.arm.X_WA.matrix()
    centre = inverse(X_WA) @ [*board_corners(builtin).mean(axis=0), 1.0]
    assert 0.4 < np.hypot(*centre[:2]) < 0.55
    assert np.abs(centre[:2]).min() < 0.2


def test_cameras_see_the_whole_sheet(builtin: Station) -> None:
    assert builtin.document.cameras
    for name, camera in builtin.document.cameras.items():
        X_CW = inverse(camera.X_WC.matrix())
        p = board_corners(builtin) @ X_CW[:3, :3].T + X_CW[:3, 3]
        assert (p[:, 2] > 0.3).all(), name
        pixels = p[:, :2] / p[:, 2:] * camera.focal + camera.principal_point
        assert (pixels > 0).all() and (pixels < (camera.width, camera.height)).all(), name
        up_C = X_CW[:3, 2]
        assert up_C[1] < -0.5, f"{name} does not stand upright"


def test_names_are_those_of_the_files(builtin: Station) -> None:
    assert builtin.name == builtin.path.stem


def test_a_station_of_ones_own(tmp_path: Path) -> None:
    station = load_station(station_file(tmp_path))
    assert station.hand.name == "panda_hand"
    assert station.hand_model == resolve_reference(
        "package://burg_drake/models/panda/panda_hand.sdf"
    )
    assert station.arm_model == resolve_reference("package://burg_drake/models/panda/panda_arm.sdf")
    assert station.document.background["wall"].size == (0.02, 1.0, 0.4)


def test_content_is_that_of_what_is_placed(tmp_path: Path) -> None:
    plain = load_station(station_file(tmp_path)).content
    assert load_station(station_file(tmp_path, ("name: mine", "name: yours"))).content == plain
    for old, new in (
        ("X_WA: {translation: [0.0", "X_WA: {translation: [0.01"),
        ("-0.785", "-0.786"),
        ("size: [0.02", "size: [0.03"),
    ):
        assert load_station(station_file(tmp_path, (old, new))).content != plain


def test_content_counts_the_meshes_of_the_hand(tmp_path: Path) -> None:
    """What the pads are made of decides whether they hold."""
    shutil.copytree(
        resolve_reference("package://burg_drake/models/wsg/wsg_50.sdf").parent, tmp_path / "wsg"
    )
    document = resolve_reference("wsg_50", "models/hands").read_text(encoding="utf-8")
    hand = document.replace("package://burg_drake/models/wsg", "wsg")
    (tmp_path / "hand.yaml").write_text(hand, encoding="utf-8")
    station = station_file(tmp_path, ("hand: panda_hand", "hand: hand.yaml"))
    before = load_station(station).content
    assert load_station(station).content == before
    pad = tmp_path / "wsg" / "meshes" / "pad.vtk"
    pad.write_text(pad.read_text().replace("0.004", "0.005"), encoding="utf-8")
    assert load_station(station).content != before


def test_principal_point() -> None:
    pose = load_station("panda_tabletop").document.cameras["board"].X_WC
    assert Camera(X_WC=pose).principal_point == (319.5, 239.5)
    assert Camera(X_WC=pose, center=(300.0, 200.0)).principal_point == (300.0, 200.0)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "hand: panda_hand",
            "hand: panda_hnd",
            r"mine\.yaml: hand: panda_hnd .*did you mean 'panda_hand'",
        ),
        ("table:", "tabel:", r"mine\.yaml:7: unknown key 'tabel'; did you mean 'table'"),
        (
            "X_WA: {translation: [0.0, 0.0, 0.0]}",
            "X_WA: {translation: [0.0, 0.0, -0.05]}",
            r"mine.yaml:\d+: arm.X_WA puts the base of the arm 50 mm deep into 'table'; raise it",
        ),
        ("size: [1.2, 1.4, 0.1]", "size: [1.2, 0.0, 0.1]", r"mine\.yaml:7: .*table size must be p"),
        ("size: [0.02", "size: [-0.02", r"mine\.yaml:11: background\.wall: obstacle size \[-0"),
        ("[180.0, 0.0, 0.0]}", "[180.0, .nan, 0.0]}", r"mine\.yaml:9: cameras\.top\.X_WC\.rpy_deg"),
        (
            "[180.0, 0.0, 0.0]}}",
            "[180.0, 0.0, 0.0]}, depth_range: [1.0, 0.5]}",
            r"cameras.top: camera depth_range must be two distances",
        ),
        (
            "X_WA: {translation",
            "model: package://burg_drake/models/panda/ur5.urdf\n  X_WA: {translation",
            r"mine\.yaml: arm\.model: package://burg_drake/models/panda/ur5\.urdf does not exist",
        ),
    ],
)
def test_what_does_not_fit_is_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises((DocumentError, UnknownNameError), match=message):
        load_station(station_file(tmp_path, (old, new)))


NUMBER = re.compile(r"(?<=[\[ ])-?\d+\.\d+(?=[,\]])")


@pytest.mark.parametrize("number", [".nan", ".inf", "-.inf"])
def test_every_number_of_a_file_has_to_be_finite(tmp_path: Path, number: str) -> None:
    """Each in its turn, so that the error names its line and key."""
    found = list(NUMBER.finditer(STATION))
    assert len(found) == 27
    for one in found:
        path = tmp_path / "mine.yaml"
        path.write_text(STATION[: one.start()] + number + STATION[one.end() :])
        line = STATION.count("\n", 0, one.start()) + 1
        with pytest.raises(DocumentError) as refused:
            load_station(path)
        told = (
            rf"{re.escape(str(path))}:{line}: [\w.]+\[\d\]: '{re.escape(number)}' is not a finite"
        )
        assert re.match(told, str(refused.value))


@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_every_number_of_a_program_has_to_be_finite(tmp_path: Path, number: float) -> None:
    """Also where the least and the greatest one are compared, of which NaN can be neither."""
    good = load_station(station_file(tmp_path)).document
    assert good.arm is not None
    wrong = {
        "table.size[1]": {"table": replace(good.table, size=(1.2, number, 0.1))},
        "table.friction": {"table": replace(good.table, friction=number)},
        "arm.velocity[1]": {"arm": replace(good.arm, velocity=(1.0, number))},
        "arm.home[0]": {"arm": replace(good.arm, home=(number, *good.arm.home[1:]))},
        "X_WS.translation[2]": {"X_WS": Pose((0.0, 0.0, number))},
        "background.wall.size[2]": {
            "background": {"wall": replace(good.background["wall"], size=(0.02, 1.0, number))}
        },
    }
    for key, field in wrong.items():
        with pytest.raises(FieldError) as refused:
            replace(good, **field)
        assert str(refused.value) == f"{key} is {number}; it must be a finite number"
    with pytest.raises(FieldError, match=rf"^size\[1\] is {number}; .*finite"):
        Board(size=(0.5, number))


def test_the_mount_of_another_arms_hand_has_to_be_given(tmp_path: Path) -> None:
    """The Panda's -45 degrees would turn every grasp of another arm, without a word."""
    path = station_file(tmp_path, ("  X_WA:", "  flange: fr3_link8\n  X_WA:"))
    with pytest.raises(DocumentError) as refused:
        load_station(path)
    assert str(refused.value).startswith(f"{path}:5: arm: X_FH is missing, and only a Panda's ")
    assert "in the frame of 'fr3_link8': X_FH: {} if the two frames coincide" in str(refused.value)


def test_a_given_mount_is_kept_in_files_even_if_it_is_that_of_the_panda(tmp_path: Path) -> None:
    same = Arm(home=(0.0,), flange="tool0", X_FH=Pose(rpy_deg=(0.0, 0.0, -45.0)))
    document = replace(load_station("panda_tabletop").document, arm=same)
    save_document(document, tmp_path / "own.yaml")
    assert load_document(tmp_path / "own.yaml", StationDocument) == document
    assert "X_FH" not in plain_data(load_station("panda_tabletop").document.arm)


def test_a_base_beside_the_table_may_be_lower(tmp_path: Path) -> None:
    low = ("X_WA: {translation: [0.0, 0.0, 0.0]}", "X_WA: {translation: [-0.5, 0.0, -0.2]}")
    assert load_station(station_file(tmp_path, low)).document.arm is not None


def test_a_base_may_stand_on_an_obstacle(tmp_path: Path) -> None:
    for height in (0.4, 0.3995):  # the wall's upper edge, and what rounding makes of it
        on_top = ("{translation: [0.0, 0.0, 0.0]}", f"{{translation: [0.9, 0.0, {height}]}}")
        assert load_station(station_file(tmp_path, on_top)).document.arm is not None


def test_unknown_camera(tmp_path: Path) -> None:
    station = load_station(station_file(tmp_path))
    assert station.camera("top") is station.document.cameras["top"]
    with pytest.raises(UnknownNameError) as error:
        station.camera("tpo")
    assert str(error.value) == (
        f"station 'mine' ({station.path}) has no camera 'tpo'; did you mean 'top'? Known: top"
    )


def test_unknown_station() -> None:
    with pytest.raises(UnknownNameError, match=r"panda_tabeltop .*did you mean 'panda_tabletop'"):
        load_station("panda_tabeltop")
