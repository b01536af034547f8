"""Which figures of a lifted grasp tell how often it is lifted with noise, and what `--best` picks.

    python benchmarks/best.py [SCENE ...] --records FILE [-n 40] [--cpu SECONDS] [--seed 0]
        [--scans FOLDER]

Samples clear grasps on every object of the scenes, executes them, and repeats those that are lifted
20 times with the default perturbations of `burg-drake robustness` (pose, mass, friction), which
takes 2 to 4 s of CPU time a grasp. Every answer is appended to FILE at once; what it holds is not
measured again, and `--cpu` bounds what is added. Margins are those of the engine `standard`;
repeats are stepped by `screening`, which costs half.

`--scans` adds a scene of the YCB scans in a folder (`scans/masses.yaml` names them), whose library
is built beside the records first.

Prints for each figure the rank correlation (Spearman) with the share of repeats that are lifted,
among the grasps of one object, and its mean over objects; then what share the five best of an
object have by each rule, next to any five and to the five that are best.
"""

from __future__ import annotations

import argparse
import json
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import rankdata

import burg_drake as burg
from burg_drake.apps import main as burg_drake
from burg_drake.core import Array, Outcome
from burg_drake.evaluation import (
    INSTANCE_COLUMN,
    SamplingSettings,
    best_rows,
    sample_grasps,
    scored_set,
)
from burg_drake.grasping import METRICS
from burg_drake.simulation import success_rate
from burg_drake.station import as_engine

REPEATS, PICKED = 20, 5
SMALLER_IS_BETTER = (
    *("slip", "tilt", "others_moved", "end_time"),
    *("friction_needed", "antipodal_angle", "slide", "contact_offset"),
)
ROW_MARGINS = (
    *("clearance", "slip", "tilt", "pad_force", "patch_area", "lift"),
    *("others_moved", "end_time"),
)


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=["tabletop_six"], metavar="SCENE")
    parser.add_argument("--station", default="panda_tabletop")
    parser.add_argument("--scans", type=Path, metavar="FOLDER", help="of YCB scans (.obj)")
    parser.add_argument("--records", type=Path, required=True, help="answers, one JSON line each")
    parser.add_argument("-n", type=int, default=40, help="lifted grasps on each object")
    parser.add_argument("--cpu", type=float, default=0.0, help="seconds that may be added")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    if arguments.scans:
        arguments.scenes.append(scan_scene(arguments.scans, arguments.records.parent / "scans"))
    known = read_records(arguments.records)
    if arguments.cpu:
        collect(arguments, {(r["scene"], r["id"]) for r in known})
        known = read_records(arguments.records)
    for scene in dict.fromkeys(record["scene"] for record in known):
        records = [record for record in known if record["scene"] == scene]
        print(f"\n{scene}: {len(records)} lifted grasps, {REPEATS} repeats each")
        print_correlations(records)
        print_picks(records)


def read_records(path: Path) -> list[dict[str, Any]]:
    """What was measured before."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def scan_scene(scans: Path, folder: Path) -> str:
    """The path of `scans/wide.yaml` in a folder, beside a library built of scans."""
    here = Path(__file__).parent / "scans"
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(here / "wide.yaml", folder)
    meshes = [str(path) for path in sorted(scans.glob("*.obj"))]
    options = ["-o", str(folder / "library"), "--masses", str(here / "masses.yaml")]
    if burg_drake(["library", "build", *meshes, *options]):
        raise SystemExit(f"the scans of {scans} cannot be built")
    return str(folder / "wide.yaml")


def collect(arguments: argparse.Namespace, known: set[tuple[str, str]]) -> None:
    """Adds records until each object has enough, or the time is over."""
    start = time.process_time()
    with arguments.records.open("a") as file:
        streams = [measured(scene, arguments, known) for scene in arguments.scenes]
        while streams:
            for stream in list(streams):
                record = next(stream, None)
                if record is None:
                    streams.remove(stream)
                    continue
                file.write(json.dumps(record) + "\n")
                file.flush()
                if time.process_time() - start > arguments.cpu:
                    return


def measured(
    scene_name: str, arguments: argparse.Namespace, known: set[tuple[str, str]]
) -> Iterator[dict[str, Any]]:
    """Records of one scene, its objects in turns."""
    scene, station = burg.load_scene(scene_name), burg.load_station(arguments.station)
    settings = SamplingSettings()
    grasps = sample_grasps(scene, station, 4 * arguments.n, seed=arguments.seed, settings=settings)
    grasps = scored_set(grasps, scene.library, station, scene).with_columns(sampler=grasps.score)
    exact, quick = (
        burg.HandTrial(scene, station, engine=as_engine(name)) for name in ("standard", "screening")
    )
    instance = grasps.column(INSTANCE_COLUMN)
    queues = {name: list(np.flatnonzero(instance == name)) for name in scene.instances}
    lifted = dict.fromkeys(queues, 0)
    while any(queues.values()):
        for name, queue in queues.items():
            while queue and lifted[name] < arguments.n:
                i = queue.pop(0)
                id = f"{name}-{grasps.id[i]}"
                if (scene_name, id) in known:
                    lifted[name] += 1
                    continue
                X_OG = grasps.X_OG[i]
                result = exact.run(name, X_OG)
                if result.outcome is not Outcome.LIFTED:
                    continue
                rate = success_rate(quick, name, X_OG, repeats=REPEATS, seed=0, grasp=id)
                lifted[name] += 1
                yield {
                    "scene": scene_name,
                    "instance": name,
                    "object": scene.instance(name).object,
                    "id": id,
                    "X_OG": X_OG.tolist(),
                    "width": float(grasps.width[i]),
                    **{key: float(getattr(result.margins, key)) for key in ROW_MARGINS},
                    "sampler": float(grasps.column("sampler")[i]),
                    **{key: float(grasps.column(key)[i]) for key in METRICS},
                    "outcomes": {o.value: n for o, n in rate.outcomes.items()},
                    "share": rate.probability,
                }
                break
            if lifted[name] >= arguments.n:
                queue.clear()


def print_correlations(records: list[dict[str, Any]]) -> None:
    """Rank correlation of each figure with the share, among the grasps of one object."""
    groups = by_object(records)
    share = {name: column(group, "share") for name, group in groups.items()}
    print("rank correlation with the share of repeats that are lifted, by object")
    print(f"{'':18}{'mean':>7}", *(f"{name[:9]:>9}" for name in groups))
    found = {}
    for figure in (*ROW_MARGINS, "width", "sampler", *METRICS):
        sign = -1.0 if figure in SMALLER_IS_BETTER else 1.0
        found[figure] = [
            correlation(sign * column(group, figure), share[name]) for name, group in groups.items()
        ]
    for figure, values in sorted(found.items(), key=lambda item: -np.mean(item[1])):
        print(f"{figure:18}{np.mean(values):+7.2f}", *(f"{value:+9.2f}" for value in values))


def print_picks(records: list[dict[str, Any]]) -> None:
    """Share of repeats that are lifted of the best grasps of each object, by each rule."""
    groups = by_object(records)
    print(f"share of repeats that are lifted: the {PICKED} best of each object, and the best one")
    print(f"{'':18}{'mean':>7}{'first':>7}", *(f"{name[:9]:>9}" for name in groups))
    for rule, order in RULES.items():
        shares = {}
        for name, group in groups.items():
            share = column(group, "share")
            shares[name] = share[order(group)] if order is not None else np.full(1, share.mean())
        cells = [values[:PICKED].mean() for values in shares.values()]
        first = np.mean([values[0] for values in shares.values()])
        print(f"{rule:18}{np.mean(cells):7.2f}{first:7.2f}", *(f"{cell:9.2f}" for cell in cells))


def by_best_rows(group: list[dict[str, Any]]) -> list[int]:
    """The order of `--best`."""
    names = ("clearance", "slip", "tilt", "others_moved", "patch_area")
    columns = {name: column(group, name) for name in names}
    columns["score"] = column(group, "sampler")
    columns["id"] = np.array([record["id"] for record in group])
    columns["outcome"] = np.full(len(group), Outcome.LIFTED.value)
    return best_rows(columns, len(group))


def by_disturbance(group: list[dict[str, Any]]) -> list[int]:
    """The order by slip, tilt and push of others alone."""
    parts = {"slip": 0.005, "tilt": 0.1, "others_moved": 0.01}
    penalty = sum(np.nan_to_num(column(group, name)) / scale for name, scale in parts.items())
    return np.lexsort((-column(group, "patch_area"), penalty)).tolist()


def by_share(group: list[dict[str, Any]]) -> list[int]:
    """The order that cannot be had: by what is to be predicted."""
    return np.argsort(-column(group, "share"), kind="stable").tolist()


RULES: dict[str, Callable[[list[dict[str, Any]]], list[int]] | None] = {
    "--best": by_best_rows,
    "least disturbance": by_disturbance,
    "load_margin": lambda group: np.argsort(-column(group, "load_margin")).tolist(),
    "any": None,
    "in hindsight": by_share,
}


def by_object(records: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Records by instance."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for record in records:
        groups.setdefault(record["instance"], []).append(record)
    return groups


def column(group: list[dict[str, Any]], name: str) -> Array:
    """A figure of some records."""
    return np.array([record[name] for record in group], float)


def correlation(figure: Array, share: Array) -> float:
    """Spearman's; 0 where a figure is the same for all, and NaN ranks last."""
    figure = np.where(np.isnan(figure), -np.inf, figure)
    if len(set(figure.tolist())) < 2 or len(set(share.tolist())) < 2:
        return 0.0
    return float(np.corrcoef(rankdata(figure), rankdata(share))[0, 1])


if __name__ == "__main__":
    main()
