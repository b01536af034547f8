"""Durations of planned motions, what they cost, and how far they are from what no motion can beat.

    python benchmarks/timing.py [SCENE] [--stations S ...] [--grasps N]

Plans grasps that the open hand is clear for, from home over pregrasp and grasp to the top of the
lift. The bounds know velocity and acceleration alone, no jerk: for the transfer those of each joint
from end to end, whatever the path; for the lines Drake's `Toppra` (joints, along the very path) and
the hand's own limits. Every sample is asked to Drake's collision checker, of some plans.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from pydrake.multibody.optimization import CalcGridPointsOptions, Toppra
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces
from pydrake.trajectories import PiecewisePolynomial
from reach import Grasps, clear_grasps

from burg_drake.core import Array, data_root
from burg_drake.motion import (
    ArmKinematics,
    ArmLimits,
    ArmReach,
    Plan,
    Planner,
    Trajectory,
    line_error,
    time_motion,
)
from burg_drake.scene import load_scene
from burg_drake.station import Station, load_station

AUDITED = 40
"""Plans whose samples are asked to Drake, every `EVERY`th."""
EVERY = 5
TORQUES = 20
"""Plans whose torques are computed."""


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scene", nargs="?", default="tabletop_six")
    stations = ["panda_tabletop", "panda_bin", "panda_shelf"]
    parser.add_argument("--stations", nargs="+", default=stations)
    parser.add_argument("--grasps", type=int, default=100, help="to plan")
    arguments = parser.parse_args()
    scene = load_scene(arguments.scene)
    for name in arguments.stations:
        station = load_station(name)
        grasps = clear_grasps(scene, station, arguments.grasps)
        planner = Planner(ArmReach(scene, station))
        measure(planner, grasps, f"{scene.name} on {station.name}")


def measure(planner: Planner, grasps: Grasps, title: str) -> None:
    """Plans the grasps and prints figures."""
    reaches = planner.reach.check_all(grasps.instance, grasps.X_WG, grasps.width)
    plans: list[tuple[str, Plan]] = []
    cost, alone, stops = [], [], 0.0
    for instance, reach, width in zip(grasps.instance, reaches, grasps.width, strict=True):
        if reach.path is None:
            continue
        start = time.process_time()
        plan = planner.time(instance, reach.path, float(width))
        cost.append(1e3 * (time.process_time() - start))
        start = time.process_time()
        unchecked = time_motion(reach.path, planner.limits, planner.reach.kinematics)
        alone.append(1e3 * (time.process_time() - start))
        stops += float(unchecked.transfer.duration)
        plans.append((instance, plan))
    print(f"\n{title}: {len(plans)} of {len(reaches)} grasps have a plan")
    if not plans:
        return
    line("CPU time, with shortcut and collision checks", cost, "ms")
    line("CPU time of the timing alone", alone, "ms")
    limits, arm = planner.limits, planner.reach.kinematics
    plant = arm_alone(planner.reach.diagram.station)
    for name in ("transfer", "approach", "lift"):
        parts = [getattr(plan, name) for _, plan in plans]
        bounds = [bound(part, name, planner, plant) for part in parts]
        line(f"{name}: duration", [part.duration for part in parts], "s")
        line("  over the bound", [p.duration / b for p, b in zip(parts, bounds, strict=True)], "")
        loads = [torques(part, planner) for part in parts[:TORQUES]]
        line("  torque beside gravity, of the limit", [torque for torque, _ in loads], "")
        line("  change of torque", [rate for _, rate in loads], "Nm/s")
        used = [limits.time_scale(part.peaks()) for part in parts]
        print(f"  largest use of a limit {max(used):.4f}")
        if name != "transfer":
            print(
                f"  hand beside its line at most {1e3 * max(beside(arm, p) for p in parts):.3f} mm"
            )
    line("whole plan", [plan.duration for _, plan in plans], "s")
    total = sum(plan.transfer.duration for _, plan in plans)
    print(f"transfers as they were found, with a stop at each corner: {stops / total:.2f} times")
    faults = sum(collides(planner, instance, plan) for instance, plan in plans[:AUDITED])
    print(f"of {len(plans[:AUDITED])} audited plans {faults} collide", flush=True)


def line(label: str, values: list[float], unit: str) -> None:
    """Prints what is usual and what is most."""
    median, most, worst = np.percentile(values, (50, 90, 100))
    print(f"{label:46} median {median:6.2f} {unit:2} 90 % {most:6.2f} largest {worst:6.2f}")


def trapezoid(way: Array, velocity: Array, acceleration: Array) -> Array:
    """Least time from rest to rest."""
    rise = velocity / acceleration
    cruise = way / velocity + rise
    return np.asarray(np.where(way > velocity * rise, cruise, 2.0 * np.sqrt(way / acceleration)))


def arm_alone(station: Station) -> MultibodyPlant:
    """The plant that `Toppra` wants."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().Add("burg_drake", str(data_root()))
    parser.AddModels(str(station.arm_model))
    assert station.document.arm is not None
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(station.document.arm.base))
    plant.Finalize()
    return plant


def bound(part: Trajectory, name: str, planner: Planner, plant: MultibodyPlant) -> float:
    """What no motion can be faster than [s]."""
    limits, settings = planner.limits, planner.settings
    if name == "transfer":
        way = np.abs(part.q[-1] - part.q[0])
        return float(trapezoid(way, limits.velocity, limits.acceleration).max())
    p = planner.reach.kinematics.forward(part.q[[0, -1]])[0][:, :3, 3]
    way = np.linalg.norm(p[1] - p[0])
    if name == "approach":
        speed, acceleration = settings.approach_speed, settings.approach_acceleration
    else:
        speed, acceleration = np.inf, 4.0 * way / settings.lift_time**2
    hand = 2.0 * np.sqrt(way / acceleration)
    if way > speed**2 / acceleration:
        hand = way / speed + speed / acceleration
    return max(float(hand), along(part, limits, plant))


def along(part: Trajectory, limits: ArmLimits, plant: MultibodyPlant) -> float:
    """Drake's time-optimal parameterization of the same path [s]; 0 where it fails."""
    moved = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(part.q, axis=0), axis=1)))
    at = np.interp(np.linspace(0.0, moved[-1], 60), moved, part.t)
    path = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(
        np.linspace(0.0, moved[-1], 60), part.at(at).T, False
    )
    grid = Toppra.CalcGridPoints(path, CalcGridPointsOptions())
    toppra = Toppra(path, plant, grid)
    toppra.AddJointVelocityLimit(-limits.velocity, limits.velocity)
    toppra.AddJointAccelerationLimit(-limits.acceleration, limits.acceleration)
    result = toppra.SolvePathParameterization()
    if result is None or not np.isfinite(result.get_segment_times()).all():
        return 0.0
    return float(result.end_time())


def beside(arm: ArmKinematics, part: Trajectory) -> float:
    """How far the hand leaves its straight line [m]."""
    X = arm.forward(part.q)[0]
    return line_error(X, X[0], X[-1])


def torques(part: Trajectory, planner: Planner) -> tuple[float, float]:
    """Largest torque of a joint, relative to its limit, and change of it [Nm/s]; rotors count, and
    gravity does not, which Franka's controller compensates for."""
    plant = planner.reach.diagram.plant
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    joints = planner.reach.diagram.arm_joints
    places = [joint.velocity_start() for joint in joints]
    found = []
    for q, v, a in zip(part.q, part.v, part.a, strict=True):
        for joint, angle, rate in zip(joints, q, v, strict=True):
            joint.set_angle(context, angle)
            joint.set_angular_rate(context, rate)
        known = np.zeros(plant.num_velocities())
        known[places] = a
        found.append(plant.CalcInverseDynamics(context, known, forces)[places])
    load = np.array(found)
    change = np.abs(np.diff(load, axis=0)).max() / float(part.t[1])
    return float((np.abs(load) / planner.limits.torque).max()), float(change)


def collides(planner: Planner, instance: str, plan: Plan) -> bool:
    """Whether Drake's checker finds a collision at a sample."""
    collision, arm = planner.reach._tree.edges.collision, planner.reach.kinematics
    for part in (plan.transfer, plan.approach):
        if not all(collision.is_free(q) for q in part.q[::EVERY]):
            return True
    q = plan.lift.q[::EVERY]
    X_WA = planner.reach.diagram.station.document.arm.X_WA.matrix()
    z = arm.forward(q)[0][:, :3, 3] @ X_WA[2, :3]
    rises = np.maximum(0.0, z - z[0])
    return not all(
        collision.is_free(row, carried=instance, moved_W=(0.0, 0.0, float(rise)))
        for row, rise in zip(q, rises, strict=True)
    )


if __name__ == "__main__":
    main()
