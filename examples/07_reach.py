"""Which grasps the arm can execute, what hinders it at the others, and a motion for one of them."""

from __future__ import annotations

from collections import Counter

import burg_drake as burg

scene, station = burg.load_scene("tabletop_six"), burg.load_station("panda_bin")
grasps = burg.sample_grasps(scene, station, 8, only=["bowl", "banana"])

judged = burg.reach(scene, station, grasps)
for outcome, count in Counter(judged.column("outcome").tolist()).most_common():
    blockers = set(judged.column("blocker")[judged.column("outcome") == outcome].tolist()) - {""}
    print(f"{count:4d} {outcome}", *sorted(blockers))

good = judged.select(judged.column("outcome") == "reachable")
found = burg.plan(
    scene, station, str(good.column("instance")[0]), good.X_OG[0], width=float(good.width[0])
)
assert isinstance(found, burg.Plan)
for name, phase in found.phases.items():
    velocity, _, _ = phase.peaks()
    print(f"{name:9s} {phase.duration:5.2f} s, fastest joint {velocity.max():.2f} rad/s")
