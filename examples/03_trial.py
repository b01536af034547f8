"""One grasp trial: sample grasps on an object, execute one that is clear, read the outcome."""

from __future__ import annotations

import burg_drake as burg

scene, station = burg.load_scene("tabletop_six"), burg.load_station("panda_tabletop")
mesh = scene.library.surface("box")
settings = burg.grasps.AntipodalSettings(opening=station.hand.opening)
rng = burg.frames.rng_from("example")
grasps = burg.grasps.sample_antipodal(mesh, 500, rng, settings, object="box")

trial = burg.HandTrial(scene, station)  # one diagram for all trials of the scene
X_WG = trial.diagram.X_WO("box") @ grasps.X_OG
clear = [i for i, X in enumerate(X_WG) if trial.clearance.check("box", X).outcome is None]
print(f"the open hand is clear at {len(clear)} of {len(grasps)} sampled grasps")

result = trial.run("box", grasps.X_OG[clear[0]])
print(f"outcome: {result.outcome}")
print(f"slip {1e3 * result.margins.slip:.2f} mm, pad force {result.margins.pad_force:.1f} N")
print("with oil on the box:", trial.run("box", grasps.X_OG[clear[0]], friction=0.02).outcome)
