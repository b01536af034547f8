"""Results do not hinge on the time step, the mesh of the pads, or the mesh of the object.

    python benchmarks/convergence.py [--plot docs/images/convergence.svg]

Measures what statics gives in closed form, as ratio to that form:

    payload   smallest friction that holds a box, to m g / (2 N)
    sliding   force of pads that slide past a box, to 2 mu N
    torsion   smallest friction that keeps a bar level which is gripped 50 mm beside its middle, to
              that of a patch of even pressure, by integration
    patch     contact area of a ball, to that of an elastic foundation
    creep     how fast the bar turns in the hand at 1.3 times that friction [deg/s]; 0 is right

and prints a table for each of: time step, triangles of the pads' front, faces of the object.
"""

from __future__ import annotations

import argparse
import dataclasses
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import trimesh
from convergence_plot import Panel, plot
from scipy.optimize import brentq

import burg_drake as burg
from burg_drake.core import Array, Pose, grasp_from_axes, resolve_reference
from burg_drake.objects import ContactKind
from burg_drake.pipeline import ObjectSource
from burg_drake.scene import Board, Instance, Scene, SceneDocument, save_scene
from burg_drake.simulation import TrialSettings
from burg_drake.station import ENGINES, Engine, Station, StationDocument, Table, load_hand
from tools.robot_model.pad_mesh import pad_vtk, squares

FORCE, GRAVITY = 40.0, 9.81
PAD = (0.0175, 0.0152, 0.0185)
"""Size of the Panda hand's pads: across, thickness, along the approach [m]."""
STIFFNESS = 1e7 / (PAD[1] / 2)
"""Modulus over thickness, from the middle of the pad to its front [N/m^3]."""
BOX_MASS, BAR_MASS, LEVER, RADIUS = 0.3, 0.2, 0.05, 0.03
LEVEL = np.deg2rad(2.5)
"""A bar that tilts by less is held; one that is not stays on the table with its far end."""

SLOW = TrialSettings(motion=burg.GraspMotion(lift_height=0.01), lift_time=5.48, hold_time=0.3)
STEEP = TrialSettings(motion=burg.GraspMotion(lift_height=0.02), lift_time=5.42, hold_time=0.1)
"""Both accelerate by 0.04 m/s^2 only."""

TIME_STEPS = (0.0005, 0.001, 0.002, 0.005, 0.01)
SQUARES = (1, 2, 4, 8)
"""Of pads that are divided evenly, along each side."""
PACKAGE_TRIANGLES = 14
"""Of the front of a pad in the package."""
SUBDIVISIONS = (0, 1, 2, 3)
QUANTITIES = ("payload", "sliding", "torsion", "patch")

Row = dict[str, float]


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plot", type=Path, help="SVG file to write")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        panels = run(Path(scratch))
    if arguments.plot is not None:
        arguments.plot.write_text(plot(panels), encoding="utf-8")
        print(f"wrote {arguments.plot}")


def run(scratch: Path) -> list[Panel]:
    """Measures and prints the three tables."""
    standard, default = ENGINES["standard"], make_station()
    shapes = make_shapes(scratch / "shapes")
    steps = [Engine(name="swept", time_step=time_step) for time_step in TIME_STEPS]
    by_step = [measure(shapes, default, engine) for engine in steps]
    show("time step [ms]", [f"{1e3 * time_step:g}" for time_step in TIME_STEPS], by_step)
    pads = {2 * n * n: make_station(pad_model(scratch / f"pad_{n}", n)) for n in SQUARES}
    pads = dict(sorted({**pads, PACKAGE_TRIANGLES: default}.items()))
    by_pad = [measure(shapes, station, standard) for station in pads.values()]
    labels = [str(count) for count in pads]
    show("triangles of a pad", labels, by_pad)
    by_mesh, faces = [], []
    for n in SUBDIVISIONS:
        meshes = make_shapes(scratch / f"mesh_{n}", subdivisions=n)
        by_mesh.append(measure(meshes, default, standard))
        faces.append([12 * 4**n, 20 * 4 ** (n + 1)])
    show("faces of box, ball", [f"{box}, {ball}" for box, ball in faces], by_mesh)
    return [
        Panel("Time step [ms]", [f"{1e3 * t:g}" for t in TIME_STEPS], series(by_step), 2),
        Panel(
            "Triangles of a pad's front", labels, series(by_pad), [*pads].index(PACKAGE_TRIANGLES)
        ),
        Panel(
            "Faces of box, ball", [f"{box}/{ball}" for box, ball in faces], series(by_mesh), None
        ),
    ]


def series(rows: Sequence[Row]) -> dict[str, list[float]]:
    """What is drawn: ratios by quantity."""
    return {name: [row[name] for row in rows] for name in QUANTITIES}


def show(title: str, labels: Sequence[str], rows: Sequence[Row]) -> None:
    """Prints a table."""
    print(f"{title:22}" + "".join(f"{name:>10}" for name in rows[0]), flush=True)
    for label, row in zip(labels, rows, strict=True):
        print(f"{label:22}" + "".join(f"{value:10.3f}" for value in row.values()), flush=True)
    print()


# --- quantities ---------------------------------------------------------------------------------


def measure(library: Path, station: Station, engine: Engine) -> Row:
    """All quantities."""
    scenes = {name: make_scene(library, name) for name in ("box", "bar", "ball")}
    box = burg.HandTrial(scenes["box"], station, engine=engine, settings=SLOW)
    bar = burg.HandTrial(scenes["bar"], station, engine=engine, settings=STEEP)
    whole = dataclasses.replace(engine, whole_trial=True)
    patient = burg.HandTrial(scenes["bar"], station, engine=whole, settings=STEEP)
    ball = burg.HandTrial(scenes["ball"], station, engine=engine, settings=SLOW)
    return {
        "payload": payload(box),
        "sliding": sliding(box),
        "torsion": torsion(bar),
        "patch": patch(ball),
        "creep": creep(patient),
    }


def payload(trial: burg.HandTrial) -> float:
    """Smallest friction that holds the box, to Coulomb's."""
    coulomb = BOX_MASS * GRAVITY / (2 * FORCE)
    return bisected(
        lambda share: trial.run("box", from_above(0.05), friction=share * coulomb).outcome.held
    )


def sliding(trial: burg.HandTrial, friction: float = 0.01) -> float:
    """Mean force of pads that slide past the box, to Coulomb's."""
    execution = trial.begin("box", trial.X_WG("box", from_above(0.05)), friction=friction)
    execution.close()
    trial.world.command("lift", np.array([0.0, 0.05]))
    forces = []
    for _ in range(20):
        execution.advance()
        forces.append(execution.contact.force[:, 2].sum())
    return float(np.mean(forces[5:])) / (2 * friction * FORCE)


def torsion(trial: burg.HandTrial) -> float:
    """Smallest friction that keeps the bar level, to that of a patch of even pressure."""
    return bisected(lambda share: bar_tilt(trial, share) < LEVEL)


def creep(trial: burg.HandTrial) -> float:
    """Speed at which the bar turns in the hand [deg/s]."""
    X_WG = trial.X_WG("bar", from_above(0.02, LEVER))
    execution = trial.begin("bar", X_WG, friction=1.3 * bar_friction())
    execution.close()
    execution.lift()
    before = execution.X_GO()
    while_held = 20
    for _ in range(while_held):
        execution.advance()
    turned = execution.X_GO()[:3, :3] @ before[:3, :3].T
    angle = np.arccos(np.clip((np.trace(turned) - 1) / 2, -1.0, 1.0))
    return float(np.rad2deg(angle)) / (while_held * trial.settings.poll)


def bar_tilt(trial: burg.HandTrial, share: float) -> float:
    """Tilt of the bar at a share of the friction that just holds it [rad]."""
    friction = share * bar_friction()
    return trial.run("bar", from_above(0.02, LEVER), friction=friction).margins.tilt


def patch(trial: burg.HandTrial) -> float:
    """Contact area of the ball, to that of an elastic foundation."""
    depth = np.sqrt(FORCE / (np.pi * STIFFNESS * RADIUS))
    result = trial.run("ball", from_above(RADIUS))
    return result.margins.patch_area / (2 * np.pi * RADIUS * depth)


def bar_friction() -> float:
    """Smallest coefficient that keeps the bar level: a patch that begins to turn about a point
    beside its middle, every spot rubbing across the line to that point."""
    n = 200
    x, z = np.meshgrid(*(((np.arange(n) + 0.5) / n - 0.5) * size for size in PAD[::2]))

    def rubbing(centre: float) -> tuple[float, float]:
        r = np.hypot(x + centre, z)
        force_x, force_z = -z / r, (x + centre) / r
        return float(force_z.mean()), float((x * force_z - z * force_x).mean())

    def excess(centre: float) -> float:
        force, moment = rubbing(centre)
        return moment - LEVER * force

    return BAR_MASS * GRAVITY / (2 * FORCE) / rubbing(brentq(excess, 1e-6, 1.0))[0]


def bisected(holds: Callable[[float], bool], low: float = 0.5, high: float = 2.0) -> float:
    """Where `holds` changes, within 0.5 %; NaN if not in the range."""
    if not holds(high) or holds(low):
        return np.nan
    while high - low > 0.01:
        middle = (low + high) / 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return (low + high) / 2


def from_above(z: float, y: float = 0.0) -> Array:
    """Grasp (4, 4) from above that closes along x."""
    return grasp_from_axes((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, y, z))


# --- scenes and hands ---------------------------------------------------------------------------


def make_shapes(out: Path, subdivisions: int | None = None) -> Path:
    """Library of box, bar and ball: as primitives, or as meshes of triangles that are divided."""
    contact: ContactKind = "primitive" if subdivisions is None else "mesh"
    divided = subdivisions or 0
    ball = trimesh.creation.icosphere(subdivisions=3 if subdivisions is None else divided + 1)
    ball.apply_scale(RADIUS)
    ball.apply_translation((0.0, 0.0, RADIUS))
    meshes = {
        "box": (box((0.06, 0.09, 0.08), divided), BOX_MASS),
        "bar": (box((0.03, 0.30, 0.04), divided), BAR_MASS),
        "ball": (ball, 0.1),
    }
    sources = [
        ObjectSource(name=name, mesh=mesh, mass=mass, contact=contact)
        for name, (mesh, mass) in meshes.items()
    ]
    report = burg.build_library(sources, out, confirm=False)
    if report.failed:
        raise RuntimeError(str(report.failed))
    return out


def box(size: tuple[float, float, float], subdivisions: int) -> trimesh.Trimesh:
    """A box on its origin, each triangle divided in four so many times."""
    mesh = trimesh.creation.box(size)
    mesh.apply_translation((0.0, 0.0, size[2] / 2))
    for _ in range(subdivisions):
        mesh = mesh.subdivide()
    return mesh


def make_scene(library: Path, name: str) -> Scene:
    """One object in the middle of a board."""
    document = SceneDocument(
        name=name,
        library=str(library),
        board=Board(size=(0.6, 0.4)),
        instances=(Instance(object=name, X_SO=Pose((0.3, 0.2, 0.0))),),
    )
    save_scene(document, library / f"{name}.yaml")
    return burg.load_scene(library / f"{name}.yaml")


def make_station(hand_model: Path | None = None) -> Station:
    """The Panda hand over a table."""
    hand = load_hand("panda_hand")
    document = StationDocument(name="convergence", table=Table(center=(0.3, 0.2)))
    return Station(
        document, hand, hand_model or resolve_reference(hand.model), None, Path("convergence")
    )


def pad_model(folder: Path, n: int) -> Path:
    """A copy of the hand whose pads' fronts are divided into n x n squares."""
    model = resolve_reference(load_hand("panda_hand").model)
    shutil.copytree(model.parent, folder)
    (folder / "meshes" / "pad.vtk").write_text(pad_vtk(PAD, front=squares(n)))
    return folder / model.name


if __name__ == "__main__":
    main()
