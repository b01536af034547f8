"""Which grasps the arm can execute, what hinders it at the others, and a motion for one of them."""

from __future__ import annotations

from collections import Counter

from burg_drake import Plan, load_scene, load_station, plan, reach, sample_grasps

scene, station = load_scene("tabletop_six"), load_station("panda_bin")
grasps = sample_grasps(scene, station, 8, only=["bowl", "banana"])

judged = reach(scene, station, grasps)
for outcome, count in Counter(judged.column("outcome").tolist()).most_common():
    blockers = set(judged.column("blocker")[judged.column("outcome") == outcome].tolist()) - {""}
    print(f"{count:4d} {outcome}", *sorted(blockers))

good = judged.select(judged.column("outcome") == "reachable")
found = plan(
    scene, station, str(good.column("instance")[0]), good.X_OG[0], width=float(good.width[0])
)
assert isinstance(found, Plan)
for name, phase in found.phases.items():
    velocity, _, _ = phase.peaks()
    print(f"{name:9s} {phase.duration:5.2f} s, fastest joint {velocity.max():.2f} rad/s")
