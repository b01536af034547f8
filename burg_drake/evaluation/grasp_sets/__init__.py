"""Sets of grasps: sampled ones, those of files and runs, their counts, and their usual mistakes.

Read `input` and `given_grasps` for grasps from elsewhere, `sampling` and `sampled_sets` for others.
"""
