"""Pose of a camera over the printed board, by the edges of all markers.

Read `board_pose` first. It goes from `marker_detection` over `coarse_pose` to `edge_refinement`;
`board_estimate` averages over images.
"""
