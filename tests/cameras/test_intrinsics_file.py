"""Files of intrinsics, ours and others', by their content."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from burg_drake.cameras import Intrinsics, load_intrinsics, save_camera_info, save_intrinsics
from burg_drake.core import BurgError, DocumentError, InvalidInputError

RADIAL = Intrinsics(
    camera="webcam",
    width=640,
    height=480,
    focal=(600.0, 610.0),
    center=(315.0, 241.0),
    distortion=(-0.3, 0.1, 0.001, -0.002, -0.01),
)
RATIONAL = replace(RADIAL, distortion=(0.35, 0.02, 0.0002, -0.0003, 0.004, 0.75, 0.12, 0.01))
PINHOLE = replace(RADIAL, distortion=())
FISHEYE = replace(RADIAL, model="fisheye", distortion=(0.03, -0.02, 0.006, -0.001))
EQUIDISTANT = replace(FISHEYE, distortion=(0.0, 0.0, 0.0, 0.0))

OF_OPENCV = """%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ {}, 600., 240., 0., 0., 1. ]
"""
OURS = "version: 1\nwidth: 640\nheight: 480\nfocal: [1, 2]\ncenter: [1, 2]\n"
# As camera_calibration of ROS writes it.
CAMERA_INFO = """\
image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [600., 0., 315., 0., 610., 241., 0., 0., 1.]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.3, 0.1, 0.001, -0.002, -0.01]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1., 0., 0., 0., 1., 0., 0., 0., 1.]
projection_matrix:
  rows: 3
  cols: 4
  data: [570., 0., 312., 0., 0., 580., 240., 0., 0., 0., 1., 0.]
"""
# As `rostopic echo -n 1 /camera/camera_info` and `ros2 topic echo --once` print it.
MESSAGE_1 = """\
header:
  seq: 7
  stamp: {secs: 1, nsecs: 2}
  frame_id: "camera"
height: 480
width: 640
distortion_model: "plumb_bob"
D: [-0.3, 0.1, 0.001, -0.002, -0.01]
K: [600.0, 0.0, 315.0, 0.0, 610.0, 241.0, 0.0, 0.0, 1.0]
R: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
P: [570.0, 0.0, 312.0, 0.0, 0.0, 580.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: 0
binning_y: 0
roi: {x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: False}
---
"""
MESSAGE_2 = (
    MESSAGE_1.replace("\nD:", "\nd:").replace("\nK:", "\nk:").replace("\nR:", "\nr:")
).replace("\nP:", "\np:")


def written(tmp_path: Path, text: str, name: str = "K.yaml") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "intrinsics", [PINHOLE, RADIAL, RATIONAL, FISHEYE, replace(RADIAL, residual=0.12)]
)
def test_ours_reads_back(tmp_path: Path, intrinsics: Intrinsics) -> None:
    save_intrinsics(intrinsics, tmp_path / "K.yaml", "made by a test")
    assert load_intrinsics(tmp_path / "K.yaml") == intrinsics


@pytest.mark.parametrize("text", [CAMERA_INFO, MESSAGE_1, MESSAGE_2])
def test_camera_info_of_ros(tmp_path: Path, text: str) -> None:
    found = load_intrinsics(written(tmp_path, text))
    assert replace(found, camera="webcam") == RADIAL
    assert found.camera == ("narrow_stereo" if text is CAMERA_INFO else "")


@pytest.mark.parametrize("intrinsics", [PINHOLE, RADIAL, RATIONAL, FISHEYE, EQUIDISTANT])
def test_what_ros_gets_is_complete_and_reads_back(tmp_path: Path, intrinsics: Intrinsics) -> None:
    path = tmp_path / "camera_info.yaml"
    save_camera_info(intrinsics, path)
    assert load_intrinsics(path) == intrinsics
    data = yaml.safe_load(path.read_text())
    assert set(data) == set(yaml.safe_load(CAMERA_INFO))
    for matrix in [value for value in data.values() if isinstance(value, dict)]:
        assert len(matrix["data"]) == matrix["rows"] * matrix["cols"]
    assert data["distortion_model"] == (
        "equidistant"
        if intrinsics.model == "fisheye"
        else "rational_polynomial"
        if len(intrinsics.distortion) == 8
        else "plumb_bob"
    )
    P = np.array(data["projection_matrix"]["data"]).reshape(3, 4)
    assert np.array_equal(P, np.column_stack([intrinsics.K, np.zeros(3)]))


def test_ros_has_no_model_of_twelve_coefficients(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="12 coefficients"):
        save_camera_info(replace(RADIAL, distortion=(0.1,) * 12), tmp_path / "a.yaml")


@pytest.mark.parametrize("suffix", ["yml", "xml"])
@pytest.mark.parametrize("padding", [0, 9])
def test_files_that_opencv_wrote(tmp_path: Path, suffix: str, padding: int) -> None:
    path = tmp_path / f"camera.{suffix}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", RADIAL.K)
    k = np.array([[*RADIAL.distortion, *[0.0] * padding]])
    storage.write("distortion_coefficients", k.T)
    storage.write("avg_reprojection_error", 0.25)
    storage.release()
    assert load_intrinsics(path) == replace(RADIAL, camera="", residual=0.25)


@pytest.mark.parametrize("intrinsics", [FISHEYE, EQUIDISTANT])
def test_a_fisheye_file_of_opencv(tmp_path: Path, intrinsics: Intrinsics) -> None:
    path = tmp_path / "camera.yml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("fisheye_model", 1)
    storage.write("camera_matrix", intrinsics.K)
    storage.write("distortion_coefficients", np.array([intrinsics.distortion]).T)
    storage.release()
    assert load_intrinsics(path) == replace(intrinsics, camera="")


def test_a_camera_of_a_station() -> None:
    found = load_intrinsics("sim:panda_tabletop/board")
    assert (found.width, found.height, found.focal) == (640, 480, (600.0, 600.0))
    assert found.center == (319.5, 239.5) and found.is_pinhole
    assert load_intrinsics("sim:panda_tabletop") == found  # the camera called `board`


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (CAMERA_INFO.replace("plumb_bob", "equidistant"), "has 5 coefficients; 4 are"),
        (CAMERA_INFO.replace("plumb_bob", "fov"), "distortion_model 'fov' is not supported"),
        (CAMERA_INFO.replace("plumb_bob", "rational_polynomial"), "has 5 coefficients; 8 are"),
        (CAMERA_INFO.replace("image_width: 640", "image_width: wide"), "whole number of pixels"),
        (CAMERA_INFO.replace("image_height: 480\n", ""), "image_height must be a whole number"),
        (CAMERA_INFO.replace("[600., 0., 315.", "[0., 0., 315."), "not calibrated (its fx is 0)"),
        (CAMERA_INFO.replace("[600., 0., 315.", "[600., 9., 315."), "has skew"),
        (CAMERA_INFO.replace("[600., 0., 315., ", "["), "the camera matrix has 6 numbers; 9 are"),
        (
            CAMERA_INFO.replace("[600., 0.", "[x, 0."),
            "camera_matrix is not a list of finite",
        ),
        (CAMERA_INFO.replace("610.", "-610."), "must be positive"),
        (
            MESSAGE_1.replace("binning_x: 0", "binning_x: 2"),
            "only a part of what the camera matrix",
        ),
        (MESSAGE_1.replace("height: 0, width: 0", "height: 9, width: 9"), "binning or roi"),
        ("version: 1\nwidth: 640\nheight: 480\nfocal: [1, 2]\ncentre: [1, 2]\n", "centre"),
        ("version: 1\nwidth: 640\nheight: 480\nfocal: [1, 2]\n", "center"),
        (OURS + "known_to: 0\n", "known_to is 0 pixels; it must be above 0"),
        (OURS + "except_at: [nowhere]\n", "except_at has 'nowhere', which is not a part of the"),
        (OURS + "model: fisheyes\n", "'fisheyes' is not valid; did you mean 'fisheye'?"),
        ("", "the document is empty"),
        ("- 1\n- 2\n", "K.yaml"),
        (OF_OPENCV.format("600., 50., 320., 0."), "the camera matrix has skew 50"),
        (OF_OPENCV.format("600., nan, 320., 0."), "the camera matrix has skew nan"),
        (OF_OPENCV.format("600., 0., 320., 7."), "must have 0 below fx"),
        (OF_OPENCV.format("1e-300, 0., 320., 0."), "focal has 1e-300; it must be 1 to 1e+06"),
        (OF_OPENCV.format("600., 0., 1e20, 0."), "center has 1e+20; it must be -1e+06 to 1e+06"),
        (OURS.replace("width: 640", "width: 64000"), "64000 x 480 pixels; a side may have at most"),
        ("%YAML:1.0\n---\nimage_width: 640\n", "camera_matrix with 3 x 3 numbers is missing"),
        ("%YAML:1.0\n---\n: : :\n", "K.yaml"),
        ("<?xml version='1.0'?><opencv_storage>", "K.yaml:1: not valid XML"),
        (
            "<opencv_storage>\n<a>1</b>\n</opencv_storage>",
            "K.yaml:2: not valid XML: mismatched tag",
        ),
        ("<opencv_storage>\n<a/><a/></opencv_storage>", "K.yaml:2: 'a' appears twice"),
        ("<!DOCTYPE a []>\n<opencv_storage></opencv_storage>", "K.yaml:1: document type declarat"),
        ("<opencv_storage>" + 200 * "<a>" + 200 * "</a>" + "</opencv_storage>", "levels deep"),
    ],
)
def test_files_that_cannot_be_used(tmp_path: Path, text: str, message: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(BurgError) as raised:
        load_intrinsics(path)
    assert message in str(raised.value) and "K.yaml" in str(raised.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=r"cannot read .*none\.yaml"):
        load_intrinsics(tmp_path / "none.yaml")
