"""Intrinsics of a camera from images of a ChArUco board, and how far they can be trusted.

Read `charuco_target`, `estimation` and `lens_fit`, then `lens_uncertainty` and `view_guidance`.
"""
