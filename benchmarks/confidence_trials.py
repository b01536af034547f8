"""The trials that confidence is calibrated on: grasps of many objects, each executed as it is and
again in worlds that a laboratory can hardly tell from the first."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
import yaml
from contact_oracle_trials import STATION, source
from mixed_grasps import hand_only
from oracle.cases import Case, draw_cases
from oracle.catalogue import HELD_OUT, TUNED, thing
from oracle.hand import DEFAULT_PHASES
from scipy.spatial.transform import Rotation

import burg_drake as burg
from burg_drake.core import Array, Pose, make_pose, rng_from
from burg_drake.objects import load_library
from burg_drake.pipeline import ObjectSource
from burg_drake.scene import Instance, Scene, SceneDocument
from burg_drake.simulation import (
    DEFAULT_TRIAL,
    GripLoad,
    HandTrial,
    MujocoTrial,
    TrialSettings,
    hand_trial_of,
)

FRICTION_SD, TRANSLATION_SD, ROTATION_SD = 0.05, 0.0005, np.deg2rad(0.5)
"""Of the perturbed worlds: friction in the logarithm, the hand's place [m] and turn [rad]."""
WORLDS = ((1.0, 1.0), (0.99, 0.7), (1.01, 1.4), (1.01, 0.7), (0.99, 1.4))
"""Factors to the object's size and to the duration of the lift; the first one is as it is."""
TARGET = "target"
ORDINARY_FRICTION, ORDINARY_MASS = (0.25, 0.7), (0.08, 0.8)
"""What an object that is not made to be hard has [-, kg]; drawn evenly in the logarithm."""
LIMIT_SD = 0.1
"""Of the logarithm of friction about its limit."""
POSES = 2
"""Resting poses of an object that is not the oracle's, the most probable ones."""


Kind = Literal["ordinary", "hard", "limit"]


@dataclass(frozen=True)
class Grasp:
    """A grasp to execute.

    Attributes:
        case: the grasp, its friction and its mass.
        kind: `ordinary` where friction and mass are as they come, `hard` where friction is from
            half to twice of what should hold, `limit` where it is within some 10 % of that.
    """

    case: Case
    kind: Kind

    @property
    def held_out(self) -> bool:
        """Whether nothing may be fitted on the object."""
        return is_held_out(self.case.object)


def is_held_out(name: str) -> bool:
    """More than half of the objects: those that the oracle holds out, scans, and some of the
    household."""
    if name in TUNED or name in HELD_OUT:
        return name in HELD_OUT
    return not name.startswith("household_") or name in HOUSEHOLD_HELD_OUT


HOUSEHOLD_HELD_OUT = tuple(f"household_{name}" for name in ("mug", "banana", "box", "screwdriver"))


def sources(scans: Path | None) -> dict[str, ObjectSource]:
    """All objects by name."""
    found = {name: source(name, None) for name in (*TUNED, *HELD_OUT)}
    household = load_library("household")
    for name, entry in household.objects.items():
        if entry.mass_properties.source == "fixed":
            continue
        found[f"household_{name}"] = ObjectSource(
            name=f"household_{name}",
            mesh=household.path(entry.mesh),
            mass=entry.mass_properties.mass,
            center_of_mass=entry.mass_properties.center_of_mass,
            inertia=entry.mass_properties.inertia,
            friction=entry.friction,
        )
    if scans is not None:
        masses = yaml.safe_load(
            Path(__file__).with_name("scans").joinpath("masses.yaml").read_text()
        )
        for path in sorted(scans.glob("*.obj")):
            given = ObjectSource.from_file(path, friction=0.5)
            mass = masses.get(given.name) if isinstance(masses, dict) else None
            found[given.name] = dataclasses.replace(
                given, mass=mass if isinstance(mass, float) else 0.4
            )
    return found


def build(out: Path, scans: Path | None) -> None:
    """Builds a library for each size."""
    for size in sorted({size for size, _ in WORLDS}):
        scaled = [resized(one, size) for one in sources(scans).values()]
        report = burg.build_library(scaled, library_folder(out, size), confirm=False)
        if report.failed:
            raise RuntimeError(str(report.failed))


def library_folder(out: Path, size: float) -> Path:
    """Of objects of a size."""
    return out / f"library_{size:g}"


def resized(one: ObjectSource, size: float) -> ObjectSource:
    """An object of the same mass and another size."""
    if size == 1.0:
        return one
    center, inertia = one.center_of_mass, one.inertia
    return dataclasses.replace(
        one,
        scale=one.scale * size,
        center_of_mass=None if center is None else tuple(size * v for v in center),
        inertia=None if inertia is None else tuple(size * size * v for v in inertia),
    )


def pose_of(out: Path, name: str, pose: int, size: float) -> Array:
    """(4, 4) X_WO of an object of a size in a resting pose; the table is z = 0."""
    if name in TUNED or name in HELD_OUT:
        X_WO = thing(name).X_WO(pose).copy()
    else:
        entry = open_library(str(library_folder(out, 1.0))).entry(name)
        X_WO = entry.stable_poses[pose].X_SO.matrix().copy()
    X_WO[:3, 3] *= size
    return X_WO


@lru_cache(maxsize=4)
def open_library(folder: str) -> burg.ObjectLibrary:
    """A library."""
    return load_library(folder)


def make_trial(
    out: Path, name: str, pose: int, world: tuple[float, float], engine: str
) -> HandTrial | MujocoTrial:
    """An object alone in the middle of the board, in a world."""
    size, lift_time = world
    library = open_library(str(library_folder(out, size)))
    X_SO = make_pose(p_AB=(0.3, 0.2, 0.0)) @ pose_of(out, name, pose, size)
    placed = Instance(name=TARGET, object=name, X_SO=Pose.from_matrix(X_SO, quaternion=True))
    document = SceneDocument(name="one", library=str(library.root), instances=(placed,))
    settings = TrialSettings(lift_time=lift_time * DEFAULT_TRIAL.lift_time)
    station = hand_only(burg.load_station(STATION))
    scene = Scene(document, library, Path("one"))
    return hand_trial_of(scene, station, engine, settings=settings)


def poses(out: Path) -> list[tuple[str, int]]:
    """All objects with their resting poses."""
    library = open_library(str(library_folder(out, 1.0)))
    found = []
    for name, entry in library.objects.items():
        own = name in TUNED or name in HELD_OUT
        count = len(thing(name).poses) if own else min(POSES, len(entry.stable_poses))
        found += [(name, pose) for pose in range(count)]
    return found


def draw(out: Path, name: str, pose: int, each: int) -> list[Grasp]:
    """Grasps of an object in a pose, so many of each kind; fewer at the limit, where few hang
    straight below the pads."""
    rng = rng_from("confidence", name, pose)
    cases = oracle_cases(name, pose, 2 * each) or sampled_cases(out, name, pose, 2 * each)
    grasps = []
    for k, case in enumerate(cases):
        if k % 2:
            friction = float(np.round(np.exp(rng.uniform(*np.log(ORDINARY_FRICTION))), 4))
            mass = float(np.round(np.exp(rng.uniform(*np.log(ORDINARY_MASS))), 4))
            case = dataclasses.replace(case, friction=friction, mass=mass)
        grasps.append(Grasp(case, "ordinary" if k % 2 else "hard"))
    ordinary = [grasp.case for grasp in grasps if grasp.kind == "ordinary"]
    return grasps + at_the_limit(out, ordinary)


def at_the_limit(out: Path, cases: Sequence[Case]) -> list[Grasp]:
    """Those of the cases that hang straight below the pads, rather than turn in them, with friction
    about the least that carries them."""
    found = []
    for case in cases:
        rng = rng_from("confidence limit", case.id)
        entry = open_library(str(library_folder(out, 1.0))).entry(case.object)
        X_WO = pose_of(out, case.object, case.pose, 1.0)
        load = GripLoad.of(
            X_WO @ case.matrix,
            X_WO[:3, :3] @ entry.mass_properties.center_of_mass + X_WO[:3, 3],
            friction=1.0,
            force=DEFAULT_PHASES.force,
            mass=case.mass,
            acceleration=DEFAULT_TRIAL.acceleration,
        )
        if load.turned < load.carried:
            needed = float(np.hypot(load.carried, load.turned))
            friction = float(np.round(needed * np.exp(rng.normal(0.0, LIMIT_SD)), 4))
            changed = dataclasses.replace(case, id=f"{case.id}/limit", friction=friction)
            found.append(Grasp(changed, "limit"))
    return found


def oracle_cases(name: str, pose: int, count: int) -> list[Case]:
    """Of one of the oracle's objects."""
    if name not in TUNED and name not in HELD_OUT:
        return []
    found: list[Case] = []
    for case in draw_cases(name, "confidence"):
        if case.pose == pose:
            found.append(case)
        if len(found) == count:
            break
    return found


def sampled_cases(out: Path, name: str, pose: int, count: int) -> list[Case]:
    """Of any other object: antipodal grasps at which the hand is clear."""
    trial = make_trial(out, name, pose, WORLDS[0], "standard")
    scene, station = trial.scene, trial.station
    rng = rng_from("confidence grasps", name, pose)
    down_O = np.round(-trial.diagram.X_WO(TARGET)[2, :3], 9)
    grasps = burg.grasps.sample_antipodal(
        scene.library.surface(name),
        30 * count,
        rng,
        burg.grasps.AntipodalSettings(
            friction=scene.entry(TARGET).friction,
            opening=station.hand.opening,
            approach_cones=(burg.grasps.ApproachCone(tuple(down_O), np.deg2rad(75.0)),),
        ),
    ).X_OG
    screened = trial.clearance.check_all(TARGET, trial.diagram.X_WO(TARGET) @ grasps)
    clear = grasps[[verdict.outcome is None for verdict in screened]][:count]
    cases = []
    properties = scene.entry(TARGET).mass_properties
    X_WO = trial.diagram.X_WO(TARGET)
    for k, X_OG in enumerate(clear):
        mass = float(np.round(np.exp(rng.uniform(*np.log((0.25, 1.5)))), 3))
        arm = (X_WO @ [*properties.center_of_mass, 1.0])[:3] - (X_WO @ X_OG)[:3, 3]
        lever = abs(float(np.cross(arm, (0.0, 0.0, -1.0)) @ (X_WO @ X_OG)[:3, 0]))
        load = mass * (9.81 + DEFAULT_TRIAL.acceleration) / (2.0 * station.hand.force)
        guess = load * float(np.hypot(1.0, lever / 0.04))
        friction = float(np.round(np.clip(guess * np.exp(rng.uniform(-0.5, 0.7)), 0.015, 1.3), 4))
        rows = tuple(tuple(row) for row in X_OG[:3].tolist())
        cases.append(Case(f"{name}/{pose}/sampled{k}", name, pose, rows, friction, mass))
    return cases


def perturbed(case: Case, world: int) -> tuple[Array, float]:
    """The grasp (4, 4) and friction of a case in a world; as it is in the first one."""
    X_OG = case.matrix
    if world == 0:
        return X_OG, case.friction
    rng = rng_from("confidence world", case.id, world)
    X_GG = make_pose(
        Rotation.from_rotvec(rng.normal(0.0, ROTATION_SD, 3)).as_matrix(),
        rng.normal(0.0, TRANSLATION_SD, 3),
    )
    moved = X_OG.copy()
    moved[:3, 3] *= WORLDS[world][0]
    return moved @ X_GG, case.friction * float(np.exp(rng.normal(0.0, FRICTION_SD)))
