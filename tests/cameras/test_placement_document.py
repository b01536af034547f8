"""Placement files: what was measured comes back as it was."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.cameras import (
    CameraPlace,
    CheckedImage,
    CheckedScene,
    ExtraObject,
    Intrinsics,
    Placement,
    PlacementCheck,
    describe_image_file,
    load_placement,
    save_placement,
)
from burg_drake.core import (
    DocumentError,
    InvalidInputError,
    Pose,
    make_pose,
    resolve_reference,
    rot_z,
)

CHECK = PlacementCheck(
    scene=CheckedScene(name="two", path="two.yaml", content="abc"),
    taken="2026-01-02T03:04:05+00:00",
    method="depth",
    image=CheckedImage(file="photo.png", content="123"),
    more_images=(CheckedImage(file="other.png", content="124"),),
    depth=CheckedImage(file="depth.png", content="456"),
    intrinsics=Intrinsics(width=640, height=480, focal=(600.0, 601.0), center=(320.0, 240.0)),
    camera=CameraPlace(
        X_SC=Pose.from_matrix(make_pose(rot_z(0.3), (0.1, 0.2, 0.3)), quaternion=True),
        reprojection_error=0.125,
        covariance=tuple(np.arange(36.0).tolist()),
        markers=40,
    ),
    instances={
        "mug": Placement(
            object="mug",
            status="measured",
            target=Pose(translation=(0.1, 0.1, 0.0), rpy_deg=(0.0, 0.0, 90.0)),
            measured=Pose(translation=(0.11, 0.1, 0.0), rpy_deg=(0.0, 0.0, 95.0)),
            reference=(0.01, 0.0, 0.0),
            displacement=(0.01, 0.0),
            displacement_sd=(1e-4, 2e-4),
            angle=-0.5,
            angle_sd=0.01,
            seen=0.75,
            residual=0.25,
        ),
        "can": Placement(
            object="can", status="not_seen", reason="it is out of view", target=Pose()
        ),
    },
    extra=(ExtraObject(position=(0.3, 0.2), width=0.05),),
    versions={"burg_drake": "0.1"},
)


def test_a_check_comes_back_from_its_file_as_it_was(tmp_path: Path) -> None:
    save_placement(CHECK, tmp_path / "placement.yaml")
    assert load_placement(tmp_path / "placement.yaml") == CHECK


def test_what_is_not_known_is_not_in_the_file(tmp_path: Path) -> None:
    save_placement(CHECK, tmp_path / "placement.yaml")
    can = (tmp_path / "placement.yaml").read_text().split("can:")[1]
    assert "displacement" not in can
    assert "angle" not in can
    assert load_placement(tmp_path / "placement.yaml").instances["can"].displacement is None


def test_a_status_that_does_not_exist_names_those_that_do(tmp_path: Path) -> None:
    save_placement(CHECK, tmp_path / "placement.yaml")
    text = (tmp_path / "placement.yaml").read_text().replace("not_seen", "lost")
    (tmp_path / "placement.yaml").write_text(text)
    with pytest.raises(DocumentError, match=r"instances\.can\.status.*known: measured, not_seen"):
        load_placement(tmp_path / "placement.yaml")


def test_files_go_by_name_and_hash(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"abc")
    entry = describe_image_file(tmp_path / "a.png")
    # of FIPS 180-2, appendix B.1
    digest = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert entry == CheckedImage(file="a.png", content=digest)
    with pytest.raises(InvalidInputError, match=r"cannot read .*b\.png"):
        describe_image_file(tmp_path / "b.png")


def test_a_scene_beside_the_file_keeps_its_path_when_both_move(tmp_path: Path) -> None:
    for given, kept in (
        (tmp_path / "scenes" / "two.yaml", "../scenes/two.yaml"),
        (resolve_reference("tabletop_six", "scenes"), "tabletop_six"),
    ):
        check = replace(CHECK, scene=replace(CHECK.scene, path=str(given)))
        (tmp_path / "trial").mkdir(exist_ok=True)
        save_placement(check, tmp_path / "trial" / "placement.yaml")
        assert load_placement(tmp_path / "trial" / "placement.yaml").scene.path == kept
