"""The station as a part of one's own Drake diagram, commanded through its named ports."""

from __future__ import annotations

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, LeafSystem

import burg_drake as burg


class Wave(LeafSystem):
    """Desired state of the arm: the home posture with the wrist swinging."""

    def __init__(self, home: np.ndarray) -> None:
        super().__init__()
        self.home = home
        self.DeclareVectorOutputPort("arm", 2 * len(home), self.arm)
        self.DeclareVectorOutputPort("hand", 4, self.hand)

    def arm(self, context: Context, output: BasicVector) -> None:
        """Positions, then velocities, of the seven joints."""
        q, v = self.home.copy(), np.zeros_like(self.home)
        q[6] += 0.5 * np.sin(np.pi * context.get_time())
        v[6] = 0.5 * np.pi * np.cos(np.pi * context.get_time())
        output.SetFromVector(np.concatenate([q, v]))

    def hand(self, context: Context, output: BasicVector) -> None:
        """The fingers follow the velocity: they close at 20 mm/s."""
        output.SetFromVector([0.0, 0.0, -0.02, -0.02])


station = burg.load_station("panda_tabletop")
home = np.array(station.document.arm.home)
built = burg.build_station_diagram(burg.load_scene("tabletop_six"), station, robot="arm")

builder = DiagramBuilder()
builder.AddSystem(built.diagram)
wave = builder.AddSystem(Wave(home))
builder.Connect(wave.GetOutputPort("arm"), built.diagram.GetInputPort("arm.desired_state"))
builder.Connect(wave.GetOutputPort("hand"), built.diagram.GetInputPort("hand.desired_state"))
builder.ExportOutput(built.diagram.GetOutputPort("arm.state"), "arm.state")
builder.ExportOutput(built.diagram.GetOutputPort("hand.state"), "hand.state")
diagram = builder.Build()

simulator = Simulator(diagram)
for time in (0.5, 1.0, 1.5):
    simulator.AdvanceTo(time)
    q = diagram.GetOutputPort("arm.state").Eval(simulator.get_context())[:7]
    fingers = diagram.GetOutputPort("hand.state").Eval(simulator.get_context())[:2]
    error = q - home
    error[6] -= 0.5 * np.sin(np.pi * time)
    print(
        f"{time:.1f} s: wrist at {q[6]:+.3f} rad, arm within {1e3 * np.abs(error).max():.1f} mrad"
        f" of its command, opening {1e3 * fingers.sum():.1f} mm"
    )
