"""The gripper document."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core.errors import DocumentError, InvalidInputError, UnknownNameError
from burg_drake.core.frames import make_pose, rotation_from_rpy
from burg_drake.core.resources import resolve
from burg_drake.station.hand import Hand, load_hand


@pytest.fixture(scope="module")
def panda() -> Hand:
    return load_hand("panda_hand")


def test_grasp_frame_of_the_panda_hand(panda: Hand) -> None:
    """TCP 0.1034 m in front of the hand; its fingers move along y of the hand, x of G."""
    X_HG = panda.X_HG.matrix()
    np.testing.assert_allclose(X_HG[:3, 3], (0.0, 0.0, 0.1034))
    np.testing.assert_allclose(X_HG[:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    assert panda.opening == (0.0, 0.08)
    assert sum(f.open - f.closed for f in panda.fingers) == pytest.approx(panda.opening[1])


def test_hand_poses_bring_the_grasp_frame_to_the_goal(panda: Hand) -> None:
    rng = np.random.default_rng(0)
    X_WG = make_pose(rotation_from_rpy(rng.uniform(-3, 3, (20, 3))), rng.normal(size=(20, 3)))
    X_WH = panda.X_AH(X_WG)
    np.testing.assert_allclose(X_WH @ panda.X_HG.matrix(), X_WG, atol=1e-14)
    # The TCP is in front of the hand, along the approach direction.
    tcp = X_WH[:, :3, 3] + 0.1034 * X_WG[:, :3, 2]
    np.testing.assert_allclose(tcp, X_WG[:, :3, 3], atol=1e-14)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"opening": (0.08, 0.0)}, r"opening \[0.08, 0.0\] must rise from 0"),
        ({"opening": (-0.01, 0.08)}, r"opening \[-0.01, 0.08\] must rise from 0"),
        ({"force": 0.0}, "force and closing_speed must be above 0"),
        ({"closing_speed": -0.05}, "force and closing_speed must be above 0"),
    ],
)
def test_bad_figures(panda: Hand, wrong: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        replace(panda, **wrong)  # type: ignore[arg-type]


def test_unknown_key_and_name(tmp_path: Path) -> None:
    text = resolve("panda_hand", "models/hands").read_text(encoding="utf-8")
    file = tmp_path / "mine.yaml"
    file.write_text(text.replace("closing_speed:", "closing_sped:"), encoding="utf-8")
    with pytest.raises(
        DocumentError, match=r"mine\.yaml:\d+: unknown key 'closing_sped'; did you mean 'closing_s"
    ):
        load_hand(str(file))
    with pytest.raises(UnknownNameError, match=r"pandahand .*did you mean 'panda_hand'"):
        load_hand("pandahand")
