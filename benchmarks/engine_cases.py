"""Grasps for comparing engines: half of them near the limit of what friction holds.

Every object rests alone on the table in its most probable poses. Grasps are antipodal ones from
above for which the open hand is clear. Of four grasps one is executed as the library has the
object, one with so large a mass, and two with so little friction, that the load of the lift is
somewhere around what friction can hold, from well below to well above.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mixed_grasps import CONE, hand_only
from scipy.spatial.transform import Rotation

import burg_drake as burg
from burg_drake.core import Array, Pose, make_pose, rng_from, transform_points
from burg_drake.objects import load_library
from burg_drake.scene import Instance, Scene, SceneDocument
from burg_drake.station import ENGINES, Engine

STATION = "panda_tabletop"
POSES = 3
"""Stable poses of an object that are used, at most."""
SHARES = (0.3, 3.0)
"""Load that a marginal grasp should hold by rule of thumb over its load, drawn log-uniformly."""
PAD_LEVER = 0.015
"""In the rule of thumb a load with this lever [m] about the closing axis uses up as much of the
friction by its moment as by its weight. Pads alone, 18 mm wide, carry less of a moment; but an
object that turns in the hand may come to hang. With it half of the marginal grasps hold."""
MASS_FACTORS = (0.5, 2.0)
"""Masses of slippery objects, as factors to the library's."""
GRAVITY = 9.81
BATCH, BATCHES = 250, 40
"""Grasps that are sampled at a time, and how often, to find the clear ones of a pose."""
MOTION = (0.0005, float(np.deg2rad(0.5)))
"""Of a grasp [m, rad]: less than what cameras and robots leave open."""
PROBES = {f"moved {i}": (1.0, i) for i in range(1, 6)} | {
    "friction 0.98": (0.98, 0),
    "friction 1.02": (1.02, 0),
}
"""Small changes that a verdict should survive: factor to the friction, and number of a motion."""
NOISE = "moved 1"
"""The one that is tried with every grasp."""


@dataclass(frozen=True)
class Resting:
    """An object on the table.

    Attributes:
        library: reference to the library.
        object: name in it.
        pose: number of the stable pose.
    """

    library: str
    object: str
    pose: int

    @property
    def id(self) -> str:
        """For people and for seeds; does not depend on where the library lies."""
        return f"{Path(self.library).name}/{self.object}/{self.pose}"


@dataclass(frozen=True)
class Case:
    """A grasp to execute.

    Attributes:
        id: object, pose and number.
        resting: the object.
        kind: `plain`, `heavy` or `slippery`.
        X_OG: the grasp, rows of a (4, 4) matrix.
        friction, mass: overrides; None for the library's.
    """

    id: str
    resting: Resting
    kind: str
    X_OG: tuple[tuple[float, ...], ...]
    friction: float | None
    mass: float | None

    @property
    def marginal(self) -> bool:
        """Friction or mass are drawn around the limit."""
        return self.kind != "plain"


def resting_objects(library: str) -> list[Resting]:
    """The most probable poses of all objects of a library."""
    entries = load_library(library).objects
    return [
        Resting(library, name, pose)
        for name, entry in entries.items()
        for pose in range(min(POSES, len(entry.stable_poses)))
    ]


def make_trial(resting: Resting, engine: Engine) -> burg.HandTrial:
    """A trial with the object alone in the middle of the board; the instance is `target`."""
    library = load_library(resting.library)
    X_SO = make_pose(p_AB=(0.3, 0.2, 0.0)) @ library.entry(resting.object).X_SO(resting.pose)
    instance = Instance(
        name="target", object=resting.object, X_SO=Pose.from_matrix(X_SO, quaternion=True)
    )
    document = SceneDocument(name="engines", library=resting.library, instances=(instance,))
    scene = Scene(document, library, Path("engines"))
    return burg.HandTrial(scene, hand_only(burg.load_station(STATION)), engine=engine)


def draw_cases(resting: Resting, count: int) -> list[Case]:
    """At most so many cases of an object in a pose; the same in every process."""
    trial = make_trial(resting, ENGINES["screening"])
    cases = []
    for i, X_OG in enumerate(clear_grasps(trial, resting, count)):
        id = f"{resting.id}/{i}"
        kind = ("plain", "slippery", "heavy", "slippery")[i % 4]
        friction, mass = overrides(trial, X_OG, kind, rng_from("engine case", id))
        rows = tuple(tuple(row) for row in X_OG.tolist())
        cases.append(Case(id, resting, kind, rows, friction, mass))
    return cases


def clear_grasps(trial: burg.HandTrial, resting: Resting, count: int) -> list[Array]:
    """At most so many grasps (4, 4) for which the open hand is clear."""
    scene, station = trial.diagram.scene, trial.diagram.station
    X_WO = trial.diagram.X_WO("target")
    cone = burg.grasps.ApproachCone(tuple(np.round(-X_WO[2, :3], 9)), CONE)
    clear: list[Array] = []
    for batch in range(BATCHES):
        grasps = burg.grasps.sample_antipodal(
            scene.library.surface(resting.object),
            BATCH,
            rng_from("engines", resting.id, batch),
            burg.grasps.AntipodalSettings(
                friction=scene.entry("target").friction,
                opening=station.hand.opening,
                approach_cones=(cone,),
            ),
        )
        found = trial.clearance.check_all("target", X_WO @ grasps.X_OG)
        clear += [X for X, c in zip(grasps.X_OG, found, strict=True) if c.outcome is None]
        if len(clear) >= count:
            break
    return clear[:count]


def overrides(
    trial: burg.HandTrial, X_OG: Array, kind: str, rng: np.random.Generator
) -> tuple[float | None, float | None]:
    """Friction and mass [kg] of a case."""
    entry = trial.diagram.scene.entry("target")
    settings, force = trial.settings, trial.diagram.station.hand.force
    load = GRAVITY + settings.acceleration  # of 1 kg, at most [N]
    load *= float(np.hypot(1.0, lever(trial, X_OG) / PAD_LEVER))
    share = log_uniform(rng, SHARES)
    if kind == "heavy":
        return None, 2.0 * entry.friction * force / (share * load)
    if kind == "slippery":
        mass = entry.mass_properties.mass * log_uniform(rng, MASS_FACTORS)
        return share * mass * load / (2.0 * force), mass
    return None, None


def lever(trial: burg.HandTrial, X_OG: Array) -> float:
    """Lever of the weight about the closing axis [m]."""
    X_WG = trial.X_WG("target", X_OG)
    center = np.array([trial.diagram.scene.entry("target").mass_properties.center_of_mass])
    p_GOcm_W = transform_points(trial.diagram.X_WO("target"), center)[0] - X_WG[:3, 3]
    return float(abs(np.cross(p_GOcm_W, (0.0, 0.0, -1.0)) @ X_WG[:3, 0]))


def log_uniform(rng: np.random.Generator, bounds: tuple[float, float]) -> float:
    """A number drawn evenly in its logarithm."""
    return float(np.exp(rng.uniform(*np.log(bounds))))


def moved(X_OG: Array, seed: str) -> Array:
    """A grasp (4, 4), moved and turned by MOTION in random directions."""
    shift, axis = rng_from("moved grasp", seed).normal(size=(2, 3))
    shift *= MOTION[0] / np.linalg.norm(shift)
    axis *= MOTION[1] / np.linalg.norm(axis)
    return X_OG @ make_pose(Rotation.from_rotvec(axis).as_matrix(), shift)
