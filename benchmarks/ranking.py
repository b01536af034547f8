"""How well metrics of grasps tell what a trial lifts from what it does not.

    python benchmarks/ranking.py [SCENE] [--station S] [-n 200] [--mass 1 4] [--seed 0]

Samples grasps on every object of a scene at which the open hand is clear, scores them, and executes
them with the engine for screening, with the object's mass and with multiples of it. The area under
the ROC curve is the chance that a lifted grasp has a better score than another one, of equal scores
half; NaN, where a pad meets nothing, is the worst. `all` is of all pairs, `alike` only of those on
the same object. Intervals are of 95 %, by bootstrap on the grasps of each object.
Lifted is what is held at the end, whether or not other objects were moved.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

import burg_drake as burg
from burg_drake.core import Array, GraspSet, Outcome
from burg_drake.evaluation import INSTANCE_COLUMN, SamplingSettings, sample_grasps, scored_set
from burg_drake.grasping import METRICS, score_of
from burg_drake.scene import Scene
from burg_drake.station import Station, as_engine

SAMPLER = "sampler's score"
RESAMPLED = 1000
"""Bootstrap samples of an interval."""


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", default="tabletop_six")
    parser.add_argument("--station", default="panda_tabletop")
    parser.add_argument("-n", type=int, default=200, help="grasps on each object")
    parser.add_argument("--mass", type=float, nargs="+", default=[1.0, 4.0], help="multiples")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    scene, station = burg.load_scene(arguments.scene), burg.load_station(arguments.station)
    settings = SamplingSettings()
    grasps = sample_grasps(scene, station, arguments.n, seed=arguments.seed, settings=settings)
    scored = scored_set(grasps, scene.library, station, scene)
    scores = {SAMPLER: grasps.score}
    scores |= {name: score_of(scored.column(name), name) for name in METRICS}
    for factor in arguments.mass:
        start = time.process_time()
        outcomes = execute(grasps, scene, station, factor)
        judged = outcomes != Outcome.SIMULATION_FAILED
        held = np.array([Outcome(outcome).held for outcome in outcomes.tolist()])[judged]
        on = grasps.column(INSTANCE_COLUMN)[judged]
        seconds = time.process_time() - start
        print(f"{factor:g} times the mass: {len(held)} trials in {seconds:.0f} s")
        for name in dict.fromkeys(on.tolist()):
            mine = on == name
            print(f"  {name:22}{held[mine].sum():6} lifted{(~held[mine]).sum():6} not")
        print(f"  {'all':22}{held.sum():6} lifted{(~held).sum():6} not")
        print_areas({name: values[judged] for name, values in scores.items()}, held, on)


def execute(grasps: GraspSet, scene: Scene, station: Station, factor: float) -> NDArray[np.str_]:
    """Outcomes (N,) with so many times the mass."""
    trial = burg.HandTrial(scene, station, engine=as_engine("screening"))
    outcomes = []
    for name, X_OG in zip(grasps.column(INSTANCE_COLUMN).tolist(), grasps.X_OG, strict=True):
        mass = factor * scene.entry(name).mass_properties.mass
        outcomes.append(trial.run(name, X_OG, mass=mass).outcome.value)
    return np.array(outcomes)


def print_areas(scores: dict[str, Array], held: NDArray[np.bool_], on: NDArray[np.str_]) -> None:
    """Prints the areas of each score; `on` (N,) are the instances."""
    instances = [np.flatnonzero(on == name) for name in np.unique(on)]
    print(f"  {'area under the curve':22}{'all':>24}{'alike':>24}")
    for name, values in scores.items():
        values = np.where(np.isnan(values), -np.inf, values)
        rng = np.random.default_rng(0)
        areas = []
        for k in range(1 + RESAMPLED):  # the first one is of the grasps themselves
            groups = [i if k == 0 else rng.choice(i, len(i)) for i in instances]
            areas.append((area(values, held, [np.concatenate(groups)]), area(values, held, groups)))
        low, high = np.nanquantile(areas[1:], (0.025, 0.975), axis=0)
        cells = (
            f"{a:.3f} ({b:.3f} to {c:.3f})" for a, b, c in zip(areas[0], low, high, strict=True)
        )
        print(f"  {name:22}" + "".join(f"{cell:>24}" for cell in cells), flush=True)


def area(values: Array, held: NDArray[np.bool_], groups: list[NDArray[np.intp]]) -> float:
    """Share of the pairs of a lifted grasp and another one, within groups, that are in order."""
    ordered = pairs = 0.0
    for group in groups:
        good = held[group]
        lifted = int(good.sum())
        ordered += rankdata(values[group])[good].sum() - 0.5 * lifted * (lifted + 1)
        pairs += lifted * (len(group) - lifted)
    return ordered / pairs if pairs else np.nan


if __name__ == "__main__":
    main()
