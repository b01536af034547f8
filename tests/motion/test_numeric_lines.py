"""The numeric search for chains against closed forms: the Panda's, and one of the UR5e that a user
might bring along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import ur_ik

from burg_drake.core import InvalidInputError, Outcome, inverse, swap_fingers
from burg_drake.motion import (
    ArmKinematics,
    ArmProximity,
    Chain,
    ClosedFormLineSearch,
    HandPath,
    IkRoutine,
    LineSearch,
    NumericLineSearch,
    PandaIk,
    ReachSettings,
    RoutineSolutions,
)
from burg_drake.scene import load_scene
from burg_drake.station import GraspMotion, build_station_diagram, load_station

SETTINGS = ReachSettings()
MOTION = GraspMotion()
CLEARANCE = 2e-3
"""Of the hand on its way [m]; lets it be beside the straight segment by half of it, but by no more
than `SETTINGS.deviation[1]`."""


class Arm:
    """An arm in a scene of six objects."""

    def __init__(self, station: str) -> None:
        self.scene, self.station = load_scene("tabletop_six"), load_station(station)
        self.diagram = build_station_diagram(
            self.scene, self.station, robot="arm", weld_objects=True
        )
        document = self.station.document.arm
        assert document is not None
        self.X_WA, self.X_FH = document.X_WA.matrix(), document.X_FH.matrix()
        self.X_HG = self.station.hand.X_HG.matrix()
        self.home = np.array(document.home)
        self.kinematics = ArmKinematics.of(self.diagram)
        self.hand_path = HandPath.of(self.X_HG, self.X_WA[:3, :3], MOTION)
        self.proximity = ArmProximity(self.diagram)

    def numeric(self, kinematics: ArmKinematics | None = None) -> NumericLineSearch:
        """The search."""
        return NumericLineSearch(
            kinematics or self.kinematics, self.hand_path, self.proximity, self.home, SETTINGS
        )

    def by_routine(self, routine: IkRoutine) -> NumericLineSearch:
        """The search with an inverse kinematics that somebody brought along."""
        solutions, beyond = (
            RoutineSolutions(self.kinematics, routine, SETTINGS.limit_margin, limited=limited)
            for limited in (True, False)
        )
        return NumericLineSearch(
            self.kinematics,
            self.hand_path,
            self.proximity,
            self.home,
            SETTINGS,
            solutions=solutions,
            unlimited_solutions=beyond,
        )

    def X_AG(self, X_WG: np.ndarray) -> np.ndarray:
        """Grasps (N, 2, 4, 4) in the arm's base frame, fingers either way."""
        X_AG = inverse(self.X_WA) @ X_WG
        return np.stack([X_AG, swap_fingers(X_AG)], axis=1)

    def grasps(self, count: int, seed: int, spread: float = 0.03) -> np.ndarray:
        """Grasps (N, 4, 4) in the world over the objects, up to a radian from straight down."""
        rng = np.random.default_rng(seed)
        names = list(self.scene.instances)
        found = []
        for i in range(count):
            p = self.diagram.X_WO(names[i % len(names)])[:3, 3]
            found.append(grasp(p + rng.uniform(-spread, spread, 3) + [0.0, 0.0, 0.06], rng))
        return np.array(found)


def grasp(p: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A grasp (4, 4) at a point, turned at random."""
    tilt, heading = rng.uniform(0.0, 1.0), rng.uniform(0.0, 2 * np.pi)
    s = np.sin(tilt)
    z = np.array([s * np.cos(heading), s * np.sin(heading), -np.cos(tilt)])
    x = np.cross(z, rng.normal(size=3))
    x /= np.linalg.norm(x)
    X = np.eye(4)
    X[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    X[:3, 3] = p
    return X


@pytest.fixture(scope="module")
def ur5e() -> Arm:
    return Arm("ur5e_tabletop")


@pytest.fixture(scope="module")
def panda() -> Arm:
    return Arm("panda_tabletop")


def ur_routine(arm: Arm) -> IkRoutine:
    """The closed form for the hand of a station."""
    X_HF = inverse(arm.X_FH)
    return lambda X_AH: [ur_ik.solve(X @ X_HF) for X in X_AH]


def outcomes(search: LineSearch, X_AG: np.ndarray) -> list[Outcome | None]:
    """Why there is no chain; None where there is one."""
    batch = search.begin(X_AG, np.full((len(X_AG), 2), CLEARANCE))
    chains = batch.propose(range(len(X_AG)))
    return [None if c is not None else batch.failure(g).outcome for g, c in enumerate(chains)]


@pytest.mark.parametrize("station", ["ur5e", "panda"])
def test_the_hand_goes_straight(station: str, request: pytest.FixtureRequest) -> None:
    arm: Arm = request.getfixturevalue(station)
    X_AG = arm.X_AG(arm.grasps(8, seed=7))
    chains = arm.numeric().begin(X_AG, np.full((8, 2), CLEARANCE)).propose(range(8))
    found = [(X[c.flip], c) for X, c in zip(X_AG, chains, strict=True) if c is not None]
    assert len(found) >= 5
    for X, chain in found:
        check_straight(arm, X, chain)


def check_straight(arm: Arm, X_AG: np.ndarray, chain: Chain) -> None:
    """Rows, and what lies half-way between them, against where the hand should be."""
    q, at = chain.q, chain.at_grasp
    margin = SETTINGS.limit_margin - 1e-12
    assert (q >= arm.kinematics.lower + margin).all() and (q <= arm.kinematics.upper - margin).all()
    assert np.abs(np.diff(q, axis=0)).max() < 0.35
    way = np.linspace(0.0, 1.0, 3)[:, None, None]
    dense = np.concatenate([(1.0 - way) * q[:-1] + way * q[1:]]).reshape(-1, q.shape[1])
    X = arm.kinematics.forward(np.concatenate([q, dense]))[0] @ arm.X_HG
    p = X[:, :3, 3] - X_AG[:3, 3]
    approach, up = X_AG[:3, 2], inverse(arm.X_WA)[:3, 2]
    np.testing.assert_allclose(p[0], -MOTION.standoff * approach, atol=1e-5)
    np.testing.assert_allclose(p[at], 0.0, atol=1e-5)
    np.testing.assert_allclose(p[len(q) - 1], MOTION.lift_height * up, atol=1e-5)
    np.testing.assert_allclose(chain.moved_W[at:, 2], p[at : len(q)] @ up, atol=1e-5)
    assert (chain.moved_W[: at + 1] == 0.0).all()
    off = [
        np.linalg.norm(p - np.clip(p @ axis, low, high)[:, None] * axis, axis=1)
        for axis, low, high in (
            (approach, -MOTION.standoff, 0.0),
            (up, 0.0, MOTION.lift_height),
        )
    ]
    allowed = min(0.5 * CLEARANCE, SETTINGS.deviation[1])
    assert np.minimum(*off).max() < allowed + 1e-5
    turned = np.abs(X[:, :3, :3] - X_AG[:3, :3]).max()
    assert turned < allowed / 0.2 + 1e-5  # finger tips are less than 0.2 m from the hand's origin


def test_verdicts_are_those_of_the_closed_form(panda: Arm) -> None:
    """The redundant joint is sampled in one and swept in the other, so that the last of what is
    barely possible may be found by either."""
    X_AG = panda.X_AG(panda.grasps(24, seed=2))
    ik = PandaIk.of(panda.kinematics)
    assert ik is not None
    ik = ik.within(SETTINGS.limit_margin)
    swept = ClosedFormLineSearch(
        panda.kinematics, ik, panda.hand_path, panda.proximity, panda.home, SETTINGS
    )
    expected, found = outcomes(swept, X_AG), outcomes(panda.numeric(), X_AG)
    assert sum(a == b for a, b in zip(expected, found, strict=True)) >= 23
    assert expected.count(None) >= 10 and len(set(expected)) >= 2


def test_panda_as_if_it_were_foreign(panda: Arm) -> None:
    """The closed form as a user's routine: the same verdicts as with numeric starts."""
    ik = PandaIk.of(panda.kinematics)
    assert ik is not None
    values = np.linspace(ik.lower[6] + 0.02, ik.upper[6] - 0.02, 32)

    def routine(X_AH: np.ndarray) -> list[np.ndarray]:
        found = ik.solve(X_AH, values)
        return [found.q[found.pose == k] for k in range(len(X_AH))]

    X_AG = panda.X_AG(panda.grasps(12, seed=3))
    expected, found = outcomes(panda.numeric(), X_AG), outcomes(panda.by_routine(routine), X_AG)
    assert found == expected


def test_ur5e_with_a_routine_of_its_own(ur5e: Arm) -> None:
    """Six joints have finitely many postures, and the closed form knows all of them."""
    X_AG = ur5e.X_AG(ur5e.grasps(24, seed=4, spread=0.25))
    expected = outcomes(ur5e.by_routine(ur_routine(ur5e)), X_AG)
    assert outcomes(ur5e.numeric(), X_AG) == expected
    assert expected.count(None) >= 5 and len(set(expected)) >= 3


def test_numeric_starts_find_what_there_is(ur5e: Arm) -> None:
    rng = np.random.default_rng(5)
    q = rng.uniform(-np.pi, np.pi, (40, 6))
    X_AH = ur5e.kinematics.forward(q)[0]
    solutions = ur5e.numeric().solutions
    rounds = [solutions.solve(X_AH, turn) for turn in range(2)]
    pose, found = (np.concatenate(part) for part in zip(*rounds, strict=True))
    every, missed = 0, 0
    for k, expected in enumerate(ur_routine(ur5e)(X_AH)):
        for one in expected[np.abs(expected[:, 2]) < np.pi - 0.02]:
            away = np.abs((found[pose == k] - one + np.pi) % (2 * np.pi) - np.pi)
            missed += bool(away.max(axis=1, initial=0.0).min(initial=1.0) > 1e-4)
            every += 1
    assert every > 200 and missed <= 0.02 * every


def test_a_verdict_does_not_depend_on_the_batch(ur5e: Arm) -> None:
    X_AG = ur5e.X_AG(ur5e.grasps(6, seed=6, spread=0.2))
    search = ur5e.numeric()
    together = search.begin(X_AG, np.full((6, 2), CLEARANCE)).propose(range(6))
    for k, chain in enumerate(together):
        (alone,) = search.begin(X_AG[k : k + 1], np.full((1, 2), CLEARANCE)).propose([0])
        assert (chain is None) == (alone is None)
        if chain is not None and alone is not None:
            np.testing.assert_array_equal(chain.q, alone.q)
            assert chain.flip == alone.flip


def test_out_of_reach(ur5e: Arm) -> None:
    X_WG = grasp(np.array([1.2, 0.0, 0.3]), np.random.default_rng(0))
    batch = ur5e.numeric().begin(ur5e.X_AG(X_WG[None]), np.full((1, 2), CLEARANCE))
    assert batch.propose([0]) == [None]
    failure = batch.failure(0)
    assert failure.outcome is Outcome.NO_IK and np.isnan(failure.excess)


def test_beyond_a_joint_limit(ur5e: Arm) -> None:
    """The elbow is allowed too little: the closed form says by how much, at the grasp."""
    X_AG = ur5e.X_AG(ur5e.grasps(1, seed=8))
    upper = np.where(np.arange(6) == 2, 0.05, 2 * np.pi)
    tight = replace(ur5e.kinematics, lower=-upper, upper=upper)
    batch = ur5e.numeric(tight).begin(X_AG, np.full((1, 2), CLEARANCE))
    assert batch.propose([0]) == [None]
    failure = batch.failure(0)
    assert failure.outcome is Outcome.JOINT_LIMIT
    X_AF = X_AG[0] @ inverse(ur5e.X_HG) @ inverse(ur5e.X_FH)
    elbow = np.abs(np.concatenate([ur_ik.solve(X)[:, 2] for X in X_AF])).min()
    assert failure.excess == pytest.approx(elbow - 0.05 + SETTINGS.limit_margin, abs=1e-5)


def test_what_is_in_the_way_is_in_the_way(ur5e: Arm) -> None:
    """A grasp behind the base, where the arm stands on the table itself."""
    rng = np.random.default_rng(9)
    X_WG = np.array([grasp(np.array([0.05, 0.1, 0.02]), rng) for _ in range(6)])
    batch = ur5e.numeric().begin(ur5e.X_AG(X_WG), np.full((6, 2), CLEARANCE))
    none = [g for g, chain in enumerate(batch.propose(range(6))) if chain is None]
    named = [batch.failure(g) for g in none]
    blocked = [f for f in named if f.outcome is Outcome.ARM_COLLISION]
    assert blocked
    for failure in blocked:
        assert 1 <= len(failure.q) == len(failure.moved_W) <= 3
        assert (ur5e.proximity.bounds(failure.q, hand=False).upper <= 0.0).all()


@pytest.mark.parametrize(
    ("row", "outcome"),
    [
        (lambda chain: chain.at_grasp, Outcome.ARM_COLLISION),
        (lambda chain: chain.at_grasp // 2, Outcome.APPROACH_LINE),
        (lambda chain: len(chain.q) - 2, Outcome.LIFT_LINE),
    ],
)
def test_refused_chains_are_not_proposed_again(ur5e: Arm, row, outcome: Outcome) -> None:  # type: ignore[no-untyped-def]
    batch = ur5e.numeric().begin(ur5e.X_AG(ur5e.grasps(1, seed=0)), np.full((1, 2), CLEARANCE))
    seen: list[np.ndarray] = []
    while (chain := batch.propose([0])[0]) is not None:
        start = chain.q[chain.at_grasp]
        assert all(np.abs(start - other).max() > 0.01 for other in seen)
        seen.append(start)
        batch.refuse(0, chain, row(chain))
    assert len(seen) >= 2
    failure = batch.failure(0)
    assert failure.outcome is outcome and 1 <= len(failure.q) <= 3


def test_a_start_that_is_not_reached_is_left_out(ur5e: Arm) -> None:
    batch = ur5e.numeric().begin(ur5e.X_AG(ur5e.grasps(1, seed=0)), np.full((1, 2), CLEARANCE))
    first = batch.propose([0])[0]
    assert first is not None and batch.propose([0])[0].q is not first.q  # type: ignore[union-attr]
    batch.refuse(0, first, None)
    second = batch.propose([0])[0]
    assert second is not None and np.abs(second.q[0] - first.q[0]).max() > 0.01


def test_routines_that_do_not_fit_are_named(ur5e: Arm) -> None:
    X_AH = ur5e.kinematics.forward(np.array([[0.1, -1.0, 1.5, -1.8, -1.5, 0.2]]))[0]

    def solve(routine: IkRoutine) -> np.ndarray:
        return RoutineSolutions(ur5e.kinematics, routine, 0.01).solve(X_AH, 0)[1]

    assert len(solve(ur_routine(ur5e))) == 8
    with pytest.raises(
        InvalidInputError, match=r"0\.0100 m and 0\.00 degrees from the requested pose"
    ):
        solve(lambda X: [ur_ik.solve(one) for one in X])  # for the flange, not for the hand
    with pytest.raises(InvalidInputError, match=r"expected 1 arrays of shape \(S, 6\)"):
        solve(lambda X: [np.zeros((3, 7))])
    with pytest.raises(InvalidInputError, match=r"returned arrays of shapes .* for 1 poses"):
        solve(lambda X: [])
    with pytest.raises(InvalidInputError, match="not finite"):
        solve(lambda X: [np.full((1, 6), np.nan)])


def test_whole_turns_and_small_deviations_do_not_matter(ur5e: Arm) -> None:
    X_AH = ur5e.kinematics.forward(np.array([[0.1, -1.0, 1.5, -1.8, -1.5, 0.2]]))[0]
    exact = ur_routine(ur5e)

    def sloppy(X: np.ndarray) -> list[np.ndarray]:
        return [q + 4 * np.pi + 5e-4 for q in exact(X)]

    pose, q = RoutineSolutions(ur5e.kinematics, sloppy, 0.01).solve(X_AH, 0)
    assert len(q) == 8 and (pose == 0).all() and np.abs(q).max() <= np.pi + 0.01
    reached = ur5e.kinematics.forward(q)[0]
    np.testing.assert_allclose(reached, np.broadcast_to(X_AH, reached.shape), atol=2e-6)
