"""Where the limits of an arm come from: the station, the model, Franka's table, or nowhere."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import DocumentError, InvalidInputError, resolve_reference
from burg_drake.motion import ArmKinematics, ArmLimits
from burg_drake.scene import Scene, load_scene
from burg_drake.station import Station, build_station_diagram, load_station


def limits(station: Station) -> ArmLimits:
    scene = load_scene("tabletop_six")
    empty = Scene(replace(scene.document, instances=(), background=()), scene.library, scene.path)
    diagram = build_station_diagram(empty, station, weld_objects=True)
    return ArmLimits.of(diagram, ArmKinematics.of(diagram))


def with_arm(**changes: object) -> Station:
    station = load_station("panda_tabletop")
    assert station.document.arm is not None
    arm = replace(station.document.arm, **changes)
    return replace(station, document=replace(station.document, arm=arm))


def without(folder: Path, name: str, pattern: str) -> Station:
    """A station whose arm is a copy of its model without some text."""
    station = load_station(name)
    assert station.arm_model is not None
    text = station.arm_model.read_text(encoding="utf-8")
    text = re.sub(r"(<uri>|filename=\")(?=meshes)", rf"\g<1>{station.arm_model.parent}/", text)
    (folder / station.arm_model.name).write_text(re.sub(pattern, "", text), encoding="utf-8")
    return replace(station, arm_model=folder / station.arm_model.name)


def test_the_panda_has_franka_s_limits() -> None:
    # Franka Control Interface documentation, "Limits for Panda".
    found = limits(load_station("panda_tabletop"))
    assert found.velocity.tolist() == [2.175] * 4 + [2.61] * 3
    assert found.acceleration.tolist() == [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]
    assert found.jerk.tolist() == [7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]
    assert found.torque.tolist() == [87.0] * 4 + [12.0] * 3
    assert found.lower.tolist() == [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973]
    assert found.upper.tolist() == [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973]


def test_a_panda_whose_model_lacks_accelerations_has_franka_s(tmp_path: Path) -> None:
    found = limits(without(tmp_path, "panda_tabletop", "<drake:acceleration>.*"))
    assert found.acceleration.tolist() == [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]


def test_the_station_counts_before_the_model() -> None:
    slow = {"velocity": (1.0,) * 7, "acceleration": (2.0,) * 7, "jerk": (3.0,) * 7}
    found = limits(with_arm(**slow))
    for name, values in slow.items():
        assert tuple(getattr(found, name)) == values


def test_another_arm_is_careful_where_nothing_is_stated(tmp_path: Path) -> None:
    """A UR5e that states its speed alone: half a second to full speed, a tenth to full
    acceleration."""
    found = limits(without(tmp_path, "ur5e_tabletop", r'drake:acceleration="[^"]*"'))
    np.testing.assert_allclose(found.velocity, np.pi)
    np.testing.assert_allclose(found.acceleration * 0.5, found.velocity)
    np.testing.assert_allclose(found.jerk * 0.1, found.acceleration)


def test_no_limit_of_velocity_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="'panda_joint1' has no velocity limit"):
        limits(without(tmp_path, "panda_tabletop", "<velocity>.*"))


def test_limits_for_another_number_of_joints() -> None:
    with pytest.raises(
        InvalidInputError, match=r"arm\.jerk has 6 numbers, but the arm has 7 joints"
    ):
        limits(with_arm(jerk=(1.0,) * 6))


def test_a_station_file_states_limits(tmp_path: Path) -> None:
    path = tmp_path / "slow.yaml"
    text = resolve_reference("panda_tabletop", "stations").read_text(encoding="utf-8")
    path.write_text(text.replace("  home:", "  jerk: [1, 2, 3, 4, 5, 6, 7]\n  home:"))
    assert limits(load_station(path)).jerk.tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
    path.write_text(text.replace("  home:", "  jerk: [1, 2, 3, 4, 5, 6, 0]\n  home:"))
    with pytest.raises(DocumentError, match=r"slow\.yaml:11: arm.* jerk limits must be 0.001"):
        load_station(path)


def test_stretching_by_the_factor_meets_the_tightest_limit() -> None:
    panda = limits(load_station("panda_tabletop"))
    peaks = tuple(np.random.default_rng(0).uniform(0.1, 9.0, 7) for _ in range(3))
    factor = panda.time_scale(peaks)
    v, a, j = (peak / factor ** (k + 1) for k, peak in enumerate(peaks))
    used = np.array([v / panda.velocity, a / panda.acceleration, j / panda.jerk])
    assert used.max() == pytest.approx(1.0, rel=1e-12)


def test_slowed_limits_are_those_of_the_slower_motion() -> None:
    panda = limits(load_station("panda_tabletop"))
    peaks = (panda.velocity, panda.acceleration, panda.jerk)
    half = tuple(peak * 0.5 ** (k + 1) for k, peak in enumerate(peaks))
    assert panda.slowed(0.5).time_scale(half) == pytest.approx(1.0, rel=1e-12)
