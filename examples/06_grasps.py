"""Grasps on their own: sample them, measure them, compare sets, hand them to others and back."""

from __future__ import annotations

import tempfile
from pathlib import Path

import burg_drake as burg

scene, station = burg.load_scene("tabletop_six"), burg.load_station("panda_tabletop")
settings = burg.SamplingSettings(from_arm_side=True)
grasps = burg.sample_grasps(scene, station, 200, settings=settings, only=["mug", "box"])
print(f"{len(grasps)} grasps at which the open hand is clear")

scored = burg.grasps.scored_set(grasps, scene.library, station, scene)
for name in ("friction_needed", "epsilon", "gravity_margin", "clearance"):
    low, high = min(scored.column(name)), max(scored.column(name))
    print(f"{name:15} {low:7.4f} to {high:7.4f}")

mugs = scored.select(scored.object == "mug")
few = mugs.select(burg.grasps.farthest_points(mugs.X_OG, 40))
found = burg.grasps.coverage(mugs, few)  # within 15 mm and 15 degrees
print(f"the {len(few)} grasps of the mug that are farthest apart cover {found.overall.value:.0%}")

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder, "mug.yaml")
    for note in burg.grasps.write_grasp_file(mugs, path, format="isaac_grasp"):
        print(f"note: {note}")
    theirs = burg.grasps.read_grasp_file(path)
    print(f"read back {len(theirs.grasps)} grasps, in the {theirs.frame} frame")
