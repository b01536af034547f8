"""A scene as a Drake diagram: load it, check it, simulate it for half a second."""

from __future__ import annotations

import numpy as np
from pydrake.systems.analysis import Simulator

import burg_drake as burg

scene = burg.load_scene("tabletop_six")
station = burg.load_station("panda_tabletop")
print(f"{scene.name}: {', '.join(scene.instances)} on {station.name}")
for issue in burg.check_scene(scene, station):  # bounds of the board, ground, overlaps
    print(issue.message)

built = burg.build_station_diagram(scene, station, robot="none")
simulator = Simulator(built.diagram)
simulator.AdvanceTo(0.5)

context = built.plant.GetMyContextFromRoot(simulator.get_context())
for name, body in built.free.items():
    p_WO = built.plant.EvalBodyPoseInWorld(context, built.plant.get_body(body)).translation()
    moved = np.linalg.norm(p_WO - built.X_WO(name)[:3, 3])
    print(f"{name:12s} at {np.round(p_WO, 3)} m, moved {1e3 * moved:.3f} mm in half a second")
