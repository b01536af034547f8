"""The whole arm: plan a grasp, execute the plan as a trial, and run it in a diagram of your own."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

import burg_drake as burg

scene, station = burg.load_scene("tabletop_six"), burg.load_station("panda_tabletop")
settings = burg.SamplingSettings(from_arm_side=True)
grasps = burg.sample_grasps(scene, station, 20, settings=settings, only=["box"])

# Planned one after the other until the arm can execute one; Planner is for many.
planner = burg.Planner(burg.ArmReach(scene, station))
for X_OG, width in zip(grasps.X_OG, grasps.width, strict=True):
    plan = planner.plan("box", X_OG, float(width))
    if isinstance(plan, burg.Plan):
        break
    print(f"not this one: {plan.outcome} {plan.blocker}")
else:
    raise SystemExit("the arm can execute none of these grasps")
times = {name: part.duration for name, part in plan.phases.items()}
print(", ".join(f"{name} {duration:.2f} s" for name, duration in times.items()))

result = burg.ArmTrial(scene, station).run("box", X_OG, plan)
print(f"as a trial: {result.outcome}, slip {1e3 * result.margins.slip:.2f} mm")
print(f"the arm was within {1e3 * result.margins.tracking_error:.1f} mrad of its command")

# The same motion by sources of your own: connect the arm and the hand, watch in a browser.
meshcat = Meshcat()
built = burg.build_station_diagram(scene, station, meshcat=meshcat)
hand = station.hand
speed = hand.closing_speed
opened = [*(finger.open for finger in hand.fingers), speed, speed]  # positions, then velocities
closed = [*(finger.closed for finger in hand.fingers), -speed, -speed]
close = times["transfer"] + times["approach"]
commands = np.array([opened, closed, closed]).T

builder = DiagramBuilder()
builder.AddSystem(built.diagram)
arm_source = builder.AddSystem(TrajectorySource(plan.to_drake(), output_derivative_order=1))
hand_source = builder.AddSystem(
    TrajectorySource(PiecewisePolynomial.ZeroOrderHold([0.0, close, plan.duration + 1.0], commands))
)
builder.Connect(arm_source.get_output_port(), built.diagram.GetInputPort("arm.desired_state"))
builder.Connect(hand_source.get_output_port(), built.diagram.GetInputPort("hand.desired_state"))
builder.ExportOutput(built.diagram.GetOutputPort("arm.actuation"), "torque")
diagram = builder.Build()

simulator = Simulator(diagram)
box = built.plant.get_body(built.free["box"])
end = 0.0
for name, duration in times.items():
    end += duration
    simulator.AdvanceTo(end)
    context = built.plant.GetMyContextFromRoot(simulator.get_context())
    height = built.plant.EvalBodyPoseInWorld(context, box).translation()[2]
    torque = diagram.GetOutputPort("torque").Eval(simulator.get_context())
    print(f"{name}: box at {height:.3f} m, joints with up to {np.abs(torque).max():.1f} Nm")
