"""The trials on the robot: which grasps, in which order, and what became of each.

Read `sheet` first, then `entries` and `export`."""
