# ruff: noqa: F401
"""What a user gets wrong: type checkers report each line that says so. It is not run."""

from __future__ import annotations

import burg_drake as burg
from burg_drake import no_such_name  # wrong: unknown name
from burg_drake.grasps import sample_antipodes  # wrong: unknown name

scene, station = burg.load_scene("tabletop_six"), burg.load_station("panda_tabletop")

burg.no_such_name  # wrong: unknown name  # noqa: B018
burg.cameras.Lens  # wrong: unknown name  # noqa: B018
burg.sample_antipodal  # wrong: it is in burg.grasps  # noqa: B018
scene.instance_names  # wrong: unknown attribute  # noqa: B018
burg.load_scene(3)  # wrong: neither name nor path
burg.evaluate("scene", 3, nonsense=True)  # wrong: all of it
burg.sample_grasps(scene, station, "many")  # wrong: type
burg.build_station_diagram(scene, station, robot="legs")  # wrong: no such choice
burg.HandTrial(scene)  # wrong: what hand?
burg.HandTrial(scene, station).run("mug")  # wrong: which grasp?
burg.SamplingSettings(frictions=0.3)  # wrong: unknown argument
burg.ENGINES["standard"].time_step = 0.001  # wrong: frozen
burg.plan(scene, station, "mug", []).duration  # wrong: it may be out of reach  # noqa: B018
count: int = burg.GraspSet.load("grasps.npz").width  # wrong: an array
