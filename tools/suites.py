"""Writes the built-in suites: scenes sampled from recipes, brought to rest in simulation.

Run `python -m tools.suites [NAME ...]` after the library or a station has changed; the tests of the
built-in suites say when that is due. Raise `RELEASE` then: results of another release do not
compare. A suite takes some minutes.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

from burg_drake.benchmark import SUITE_FOLDER, CameraPlacement, SuiteSettings, make_suite
from burg_drake.core import data_root
from burg_drake.generation import sample_scene
from burg_drake.objects import load_library
from burg_drake.scene import LayoutName, Scene, SceneRecipe
from burg_drake.station import load_station

RELEASE = 1
TUNING = 4
"""Scenes on which planners may be tuned, beside the 20 that count."""


@dataclass(frozen=True)
class SuitePlan:
    """What a suite is made of.

    Attributes:
        description: text of the suite.
        layouts: layouts of the scenes, in turn.
        counts: numbers of objects of the scenes, in turn.
        station: name of the station.
        elevation_deg, distance: of the camera, which looks at the middle of the board from the
            robot's side [degrees, m].
    """

    description: str
    layouts: tuple[LayoutName, ...]
    counts: tuple[int, ...]
    station: str = "panda_tabletop"
    elevation_deg: float = 60.0
    distance: float = 0.75


SUITE_PLANS = {
    "wide_close": SuitePlan(
        "Six objects with room for fingers in between, and close together, in turn: the two kinds"
        " of scenes of the paper on BURG-Toolkit",
        ("wide", "close"),
        (6,),
    ),
    "tabletop": SuitePlan(
        "One to twelve objects anywhere on the board", ("random",), (*range(1, 13),)
    ),
    "packed": SuitePlan("Six objects as dense as possible", ("packed",), (6,)),
    "heap": SuitePlan("Eight objects dropped in a heap", ("heap",), (8,), elevation_deg=70.0),
    "bin": SuitePlan(
        "Six objects dropped into a bin",
        ("heap",),
        (6,),
        station="panda_bin",
        elevation_deg=75.0,
    ),
    "shelf": SuitePlan(
        "Three objects in a compartment that is roofed over its back half",
        ("random",),
        (3,),
        station="panda_shelf",
        elevation_deg=38.0,
        distance=0.8,
    ),
}


def sample_scenes_of(name: str, plan: SuitePlan, count: int) -> list[Scene]:
    """Samples the scenes of a suite."""
    library, station = load_library("household"), load_station(plan.station)
    found: list[Scene] = []
    for k in range(count):
        recipe = SceneRecipe(
            library="household",
            count=plan.counts[k % len(plan.counts)],
            repeat=True,
            layout=plan.layouts[k % len(plan.layouts)],
            station=plan.station,
            seed=RELEASE,
        )
        sampled = sample_scene(recipe, library, station, number=k)
        if not sampled.accepted:
            raise SystemExit(f"{name}: no scene {k} was accepted: {dict(sampled.refused)}")
        document = sampled.scene.document
        renamed = Scene(
            replace(document, name=f"{name}_{k + 1:02d}", description="", origin=None),
            library,
            sampled.scene.path,
        )
        found.append(renamed)
        print(f"{name}: scene {k + 1} of {count}", flush=True)
    return found


def write_suite(name: str, count: int = 20) -> None:
    """Samples and writes a built-in suite with `count` scenes that count."""
    plan = SUITE_PLANS[name]
    scenes = sample_scenes_of(name, plan, count + TUNING)
    placement = CameraPlacement(elevation_deg=plan.elevation_deg, distance=plan.distance)
    make_suite(
        data_root() / SUITE_FOLDER / f"{name}.yaml",
        scenes,
        cameras=[placement.camera(scenes[0].board)],
        station=plan.station,
        settings=SuiteSettings(description=plan.description, release=RELEASE, tuning=TUNING),
    )


def main(names: Sequence[str]) -> None:
    """Writes the suites with these names; all without one."""
    for name in names or SUITE_PLANS:
        write_suite(name)


if __name__ == "__main__":
    main(sys.argv[1:])
