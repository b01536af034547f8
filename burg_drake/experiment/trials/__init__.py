"""Trials on the robot: which grasps, in which order, and what became of each."""
