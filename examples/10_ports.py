"""The ports of a driven station: commands, a camera, what the robot feels, and a plan to play."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.analysis import Simulator

import burg_drake as burg

scene, station = burg.load_scene("tabletop_six"), burg.load_station("panda_tabletop")
meshcat, engine = Meshcat(), burg.ENGINES["screening"]
built = burg.build_station_diagram(
    scene, station, drivers=True, cameras=["board"], engine=engine, meshcat=meshcat
)
diagram, context = built.diagram, built.diagram.CreateDefaultContext()
simulator = Simulator(diagram, context)


def give(port: str, value: object) -> None:
    """From now on; a system of your own would be connected."""
    diagram.GetInputPort(port).FixValue(context, value)


def read(port: str) -> Any:
    """What a port says now."""
    return diagram.GetOutputPort(port).Eval(context)


home = np.array(station.document.arm.home)
for time in np.arange(0.0, 0.8, 0.02):  # the wrist swings, the hand half closes and opens
    simulator.AdvanceTo(time)
    give("arm.position", home + 0.2 * np.sin(np.pi * time / 0.78) ** 2 * np.eye(7)[6])
    give("hand.position", [0.04 if time < 0.4 else 0.08])
simulator.AdvanceTo(1.0)

image, cloud = read("camera.board.color_image").data, read("camera.board.point_cloud")
meshcat.SetObject("cloud", cloud, point_size=0.003)
print(f"image of {image.shape[1]} x {image.shape[0]} pixels, cloud of {cloud.size()} points")

planner = burg.Planner(burg.ArmReach(scene, station))
settings = burg.SamplingSettings(from_arm_side=True)
grasps = burg.sample_grasps(scene, station, 20, settings=settings, only=["box"])
plans = (planner.plan("box", X, float(w)) for X, w in zip(grasps.X_OG, grasps.width, strict=True))
plan = next(plan for plan in plans if isinstance(plan, burg.Plan))
give("plan", plan)
give("plan.start_time", [end := 1.0])
for name, phase in plan.phases.items():
    simulator.AdvanceTo(end := end + phase.duration)
    state, torque = read("arm.estimated_state"), read("arm.external_torque")
    wrist, force = read("wrist.force_torque"), read("hand.force_measured")
    contacts = read("contact_results").num_hydroelastic_contacts()
    print(
        f"{name}: joints {1e3 * np.abs(state[:7] - phase.q[-1]).max():.1f} mrad off and with up to"
        f" {np.abs(torque).max():.1f} Nm of the world, {np.linalg.norm(wrist[3:]):.1f} N at the"
        f" wrist, {contacts} contacts, pads press with {np.abs(force[0]):.1f} N"
    )
