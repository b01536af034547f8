"""Collision geometry: cylinders and capsules that cover the housings of the arm.

Radii and lengths are those of the manufacturer's meshes (Universal_Robots_ROS2_Description, as
converted for MuJoCo Menagerie; BSD-3), of which nothing but these outer dimensions is used: joints
of 120 and 78 mm, tubes that taper from 116 to 90 and from 80 to 75 mm. All lengths in m, all points
in the frame of the link. The round end of a capsule reaches into the neighbouring link.
"""

from __future__ import annotations

from tools.robot_model.shapes import Box, Capsule, Cylinder, Shape

BASE_SHAPES: tuple[Shape, ...] = (
    Cylinder("plate", 0.0755, (0.0, 0.0, 0.0), (0.0, 0.0, 0.046)),
    Cylinder("column", 0.0600, (0.0, 0.0, 0.046), (0.0, 0.0, 0.099)),
)
"""The base."""

LINK_SHAPES: tuple[tuple[Shape, ...], ...] = (
    (
        Cylinder("tube", 0.0605, (0.0, 0.0, -0.064), (0.0, 0.0, 0.064)),
        Capsule("drum", 0.0605, (0.0, 0.0, 0.006), (0.0, -0.0745, 0.006)),
    ),
    (
        Cylinder("shoulder", 0.0605, (0.0, 0.0, 0.074), (0.0, 0.0, 0.210)),
        Capsule("tube", 0.0585, (0.0, 0.0, 0.138), (-0.120, 0.0, 0.138)),
        Capsule("bar", 0.0525, (-0.120, 0.0, 0.138), (-0.425, 0.0, 0.138)),
        Cylinder("elbow", 0.0605, (-0.425, 0.0, 0.060), (-0.425, 0.0, 0.210)),
    ),
    (
        Capsule("elbow", 0.0585, (0.0, 0.0, 0.060), (0.0, 0.0, 0.018)),
        Capsule("tube", 0.0480, (-0.010, 0.0, 0.007), (-0.080, 0.0, 0.007)),
        Capsule("bar", 0.0400, (-0.080, 0.0, 0.007), (-0.3922, 0.0, 0.007)),
        Cylinder("wrist", 0.0395, (-0.3922, 0.0, -0.0495), (-0.3922, 0.0, 0.0605)),
    ),
    (
        Capsule("tube", 0.0385, (0.0, 0.0, -0.074), (0.0, 0.0, 0.0)),
        Cylinder("drum", 0.0395, (0.0, -0.0540, 0.0), (0.0, 0.0565, 0.0)),
    ),
    (
        Capsule("tube", 0.0385, (0.0, 0.0, -0.0465), (0.0, 0.0, 0.0)),
        Cylinder("drum", 0.0395, (0.0, -0.0570, 0.0), (0.0, 0.0535, 0.0)),
    ),
    (
        Cylinder("flange", 0.0380, (0.0, 0.0, -0.047), (0.0, 0.0, 0.0)),
        Box("plug", (0.032, 0.012, 0.018), (0.0, -0.0375, -0.0315)),
    ),
)
"""Of the links that the joints move."""

NEVER_MEET: tuple[tuple[str, str], ...] = (
    ("base", "upper_arm_link"),
    ("wrist_1_link", "wrist_3_link"),
)
"""Links that are 14 and 15 mm apart in every posture: not worth a look, and so near that quick
bounds of the clearance could never tell."""
