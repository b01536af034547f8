"""What it takes until an arm's first verdict, what a plan costs beside judging, and memory.

    python benchmarks/startup.py [--cases CASE ...] [--grasps N] [--repeats R]

Each figure is CPU time of fresh processes: `burg-drake reach` of a single grasp with its worker, or
a program that makes an `ArmReach` and asks it. The cache is off, empty (`cold`), or holds what that
has left (`warm`), by turns; the least of some repeats counts. A case is SCENE:STATION; `iiwa` and
`mobile`, a Panda on two sliding joints, are written by `other_arms.py`.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
CASES = (
    "tabletop_six:panda_tabletop",
    "tabletop_six:panda_shelf",
    "tabletop_twelve:panda_bin",
    "tabletop_six:ur5e_tabletop",
    "tabletop_six:iiwa",
    "tabletop_six:mobile",
)
CACHES = ("off", "cold", "warm")


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", nargs="+", default=CASES, metavar="SCENE:STATION")
    parser.add_argument("--grasps", type=int, default=60, help="to judge and plan, of each case")
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--one", nargs=3, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        print(json.dumps(ask(*arguments.one)))
        return
    print("CPU seconds; ratios to the cache off; MB at most; grasps and plans a CPU second")
    with tempfile.TemporaryDirectory() as folder:
        for case in arguments.cases:
            measure(case, Path(folder), arguments.grasps, arguments.repeats)


def measure(case: str, folder: Path, count: int, repeats: int) -> None:
    """Prints the figures of a case."""
    scene, name = case.split(":")
    station = station_of(name, folder)
    grasps, one = folder / "grasps.npz", folder / "one.h5"
    sample(scene, station, count, grasps, one)
    found: dict[str, dict[str, float]] = {cache: {} for cache in CACHES}
    for repeat in range(repeats):
        for cache in CACHES:
            place = "off" if cache == "off" else str(folder / f"{name}{repeat}")
            environment = os.environ | {"BURG_DRAKE_CACHE": place}
            program = [sys.executable, __file__, "--one", scene, station, str(grasps)]
            said = subprocess.run(program, env=environment, check=True, stdout=subprocess.PIPE)
            figures = json.loads(said.stdout)
            if cache != "off":
                environment["BURG_DRAKE_CACHE"] += "_of_the_command"
            figures["command"] = command(scene, station, one, environment)
            for key, value in figures.items():
                found[cache][key] = min(value, found[cache].get(key, np.inf))
    print(f"\n{scene} on {name}")
    for key in ("import", "first", "command", "memory", "judge", "plan", "csv", "json"):
        values = [found[cache][key] for cache in CACHES]
        ratios = ", ".join(f"{value / values[0]:.2f}" for value in values[1:])
        texts = "  ".join(
            f"{cache} {value:7.3f}" for cache, value in zip(CACHES, values, strict=True)
        )
        print(f"  {key:8s} {texts}   ({ratios})")
    best = min((found[cache] for cache in CACHES), key=lambda figures: figures["plan"])
    for kind in ("csv", "json"):
        rate = 1.0 / (best["plan"] + best[kind])
        print(
            f"  {rate:.0f} plans a CPU second, written as {kind}; {1.0 / best['judge']:.0f} judged"
        )


def command(scene: str, station: str, one: Path, environment: dict[str, str]) -> float:
    """CPU time of the command about one grasp, with its worker."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    program = ["-m", "burg_drake.apps.cli", "reach", scene, "--station", station]
    options = ["--grasps", str(one), "--workers", "1", "--quiet"]
    run = [sys.executable, *program, *options]
    subprocess.run(run, env=environment, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def ask(scene_name: str, station_name: str, grasps: str) -> dict[str, float]:
    """In a process of its own: CPU time since its start until it has a verdict, and so on."""
    from burg_drake.motion import ArmReach, Planner
    from burg_drake.scene import load_scene
    from burg_drake.station import load_station

    imported = time.process_time()
    scene, station = load_scene(scene_name), load_station(station_name)
    with np.load(grasps) as given:
        names, X_WG, width = given["names"].tolist(), given["X_WG"], given["width"]
    reach = ArmReach(scene, station)
    reach.check(names[0], X_WG[0], width[0])
    first = time.process_time()
    verdicts = reach.check_all(names, X_WG, width)
    judged = time.process_time()
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    planner = Planner(reach)
    planned = [k for k, verdict in enumerate(verdicts) if verdict.path is not None]
    began = time.process_time()
    plans = [planner.time(names[k], verdicts[k].path, width[k]) for k in planned]
    ended = time.process_time()
    figures = {
        "import": imported,
        "first": first,
        "judge": (judged - first) / len(names),
        "memory": memory,
        "plan": (ended - began) / len(plans),
    }
    with tempfile.TemporaryDirectory() as folder:
        for kind in ("csv", "json"):
            began = time.process_time()
            for k, plan in enumerate(plans):
                write = plan.to_csv if kind == "csv" else plan.to_json
                write(Path(folder) / f"{k}.{kind}")
            figures[kind] = (time.process_time() - began) / len(plans)
    return figures


def station_of(name: str, folder: Path) -> str:
    """Name or file of a case's station."""
    from other_arms import iiwa_station, mobile_station

    if name not in ("iiwa", "mobile"):
        return name
    return str((iiwa_station if name == "iiwa" else mobile_station)(folder))


def sample(scene_name: str, station_name: str, count: int, grasps: Path, one: Path) -> None:
    """Writes grasps that the open hand is clear at, and the first of them as a file of grasps."""
    from burg_drake.evaluation import sample_grasps
    from burg_drake.scene import load_scene
    from burg_drake.station import instance_pose, load_station

    scene, station = load_scene(scene_name), load_station(station_name)
    each = max(1, count // len(scene.instances))
    found = sample_grasps(scene, station, each)
    names = found.column("instance").tolist()
    X_WO = np.array([instance_pose(scene, station, name) for name in names])
    np.savez(grasps, names=np.array(names), X_WG=X_WO @ found.X_OG, width=found.width)
    found.select(np.arange(len(names)) == 0).save(one)


if __name__ == "__main__":
    main()
