"""Grasps whose verdict the oracle alone has found: hard ones, and others.

    python -m oracle.cases [--each N] [--strangers]   (in the folder above) searches, and writes

Hard cases are lifted or not for a change of friction by 0.7, but not of 3 %. A case is one where a
method can be wrong, as it is near the limit, and one that has an answer, as it is not at the limit.
Ordinary ones have random friction and mass, and an answer, too. The lists are frozen, and searched
anew only when the objects change: hard_cases.json has hard ones of the catalogue, and
stranger_cases.json as many hard as ordinary ones of objects that nothing was tuned on.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from .arrays import Array, pose
from .catalogue import HELD_OUT, SPACING, TUNED, Thing, thing
from .grasps import draw_grasps
from .hand import DEFAULT_PHASES, GRAVITY
from .strangers import HELD_OUT_STRANGERS, STRANGERS
from .trial import DEFAULT_NUMERICS, Grip, Numerics, Trial, Verdict

HARD_CASES = Path(__file__).with_name("hard_cases.json")
STRANGER_CASES = Path(__file__).with_name("stranger_cases.json")
HARD, ORDINARY = "hard", "ordinary"
FACTOR = 0.7
"""A change of friction by which the verdict of a hard case changes, down or up."""
MARGIN = 0.03
"""A change of friction by which it does not."""
FRICTIONS = (0.015, 1.3)
MASSES = (0.25, 1.5)
"""Drawn from evenly in the logarithm [kg]."""
TABLE = 0.5
"""Friction of the table."""
ROUGH = 8e-4
"""Spacing of samples while the limit is looked for [m]."""
STEPS = 6
"""Changes of friction by FACTOR in the search for the limit."""
LEVER = 0.04
"""In the first guess a load with this lever [m] about the closing axis counts twice."""


@dataclass(frozen=True)
class Case:
    """A grasp to try.

    Attributes:
        id: object, pose and number.
        object: its name.
        pose: number of the pose in which it rests.
        X_OG: the grasp, the first three rows of a (4, 4) matrix.
        friction: of pads and object, and what its surface brings along to the table.
        mass: [kg].
        lifted, slip, tilt: by the oracle [m, rad].
    """

    id: str
    object: str
    pose: int
    X_OG: tuple[tuple[float, ...], ...]
    friction: float
    mass: float
    lifted: bool = False
    slip: float = 0.0
    tilt: float = 0.0

    @property
    def matrix(self) -> Array:
        """(4, 4) X_OG."""
        rows = np.array(self.X_OG)
        return pose(rows[:, :3], rows[:, 3])

    @property
    def held_out(self) -> bool:
        """Whether nothing may be tuned on the object."""
        return self.object in HELD_OUT or self.object in HELD_OUT_STRANGERS

    @property
    def is_hard(self) -> bool:
        """Whether it is near the limit by the oracle."""
        return self.id.rpartition("/")[2].startswith(HARD)


def judge(
    case: Case, factor: float = 1.0, numerics: Numerics = DEFAULT_NUMERICS, spacing: float = SPACING
) -> Verdict:
    """The oracle's verdict on a case.

    Args:
        case: the case.
        factor: to its friction.
        numerics, spacing: of the computation.
    """
    friction = factor * case.friction
    found = thing(case.object, spacing)
    grip = Grip(
        solid=found.solid,
        feet=found.feet,
        mass_properties=found.mass_properties,
        X_WO=found.X_WO(case.pose),
        X_OG=case.matrix,
        friction=friction,
        table_friction=2.0 * friction * TABLE / (friction + TABLE),
        mass=case.mass,
    )
    return Trial(grip, numerics).run()


def load_cases(path: Path = HARD_CASES) -> list[Case]:
    """The frozen list."""
    rows = json.loads(path.read_text(encoding="utf-8"))
    return [Case(**{**row, "X_OG": tuple(tuple(line) for line in row["X_OG"])}) for row in rows]


def save_cases(cases: list[Case], path: Path = HARD_CASES) -> None:
    """Writes a list, one case a paragraph."""
    rows = [json.dumps(asdict(case)).replace('"friction"', '\n  "friction"') for case in cases]
    path.write_text("[\n" + ",\n".join(rows) + "\n]\n", encoding="utf-8")


def draw_cases(name: str, seed: str) -> Iterator[Case]:
    """Grasps of an object with random mass and friction, from half to twice a rough
    guess of what holds it."""
    found = thing(name)
    words = [ord(c) for c in f"{seed}/{name}"]
    rng = np.random.default_rng(words)
    sources = [draw_grasps(found, k, rng) for k in range(len(found.poses))]
    number = 0
    while sources:
        k = number % len(sources)
        X_OG = next(sources[k], None)
        if X_OG is None:
            del sources[k]
            continue
        mass = float(np.round(np.exp(rng.uniform(*np.log(MASSES))), 3))
        guess = _guess(found, found.X_WO(k), X_OG, mass)
        friction = float(np.round(np.clip(guess * np.exp(rng.uniform(-0.5, 0.7)), *FRICTIONS), 4))
        rows = tuple(tuple(row) for row in np.round(X_OG[:3], 12).tolist())
        yield Case(f"{name}/{k}/{seed}{number}", name, k, rows, friction, mass)
        number += 1


def _guess(found: Thing, X_WO: Array, X_OG: Array, mass: float) -> float:
    """Friction that holds the load of the lift, by weight and moment about the closing axis."""
    X_WG = X_WO @ X_OG
    arm = X_WO[:3, :3] @ found.mass_properties.center + X_WO[:3, 3] - X_WG[:3, 3]
    lever = abs(float(np.cross(arm, (0.0, 0.0, -1.0)) @ X_WG[:3, 0]))
    phases = DEFAULT_PHASES
    load = mass * (GRAVITY + 4.0 * phases.lift / phases.lift_time**2)
    return load / (2.0 * phases.force) * float(np.hypot(1.0, lever / LEVER))


def hardened(case: Case) -> Case | None:
    """The case with its friction moved to where it is hard; None if it is not found or marginal."""
    verdict = judge(case, spacing=ROUGH)
    if verdict.fouled:
        return None
    towards = FACTOR if verdict.lifted else 1.0 / FACTOR
    for _ in range(STEPS):
        friction = round(case.friction * towards, 4)
        if not FRICTIONS[0] <= friction <= FRICTIONS[1]:
            return None
        following = with_friction(case, friction)
        found = judge(following, spacing=ROUGH)
        if found.fouled:
            return None
        if found.lifted != verdict.lifted:
            # Both sides of the limit are hard; which one is taken depends on the case alone.
            pair = (case, following)
            return _settled(*(pair if int(1e3 * case.mass) % 2 else pair[::-1]))
        case, verdict = following, found
    return None


def _settled(case: Case, other: Case) -> Case | None:
    """The case with its verdict, if that stands small changes of friction and not the other's."""
    found = answered(case)
    return None if found is None or judge(other).lifted == found.lifted else found


def answered(case: Case) -> Case | None:
    """The case with its verdict, if that stands small changes of friction."""
    verdict = judge(case)
    if verdict.fouled:
        return None
    for factor in (1.0 - MARGIN, 1.0 + MARGIN):
        found = judge(case, factor)
        if found.fouled or found.lifted != verdict.lifted:
            return None
    slip, tilt = (round(v, 6) if np.isfinite(v) else -1.0 for v in (verdict.slip, verdict.tilt))
    return with_friction(case, case.friction, lifted=verdict.lifted, slip=slip, tilt=tilt)


def with_friction(case: Case, friction: float, **changes: object) -> Case:
    """A case with another friction."""
    return Case(**{**asdict(case), "friction": friction, **changes})


def find(name: str, each: int, seed: str) -> list[Case]:
    """Cases of an object, so many if there are.

    Args:
        name: the object.
        each: number of cases.
        seed: HARD or ORDINARY.
    """
    settle = hardened if seed == HARD else answered
    found = (case for case in map(settle, draw_cases(name, seed)) if case is not None)
    return list(islice(found, each))


def search(names: Sequence[str], seeds: Sequence[str], each: int, path: Path) -> None:
    """Writes cases of objects, so many of each and each seed, as they are found."""
    cases: list[Case] = []
    with ProcessPoolExecutor(2) as pool:
        jobs = [pool.submit(find, name, each, seed) for name in names for seed in seeds]
        for job in jobs:
            cases += job.result()
            save_cases(cases, path)
            print(f"{cases[-1].id}: {len(cases)} cases", flush=True)


def main() -> None:
    """Searches and writes the list."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=4, help="cases of an object")
    parser.add_argument("--strangers", action="store_true", help="of the other objects")
    parser.add_argument("-o", "--output", type=Path)
    arguments = parser.parse_args()
    if arguments.strangers:
        found: tuple[Sequence[str], Sequence[str], Path] = (
            tuple(STRANGERS), (HARD, ORDINARY), STRANGER_CASES,
        )  # fmt: skip
    else:
        found = ((*TUNED, *HELD_OUT), (HARD,), HARD_CASES)
    names, seeds, path = found
    search(names, seeds, arguments.each, arguments.output or path)


if __name__ == "__main__":
    main()
