"""Samples of motions, and the files that plans are exchanged by."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from burg_drake.core import InvalidInputError
from burg_drake.motion import (
    MOTION_PHASES,
    ArmLimits,
    DoubleS,
    Plan,
    PlanOrigin,
    Trajectory,
    load_plan,
)
from burg_drake.scene import load_scene
from burg_drake.station import load_station

LIMITS = ArmLimits(
    np.full(2, -3.0),
    np.full(2, 3.0),
    *(np.full(2, x) for x in (1.0, 4.0, 80.0)),
    np.array([9.0, np.inf]),
)
ORIGIN = PlanOrigin(("a", "b"), LIMITS, "st", "12ab", "sc", "34cd", "mug", np.eye(4))


def motion(start: list[float], end: list[float]) -> Trajectory:
    way = np.subtract(end, start)
    cubics = DoubleS.of(1.0, 4.0, 80.0).over(way)
    moved = replace(cubics, q=cubics.q + start)
    return Trajectory.of(moved, np.array(start), np.array(end), 1000.0)


@pytest.fixture
def plan() -> Plan:
    return Plan(
        transfer=motion([0.0, 0.1], [0.9, -0.3]),
        approach=motion([0.9, -0.3], [0.7, 0.2]),
        lift=motion([0.7, 0.2], [0.1, 0.3]),
        close_time=0.5,
        opening=0.08,
        width=0.031,
        origin=ORIGIN,
    )


def test_samples_are_a_millisecond_apart_and_end_at_rest() -> None:
    trajectory = motion([0.0, 0.1], [0.9, -0.3])
    exact = DoubleS.of(1.0, 4.0, 80.0).duration
    assert exact <= trajectory.duration <= exact + 0.001
    np.testing.assert_array_equal(trajectory.t, np.arange(len(trajectory.t)) / 1000.0)
    np.testing.assert_array_equal(trajectory.q[[0, -1]], [[0.0, 0.1], [0.9, -0.3]])
    assert not np.any([trajectory.v[[0, -1]], trajectory.a[[0, -1]]])


def test_peaks_of_samples_are_those_of_the_motion() -> None:
    way = np.array([0.9, 0.4])  # over a unit of way the limits are 1, 4, 80
    for peak, limit in zip(motion([0.0, 0.1], [0.9, -0.3]).peaks(), (1.0, 4.0, 80.0), strict=True):
        np.testing.assert_allclose(peak, limit * way, rtol=0.01)


def test_a_false_velocity_shows() -> None:
    trajectory = motion([0.0, 0.1], [0.9, -0.3])
    torn = replace(trajectory, q=trajectory.q + 0.01 * (trajectory.t > 0.5)[:, None])
    assert torn.peaks()[0].max() == pytest.approx(0.01 / 0.001, rel=0.2)


def test_between_the_samples_there_are_cubic_polynomials() -> None:
    t = np.array([0.0, 0.5, 2.0])
    q, v, a = 1.0 - 2.0 * t + 0.5 * t**3, -2.0 + 1.5 * t**2, 3.0 * t
    cubic = Trajectory(t, q[:, None], v[:, None], a[:, None])
    when = np.linspace(0.0, 2.0, 33)
    np.testing.assert_allclose(cubic.at(when)[:, 0], 1.0 - 2.0 * when + 0.5 * when**3, atol=1e-12)
    np.testing.assert_array_equal(cubic.at(0.5), q[1:2])
    np.testing.assert_array_equal(cubic.at(np.array([-1.0, 9.0])), q[[0, -1], None])


def test_the_phases_follow_one_another(plan: Plan) -> None:
    whole = plan.whole
    assert tuple(plan.phases) == tuple(name for name in MOTION_PHASES if name != "retreat")
    assert whole.duration == pytest.approx(plan.duration, abs=1e-9)
    parts = (plan.transfer, plan.approach, plan.lift)
    assert plan.duration == pytest.approx(0.5 + sum(part.duration for part in parts), abs=1e-9)
    np.testing.assert_allclose(np.diff(whole.t), 0.001, atol=1e-9)
    before = plan.transfer.duration + plan.approach.duration
    closing = (whole.t >= before - 1e-9) & (whole.t <= before + 0.5 + 1e-9)
    assert (whole.q[closing] == plan.approach.q[-1]).all()
    for start, part in ((0.0, plan.transfer), (before + 0.5, plan.lift)):
        np.testing.assert_allclose(whole.at(start + part.t), part.q, atol=1e-12)


def test_drake_has_the_same_positions_and_velocities(plan: Plan) -> None:
    drake = plan.to_drake()
    assert drake.end_time() == pytest.approx(plan.duration, abs=1e-9)
    times = np.random.default_rng(0).uniform(0.0, plan.duration, 50)
    positions = np.array([drake.value(t)[:, 0] for t in times])
    np.testing.assert_allclose(positions, plan.whole.at(times), atol=1e-12)
    speed = np.array([drake.EvalDerivative(t)[:, 0] for t in plan.lift.t[:1]])
    np.testing.assert_allclose(speed, 0.0, atol=1e-12)


def assert_same(a: Trajectory, b: Trajectory) -> None:
    for field in fields(a):
        np.testing.assert_array_equal(getattr(a, field.name), getattr(b, field.name))


def written(plan: Plan, folder: Path, suffix: str) -> Path:
    path = folder / f"plan.{suffix}"
    (plan.to_csv if suffix == "csv" else plan.to_json)(path)
    return path


RETREAT = {
    "retreat": motion([0.7, 0.2], [0.65, 0.25]),
    "lift": motion([0.65, 0.25], [0.1, 0.3]),
}


@pytest.mark.parametrize("suffix", ["json", "csv"])
def test_files_bring_a_retreat_back(plan: Plan, tmp_path: Path, suffix: str) -> None:
    plan = replace(plan, **RETREAT)
    back = load_plan(written(plan, tmp_path, suffix))
    assert tuple(back.phases) == MOTION_PHASES
    for name, phase in plan.phases.items():
        assert_same(back.phases[name], phase)


@pytest.mark.parametrize("suffix", ["json", "csv"])
@pytest.mark.parametrize("changes", [{}, {"width": np.nan, "opening": np.nan}, {"origin": None}])
def test_files_bring_it_back_bit_by_bit(
    plan: Plan, tmp_path: Path, changes: dict, suffix: str
) -> None:
    plan = replace(plan, **changes)
    back = load_plan(written(plan, tmp_path, suffix))
    for name in ("transfer", "approach", "lift"):
        assert_same(getattr(back, name), getattr(plan, name))
    for name in ("close_time", "opening", "width"):
        np.testing.assert_equal(getattr(back, name), getattr(plan, name))
    if plan.origin is None:
        assert back.origin is None
        return
    assert back.origin is not None
    for field in fields(PlanOrigin):
        a, b = getattr(plan.origin, field.name), getattr(back.origin, field.name)
        if field.name == "limits":
            for limit in fields(ArmLimits):
                np.testing.assert_array_equal(getattr(a, limit.name), getattr(b, limit.name))
        else:
            np.testing.assert_equal(a, b)


def test_json_is_laid_out_as_ros_s_joint_trajectory(plan: Plan, tmp_path: Path) -> None:
    plan.to_json(tmp_path / "plan.json")
    message = json.loads((tmp_path / "plan.json").read_text())["joint_trajectory"]
    assert message["joint_names"] == ["a", "b"]
    point = message["points"][1234]
    assert point["time_from_start"] == {"sec": 1, "nanosec": 234_000_000}
    assert point["positions"] == plan.whole.q[1234].tolist()
    assert set(point) == {"positions", "velocities", "accelerations", "time_from_start"}


def test_csv_has_a_row_for_each_sample(plan: Plan, tmp_path: Path) -> None:
    plan.to_csv(tmp_path / "plan.csv")
    with open(tmp_path / "plan.csv", newline="") as stream:
        rows = list(csv.DictReader(stream))
    titles = ["t", "phase", "q_a", "q_b", "v_a", "v_b", "a_a", "a_b", "width"]
    assert list(rows[0]) == titles
    whole = plan.whole
    for name, column in (("t", whole.t), ("q_b", whole.q[:, 1]), ("a_a", whole.a[:, 0])):
        np.testing.assert_array_equal([float(row[name]) for row in rows], column)
    times = {p: sum(row["phase"] == p for row in rows) / 1000.0 for p in plan.phases}
    for name, phase in plan.phases.items():
        assert times[name] == pytest.approx(phase.duration, abs=0.0015)
    assert {row["width"] for row in rows if row["phase"] in ("close", "lift")} == {"0.031"}
    assert {row["width"] for row in rows if row["phase"] in ("transfer", "approach")} == {"0.08"}


def test_beside_a_csv_are_units_and_what_it_is_for(plan: Plan, tmp_path: Path) -> None:
    assert plan.origin is not None
    path = written(plan, tmp_path, "csv")
    beside = json.loads(Path(f"{path}-metadata.json").read_text())
    assert beside["url"] == "plan.csv"
    units = {c["titles"]: c.get("schema:unitText") for c in beside["tableSchema"]["columns"]}
    assert list(units) == path.read_text().partition("\n")[0].split(",")
    assert units | {"phase": None} == {
        name: {"t": "s", "w": "m", "q": "rad", "v": "rad/s", "a": "rad/s2", "p": None}[name[0]]
        for name in units
    }
    (notes,) = beside["notes"]
    for name in ("scene", "scene_content", "station", "station_content", "instance"):
        assert notes["origin"][name] == getattr(plan.origin, name)
    assert notes["origin"]["X_WG"] == plan.origin.X_WG.tolist()


def test_a_csv_alone_is_the_motion(plan: Plan, tmp_path: Path) -> None:
    """Without the file beside it all is there but what it is for."""
    path = written(plan, tmp_path, "csv")
    Path(f"{path}-metadata.json").unlink()
    back = load_plan(path)
    assert back.origin is None and (back.opening, back.width) == (plan.opening, plan.width)
    assert back.close_time == pytest.approx(plan.close_time, abs=1e-3)
    assert_same(back.whole, plan.whole)
    scene = load_scene("tabletop_six")
    with pytest.raises(InvalidInputError) as error:
        load_plan(path, scene=scene)
    assert str(error.value) == (
        f"{path} does not say which scene and arm it is for; a CSV plan has this in"
        " NAME.csv-metadata.json next to it"
    )


@pytest.mark.parametrize("suffix", ["json", "csv"])
def test_a_plan_for_another_scene_or_arm_is_refused(
    plan: Plan, tmp_path: Path, suffix: str
) -> None:
    scene, station = load_scene("tabletop_six"), load_station("panda_tabletop")
    other_scene, other_station = load_scene("tabletop_close"), load_station("ur5e_tabletop")
    assert plan.origin is not None
    origin = replace(
        plan.origin,
        scene=scene.name,
        scene_content=scene.content,
        station=station.name,
        station_content=station.content,
    )
    path = written(replace(plan, origin=origin), tmp_path, suffix)
    load_plan(path, scene=scene, station=station)
    moved = replace(scene, document=replace(scene.document, instances=()))
    for here, what in (
        ({"scene": other_scene}, "scene 'tabletop_six'"),
        ({"station": other_station}, "station 'panda_tabletop'"),
        ({"scene": moved}, "scene as it was before a change"),
    ):
        ((kind, document),) = here.items()
        with pytest.raises(InvalidInputError) as error:
            load_plan(path, **here)
        content = getattr(origin, f"{kind}_content")
        assert str(error.value) == (
            f"{path} is for {what} (content {content[:12]}), not for {document.name!r} (content"
            f" {document.content[:12]}); plan its grasp here"
        )


def test_an_unknown_width_is_commanded_as_closed(plan: Plan, tmp_path: Path) -> None:
    replace(plan, width=np.nan).to_csv(tmp_path / "plan.csv")
    last = (tmp_path / "plan.csv").read_text().splitlines()[-1]
    assert last.split(",")[1] == "lift" and last.endswith(",0.0")


@pytest.mark.parametrize("rate", [300.0, 49.0, 333.3, 997.0])
def test_files_keep_the_times_of_other_rates(tmp_path: Path, rate: float) -> None:
    way = replace(DoubleS.of(1.0, 4.0, 80.0).over(np.array([0.9, -0.4])))
    there = Trajectory.of(way, np.zeros(2), np.array([0.9, -0.4]), rate)
    rest = Trajectory.rest(np.array([0.9, -0.4]), 0.7, rate)
    plan = Plan(there, rest, rest, close_time=0.5)
    plan.to_json(tmp_path / "plan.json")
    back = load_plan(tmp_path / "plan.json")
    assert json.loads((tmp_path / "plan.json").read_text())["rate"] == rate
    assert_same(back.whole, plan.whole)
    assert back.duration == plan.duration
    path = written(plan, tmp_path, "csv")
    assert_same(load_plan(path).whole, plan.whole)
    Path(f"{path}-metadata.json").unlink()
    assert_same(load_plan(path).whole, plan.whole)


def test_uneven_samples_are_not_written(plan: Plan, tmp_path: Path) -> None:
    uneven = plan.lift.t.copy()
    uneven[5] += 1e-4
    plan = replace(plan, lift=replace(plan.lift, t=uneven))
    with pytest.raises(InvalidInputError, match=r"^phase 'lift' is not sampled at 1000 Hz"):
        plan.to_json(tmp_path / "plan.json")
    with pytest.raises(InvalidInputError, match=r"^phase 'lift' is not sampled at 1000 Hz"):
        plan.to_csv(tmp_path / "plan.csv")


def test_files_that_are_no_plans(plan: Plan, tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    with pytest.raises(InvalidInputError, match=r"cannot read .*plan\.json: No such file"):
        load_plan(path)
    plan.to_json(path)
    document = json.loads(path.read_text())
    for change, message in (
        ({"format": "else"}, "is not a plan"),
        ({"version": 9}, "has version 9; this release reads 1"),
    ):
        path.write_text(json.dumps(document | change))
        with pytest.raises(InvalidInputError, match=message):
            load_plan(path)
    path.write_text("{")
    with pytest.raises(InvalidInputError, match=r"plan\.json:1: not valid JSON: .*; give a file"):
        load_plan(path)
    with pytest.raises(InvalidInputError, match="cannot write"):
        plan.to_csv(tmp_path)


Damage = Callable[[dict[str, Any]], object]


def points(document: dict[str, Any]) -> list[dict[str, Any]]:
    return document["joint_trajectory"]["points"]


DAMAGES: list[tuple[Damage, str]] = [
    (lambda d: d.pop("rate"), "'rate' is missing or was changed"),
    (lambda d: d.update(rate=0), "'rate' is missing or was changed"),
    (lambda d: d.update(hand=3), "'hand' is missing or was changed"),
    (lambda d: d.update(phases=3), "'phases' is missing or was changed"),
    (lambda d: d.update(phases={}), "phase 'transfer' is missing"),
    (lambda d: d.update(origin=3), "'origin' is missing or was changed"),
    (lambda d: d["origin"].update(foo=3), "'origin' is missing or was changed"),
    (lambda d: d["origin"].update(limits=3), "'origin' is missing or was changed"),
    (
        lambda d: d["origin"]["limits"].update(lower=[float("nan"), -3.0]),
        "position limits of an arm are [nan, -3.0] to [3.0, 3.0]; give a lower and a higher number"
        " for each joint",
    ),
    (
        lambda d: d["origin"]["limits"].update(torque=[-1.0, 1.0]),
        "torque limits of an arm are [-1.0, 1.0]; each must be at least 0, or inf",
    ),
    (
        lambda d: d["origin"]["limits"].update(torque=[1.0]),
        "origin has limits for another number of joints than the 2 of the plan",
    ),
    (lambda d: d["hand"].update(opening=-0.1), "'hand' is missing or was changed"),
    (
        lambda d: points(d).reverse(),
        "point 0 is at 4.4 s; with 1000 samples per second it must be at 0 s",
    ),
    (
        lambda d: points(d)[7]["time_from_start"].update(nanosec=7_000_002),
        "point 7 is at 0.007000002 s; with 1000 samples per second it must be at 0.007 s",
    ),
    (
        lambda d: d.update(rate=500),
        "point 1 is at 0.001 s; with 500 samples per second it must be at 0.002 s",
    ),
    (
        lambda d: points(d)[7].update(velocities=[0.0]),
        "velocities of point 7 must be 2 finite numbers",
    ),
    (
        lambda d: points(d)[7].update(positions=[0.0, "x"]),
        "'joint_trajectory' is missing or was changed",
    ),
    (
        lambda d: points(d)[7].update(positions=[0.0, 50.0]),
        "point 7 has joint 'b' at 50.0000, outside its limits -3.0000 to 3.0000",
    ),
    (
        lambda d: points(d)[7]["positions"].__setitem__(0, 0.5),
        "the velocity of joint 'a' reaches 500, above its limit of 1",
    ),
    (
        lambda d: points(d)[7]["accelerations"].__setitem__(1, -4.5),
        "the acceleration of joint 'b' reaches 4.5, above its limit of 4",
    ),
    (
        lambda d: points(d)[-1]["velocities"].__setitem__(1, -1e-3),
        "the arm is not at rest at the ends of phase 'lift'",
    ),
    (
        lambda d: d["hand"].update(close_time=99.0),
        "phase 'close' takes 0.5 s, but the hand closes for 99 s",
    ),
    (
        lambda d: points(d)[d["phases"]["close"][0] + 1]["positions"].__setitem__(1, 0.2001),
        "the arm moves in phase 'close'",
    ),
]


@pytest.mark.parametrize(("damage", "what"), DAMAGES, ids=[what for _, what in DAMAGES])
def test_a_damaged_plan_is_refused(plan: Plan, tmp_path: Path, damage: Damage, what: str) -> None:
    path = tmp_path / "plan.json"
    plan.to_json(path)
    document = json.loads(path.read_text())
    damage(document)
    path.write_text(json.dumps(document))
    with pytest.raises(InvalidInputError) as error:
        load_plan(path)
    assert str(error.value) == f"{path}: the plan is damaged: {what}; write it again"


CSV_DAMAGES: list[tuple[int, str, str, str]] = [
    (0, "t,phase", "phase,t", ""),
    (7, ",transfer,", ",transfr,", "line 9 has phase 'transfr'; expected one of"),
    (7, ",transfer,", ",lift,", "phase 'transfer' starts a second time in line 10"),
    (7, ",transfer,", ",transfer,,", "line 9 has 10 cells; expected 9"),
    (7, ",transfer,", ",transfer,nan", "q_a in line 9 is 'nan"),
    (7, "0.007,", "0.0071,", "point 7 is at 0.0071 s; with 1000 samples per"),
    (7, "0.007,", "soon,", "t in line 9 is 'soon', which is not a number"),
    (7, ",transfer,", ",transfer,5", "point 7 has joint 'a' at 50."),
    (7, ",0.08", ",0.09", "width in line 9 is '0.09'; in phase 'transfer' of this plan"),
    (7, ",0.08", ",wide", "width in line 9 is 'wide', which is not a number"),
]
"""Line, what stands there, what takes its place, and what is said."""


@pytest.mark.parametrize(("line", "old", "new", "what"), CSV_DAMAGES)
def test_a_damaged_csv_is_refused(
    plan: Plan, tmp_path: Path, line: int, old: str, new: str, what: str
) -> None:
    path = written(plan, tmp_path, "csv")
    lines = path.read_text().splitlines()
    assert old in lines[line + (line > 0)]
    lines[line + (line > 0)] = lines[line + (line > 0)].replace(old, new, 1)
    path.write_text("\n".join(lines))
    with pytest.raises(InvalidInputError) as error:
        load_plan(path)
    text = str(error.value)
    expected = f"{path}: the plan is damaged: {what}" if what else f"{path} is not a plan"
    assert text.startswith(expected)
    assert "\n" not in text


def test_a_damaged_file_beside_a_csv_is_named(plan: Plan, tmp_path: Path) -> None:
    path = written(plan, tmp_path, "csv")
    beside = Path(f"{path}-metadata.json")
    text = beside.read_text()
    for old, new, message in (
        ('"notes"', '"note"', "does not describe a plan; write the plan again"),
        ("q_a", "q_c", "describes a table with other columns; write the plan again"),
        ("burg_drake plan", "plan", "is not a plan: its format is not 'burg_drake plan'"),
        ("{", "", "not valid JSON"),
    ):
        beside.write_text(text.replace(old, new))
        with pytest.raises(InvalidInputError, match=f"^{beside}.*{message}"):
            load_plan(path)


def test_phases_cover_all_points(plan: Plan, tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    plan.to_json(path)
    document = json.loads(path.read_text())
    (_, end), (_, last) = document["phases"]["close"], document["phases"]["lift"]
    for damaged, wanted in (
        ([end, last - 3], f"{end} to {last - 3}"),
        ([end + 1, last], f"{end + 1} to {last}"),
        ([end, last + 1], f"{end} to {last + 1}"),
    ):
        path.write_text(json.dumps(document | {"phases": document["phases"] | {"lift": damaged}}))
        with pytest.raises(InvalidInputError) as error:
            load_plan(path)
        assert str(error.value) == (
            f"{path}: the plan is damaged: phase 'lift' has points {wanted}; it must go from"
            f" point {end} to the last one, {last}; write it again"
        )
