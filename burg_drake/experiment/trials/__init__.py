"""The trials on the robot: which grasps, in which order, and how each trial ended.

Read `trial_sheet` first, then `trial_book` and `motion_export`."""
