"""The engine's side of contact_oracle.py: the oracle's objects as a library, and trials."""

from __future__ import annotations

import dataclasses
import os
import shutil
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

import numpy as np
import trimesh
from mixed_grasps import hand_only
from oracle.cases import Case
from oracle.catalogue import thing

import burg_drake as burg
from burg_drake.core import Pose, make_pose, resolve_reference
from burg_drake.objects import ContactKind, load_library
from burg_drake.pipeline import ObjectSource
from burg_drake.scene import Instance, Scene, SceneDocument
from burg_drake.simulation import BatchTrial, MujocoTrial, hand_trial_of
from burg_drake.station import ENGINES, Engine, Station

STATION = "panda_tabletop"
MASS, FRICTION = 0.5, 0.5
"""In the library; cases have their own."""
DAMPED = "damped"
DAMPING = ("5</drake:hunt_crossley_dissipation>", "50</drake:hunt_crossley_dissipation>")
CANARIES = {
    "sap": Engine(name="sap", time_step=0.002, contact_approximation="sap"),
    DAMPED: Engine(name=DAMPED, time_step=0.002),
}
"""Known to be worse, which has to show: Drake's convex approximation with its relaxation time as it
is by default, and the standard engine with pads whose dissipation is 50 s/m in place of 5."""
KNOWN = {**ENGINES, **CANARIES}


def build(out: Path, names: Iterable[str], contact: ContactKind | None) -> Path:
    """Builds a library of objects of the catalogue, or what is missing of it.

    Raises:
        RuntimeError: an object cannot be built.
    """
    sources = [source(name, contact) for name in names]
    report = burg.build_library(sources, out, confirm=False)
    if report.failed:
        raise RuntimeError(str(report.failed))
    return out


def source(name: str, contact: ContactKind | None) -> ObjectSource:
    """An object as the pipeline takes it: the fine mesh, with the oracle's mass properties."""
    found = thing(name)
    parts = [trimesh.Trimesh(v, f, process=False) for v, f in found.solid.meshes]
    mesh = trimesh.boolean.union(parts) if len(parts) > 1 else parts[0]
    I = MASS * found.mass_properties.inertia  # noqa: E741
    x, y, z = found.mass_properties.center.tolist()
    inertia = tuple(float(I[k]) for k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    return ObjectSource(
        name=name,
        mesh=mesh,
        mass=MASS,
        center_of_mass=(x, y, z),
        inertia=inertia,
        friction=FRICTION,
        contact=contact,
    )


@lru_cache(maxsize=8)
def make_trial(library: str, object: str, pose: int, engine: str) -> burg.HandTrial | MujocoTrial:
    """A trial with an object alone in the middle of the board; the instance is `target`."""
    opened = load_library(library)
    X_SO = make_pose(p_AB=(0.3, 0.2, 0.0)) @ thing(object).X_WO(pose)
    placed = Instance(name="target", object=object, X_SO=Pose.from_matrix(X_SO, quaternion=True))
    document = SceneDocument(name="oracle", library=library, instances=(placed,))
    station = hand_only(burg.load_station(STATION))
    if engine == DAMPED:
        station = damped(station, Path(library).parent / DAMPED)
    return hand_trial_of(Scene(document, opened, Path("oracle")), station, KNOWN[engine])


@lru_cache(maxsize=8)
def make_batch(library: str, object: str, pose: int, engine: str) -> BatchTrial:
    """The same for an engine with parallel trials, on the CPU."""
    single = make_trial(library, object, pose, engine)
    return BatchTrial(single.scene, single.station, engine=engine, device="cpu")


def damped(station: Station, folder: Path) -> Station:
    """The station with pads of ten times the dissipation, from a copy of the hand's model."""
    model = resolve_reference(station.hand.model)
    if not folder.exists():
        beside = folder.with_name(f"{folder.name}_{os.getpid()}")
        shutil.copytree(model.parent, beside)
        path = beside / model.name
        text = path.read_text()
        assert DAMPING[0] in text, f"{path} has no {DAMPING[0]}"
        path.write_text(text.replace(*DAMPING))
        try:
            beside.rename(folder)
        except OSError:  # another worker was first
            shutil.rmtree(beside)
    return dataclasses.replace(station, hand_model=folder / model.name)


def run_engine(library: str, case: Case, engine: str) -> dict[str, object]:
    """What the engine says about a case."""
    if KNOWN[engine].parallel:
        batch = make_batch(library, case.object, case.pose, engine)
        (result,) = batch.run("target", case.matrix[None], friction=case.friction, mass=case.mass)
    else:
        trial = make_trial(library, case.object, case.pose, engine)
        result = trial.run("target", case.matrix, friction=case.friction, mass=case.mass)
    margins = result.margins
    return {
        "lifted": bool(result.outcome.held),
        "executed": bool(np.isfinite(margins.end_time)),
        "outcome": str(result.outcome),
        "slip": margins.slip,
        "tilt": margins.tilt,
        "confidence": result.confidence,
    }
