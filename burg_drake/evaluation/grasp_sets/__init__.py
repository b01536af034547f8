"""Grasp sets: sampling, reading from files and runs, counts, and common mistakes.

Read `input` and `given_grasps` for grasps of files, `sampling` and `sampled_sets` for sampled ones.
"""
