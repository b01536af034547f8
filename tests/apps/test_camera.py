"""`burg-drake camera`: lists, shows, converts, prints targets and calibrates."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from burg_drake.apps import field_of_view, main
from burg_drake.cameras import (
    CharucoTarget,
    Image,
    Intrinsics,
    load_intrinsics,
    save_intrinsics,
    silence_opencv,
    write_image,
)

Capture = pytest.CaptureFixture[str]
TRUTH = Intrinsics(width=320, height=240, focal=(330.0, 332.0), center=(163.0, 117.0))
TARGET = CharucoTarget(squares=(6, 5), square=0.03, marker=0.02)
BOARD = ["--squares", "6x5", "--square-mm", "30", "--marker-mm", "20"]
TURNS = [(0.5, 0.0), (-0.5, 0.1), (0.0, 0.6), (0.1, -0.5), (0.4, 0.4), (-0.4, 0.4), (0.3, -0.4)]


def photo(tilt: tuple[float, float], distance: float = 0.24) -> Image:
    """OpenCV's drawing of the board, warped as a pinhole camera sees it; 16 rays a pixel, whose
    light adds up, in the levels of sRGB."""
    per_mm, fine = 6, 4
    width, height = (round(1e3 * side * per_mm) for side in TARGET.size)
    flat = TARGET.board.generateImage((width + 60 * per_mm, height + 60 * per_mm), marginSize=180)
    R = cv2.Rodrigues(np.array([*tilt, 0.4 * tilt[0]]))[0]
    t = np.array([0.0, 0.0, distance]) - R @ [TARGET.size[0] / 2, TARGET.size[1] / 2, 0.0]
    K = TRUTH.K.copy()
    K[:2] *= fine
    K[:2, 2] += 0.5 * (fine - 1)
    to_metres = np.diag([1e-3 / per_mm, 1e-3 / per_mm, 1.0])
    to_metres[:2, 2] = 0.5e-3 / per_mm - 0.03
    H = K @ np.column_stack([R[:, 0], R[:, 1], t]) @ to_metres
    large = cv2.warpPerspective(flat, H, (320 * fine, 240 * fine), borderValue=200)
    light = cv2.resize(large.astype(float) / 255.0, (320, 240), interpolation=cv2.INTER_AREA)
    low = light <= 0.0031308
    srgb = np.where(low, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)
    gray = np.rint(255.0 * srgb).astype(np.uint8)
    return np.dstack([gray] * 3)


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("photos")
    number = 0
    for distance in (0.24, 0.3):
        for tilt in TURNS:
            write_image(folder / f"photo{number}.png", photo(tilt, distance))
            number += 1
    return folder


def test_photos_of_the_target_give_the_intrinsics(
    photos: Path, tmp_path: Path, capsys: Capture
) -> None:
    write_image(photos / "photo90.png", np.full((240, 320, 3), 90, dtype=np.uint8))
    (photos / "photo91.png").write_bytes(b"\x89PNG")
    report = tmp_path / "report.html"
    command = ["camera", "calibrate", str(photos), *BOARD, "--model", "pinhole", "--name", "webcam"]
    assert main([*command, "-o", str(tmp_path / "K.yaml"), "--report", str(report)]) == 0
    out = capsys.readouterr().out
    found = load_intrinsics(tmp_path / "K.yaml")
    assert found.camera == "webcam" and (found.width, found.height) == (320, 240)
    assert np.allclose(found.focal, TRUTH.focal, atol=1.0)
    assert np.allclose(found.center, TRUTH.center, atol=0.5)
    assert found.residual is not None and found.residual < 0.1
    assert "left out: photo90.png does not show the target" in out
    assert "left out: " + str(photos / "photo91.png") + " cannot be read as an image" in out
    assert out.count("\nphoto") == 14
    page = report.read_text()
    assert "photo13.png" in page and "photo91.png" in page and "http" not in page
    assert page.count("<svg") == 4 + 14
    # The promise: the same figure in the document, its header, the page and the terminal.
    assert found.known_to is not None and 0.0 < found.known_to < 1.0
    assert len(found.except_at) == 8  # the target was in the middle
    known = f"in the middle only, to {found.known_to:.2f} pixels there"
    assert f"# In 19 of 20 cases the camera is known {known}" in (tmp_path / "K.yaml").read_text()
    assert f"In 19 of 20 cases the camera is known {known}" in page
    assert f"known            {known}" in out
    assert "upper left corner " in out


@pytest.mark.thorough
def test_live_views_are_taken_from_whatever_moves(
    photos: Path, tmp_path: Path, capsys: Capture
) -> None:
    """A video in which the target is held still in each place for three frames."""
    video = tmp_path / "held.avi"
    with silence_opencv():
        writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (320, 240))
    for tilt in TURNS:
        for distance in (0.24, 0.24, 0.24, 0.32, 0.32, 0.32):
            writer.write(photo(tilt, distance))
    writer.release()
    kept = tmp_path / "kept"
    command = ["camera", "calibrate", "--camera", str(video), *BOARD, "--model", "pinhole"]
    code = main([*command, "-o", str(tmp_path / "K.yaml"), "--save-views", str(kept), "--keep"])
    err = capsys.readouterr().err
    assert code == 0
    taken = len(list(kept.glob("view_*.png")))
    assert taken >= 5 and f"{taken} of 20 views: " in err and "hold still" in err
    assert np.allclose(load_intrinsics(tmp_path / "K.yaml").focal, TRUTH.focal, rtol=0.01)
    assert "1 of 20 views: show the target from other sides" in err
    asked = [line for line in err.splitlines() if line.startswith(f"{taken} of 20 views: ")]
    assert any(
        "move the target into and across the " in line or "tilt the target" in line
        for line in asked
    )


def test_a_result_that_tells_little_is_not_written(tmp_path: Path, capsys: Capture) -> None:
    for number in range(4):
        write_image(tmp_path / f"{number}.png", photo((0.02 * number, 0.0), 0.25 + 0.02 * number))
    output = tmp_path / "K.yaml"
    images = [str(tmp_path / f"{number}.png") for number in range(4)]
    command = ["camera", "calibrate", *images, *BOARD, "--model", "radial", "-o", str(output)]
    assert main(command) == 1
    err = capsys.readouterr().err
    assert "tilt the target by 20 to 45 degrees, so that it faces left" in err
    assert "give --keep" in err and not output.exists()
    assert main([*command, "--keep"]) == 1
    assert output.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "give images of the target, or --camera; not both"),
        (["a.png", "--camera", "0"], "give images of the target, or --camera; not both"),
        (["nowhere/*.png"], "no image files match 'nowhere/*.png'"),
        (["--camera", "97"], "camera 97 does not open"),
        (["a.png", "--squares", "8"], "'8' is not two whole numbers, such as 8x11"),
        (["a.png", "--marker-mm", "20"], "markers of 20 mm do not fit into squares of 20 mm"),
    ],
)
def test_wrong_arguments(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Capture,
    arguments: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    command = ["camera", "calibrate", *arguments, "-o", "K.yaml"]
    try:
        code = main(command)
    except SystemExit as error:  # argparse
        code = int(error.code or 0)
    assert code == 2 and message in capsys.readouterr().err
    assert not (tmp_path / "K.yaml").exists()


def test_target_is_nothing_but_a_pdf(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "target.png"
    assert main(["camera", "target", "-o", str(path)]) == 2
    assert f"{path}: only PDF is written; end the name with .pdf" in capsys.readouterr().err
    assert not path.exists()


def test_target_is_a_pdf(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "target.pdf"
    assert main(["camera", "target", "-o", str(path), "--measured-mm", "99,100.5"]) == 0
    assert path.read_bytes().startswith(b"%PDF")
    assert "8 x 11 squares of 20 mm on A4" in capsys.readouterr().out
    assert main(["camera", "target", "-o", str(path), "--square-mm", "40"]) == 2
    assert "but page A4 has room" in capsys.readouterr().err


def test_show_and_convert(tmp_path: Path, capsys: Capture) -> None:
    k = Intrinsics(
        width=640, height=480, focal=(600.0, 600.0), center=(319.5, 239.5),
        distortion=(-0.2, 0.0, 0.0, 0.0), residual=0.1,
    )  # fmt: skip
    ours, ros = tmp_path / "K.yaml", tmp_path / "camera_info.yaml"
    save_intrinsics(k, ours)
    assert main(["camera", "convert", str(ours), "--to", "ros", "-o", str(ros)]) == 0
    assert main(["camera", "show", str(ros)]) == 0
    out = capsys.readouterr().out
    assert "640 x 480 pixels" in out and "fx 600.00, fy 600.00" in out
    distorted = math.hypot(319.5, 239.5) / 600.0  # = r - 0.2 r^3
    straight = min(r.real for r in np.roots([-0.2, 0.0, 1.0, -distorted]) if r.real > 0.0)
    moved = 600.0 * (straight - distorted)
    assert f"upper left {moved:.1f}, upper right {moved:.1f}" in out
    back = tmp_path / "back.yaml"
    assert main(["camera", "convert", str(ros), "-o", str(back)]) == 0
    assert np.allclose(load_intrinsics(back).distortion[:4], k.distortion)


def test_field_of_view_of_a_pinhole_camera() -> None:
    k = Intrinsics(width=640, height=480, focal=(320.0, 240.0), center=(319.5, 239.5))
    across, down, diagonal = field_of_view(k)
    assert across == pytest.approx(math.pi / 2) == pytest.approx(down)
    assert diagonal == pytest.approx(2 * math.atan(math.sqrt(2.0)))


def test_a_fisheye_may_see_behind_itself(tmp_path: Path, capsys: Capture) -> None:
    """Even angles, 160 pixels a radian: 640 pixels are 4 radians."""
    k = Intrinsics(
        width=640, height=480, focal=(160.0, 160.0), center=(319.5, 239.5),
        model="fisheye", distortion=(0.0, 0.0, 0.0, 0.0),
    )  # fmt: skip
    across, down, diagonal = field_of_view(k)
    assert (across, down, diagonal) == pytest.approx((4.0, 3.0, 5.0))
    save_intrinsics(k, tmp_path / "K.yaml")
    assert main(["camera", "show", str(tmp_path / "K.yaml")]) == 0
    out = capsys.readouterr().out
    corner = math.degrees(math.hypot(319.5, 239.5) / 160.0)
    assert "lens model       fisheye" in out
    assert f"corners look     upper left {corner:.1f}, upper right {corner:.1f}" in out


def test_a_station_has_intrinsics_too(capsys: Capture) -> None:
    assert main(["camera", "show", "sim:panda_tabletop/board"]) == 0
    out = capsys.readouterr().out
    assert "640 x 480 pixels" in out and "distortion       none" in out


def test_list_without_cameras(capsys: Capture) -> None:
    code = main(["camera", "list"])
    captured = capsys.readouterr()
    cameras = captured.out.count("camera ")
    assert code == (0 if cameras else 1)
    assert cameras or "no camera gives images; is one plugged in" in captured.err
