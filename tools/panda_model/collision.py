"""Collision geometry: simple primitives that hug the real links and cover their visual meshes.

Capsules for the round arm links, boxes for hand and fingers: cheap in collision checks. The pads
alone bring a tetrahedral mesh of their own (`pad_mesh`). All lengths in m, all poses in the frame
of the link B.
"""

from __future__ import annotations

from math import pi

from tools.robot_model.shapes import PAD, Box, Capsule, Cylinder, Shape


def _turned(shapes: tuple[Capsule, ...], sign: float, shift: float) -> tuple[Capsule, ...]:
    """Capsules turned by 90 deg times `sign` about x, then moved by `shift` [m] along x.

    The halves of the shoulder (links 1 and 2) are the same part, as are those of the elbow (3, 4).
    """

    def turned(p: tuple[float, float, float]) -> tuple[float, float, float]:
        return (p[0] + shift, -sign * p[2], sign * p[1])

    return tuple(Capsule(s.name, s.radius, turned(s.p_BStart), turned(s.p_BEnd)) for s in shapes)


_SHOULDER = (
    Capsule("tube", 0.0565, (0.0, 0.0, -0.192), (0.0, 0.0, -0.118)),
    Capsule("bend", 0.0560, (0.0, 0.0, -0.118), (0.0, -0.046, -0.040)),
    Capsule("drum", 0.0570, (0.0, 0.0, 0.0), (0.0, -0.074, 0.0)),
)
"""Link 1. The round end of a capsule reaches into the neighbour that turns about the same axis."""
_ELBOW = (
    Capsule("tube", 0.0565, (0.0, 0.0, -0.121), (0.0, 0.0, -0.071)),
    Capsule("web", 0.0460, (0.012, 0.006, -0.060), (0.062, 0.022, -0.014)),
    Capsule("drum", 0.0590, (0.0825, 0.0, 0.0), (0.0825, 0.055, 0.0)),
)
"""Link 3."""
_LEAN = -0.159
"""The flat bar of the forearm leans by this [rad]."""

ARM_SHAPES: tuple[tuple[Shape, ...], ...] = (
    (
        Box("plate", (0.230, 0.192, 0.010), (-0.041, 0.0, 0.005)),
        Box("foot", (0.158, 0.150, 0.050), (-0.058, 0.0, 0.025)),
        Box("heel", (0.128, 0.144, 0.040), (-0.054, 0.0, 0.070)),
        Box("back", (0.070, 0.110, 0.030), (-0.045, 0.0, 0.100)),
        Cylinder("column", 0.0710, (0.0, 0.0, 0.0), (0.0, 0.0, 0.100)),
        Cylinder("neck", 0.0600, (0.0, 0.0, 0.100), (0.0, 0.0, 0.141)),
    ),
    _SHOULDER,
    _turned(_SHOULDER, -1.0, 0.0),
    _ELBOW,
    _turned(_ELBOW, 1.0, -0.0825),
    (
        Capsule("tube", 0.0565, (0.0, 0.0, -0.259), (0.0, 0.002, -0.222)),
        Capsule("calf", 0.0460, (0.0, 0.018, -0.208), (0.0, 0.050, -0.168)),
        Box("bar", (0.068, 0.044, 0.200), (0.0, 0.086, -0.105), (_LEAN, 0.0, 0.0)),
        Capsule("drum", 0.0520, (0.0, 0.0165, 0.0), (0.0, 0.082, 0.0)),
    ),
    (
        Capsule("drum", 0.0500, (0.0, 0.0, 0.003), (0.022, 0.0, 0.008)),
        Capsule("bridge", 0.0470, (0.030, 0.003, 0.006), (0.074, 0.034, 0.001)),
        Cylinder("wrist", 0.0460, (0.088, -0.0512, 0.0), (0.088, 0.062, 0.0)),
        Capsule("end", 0.0455, (0.088, 0.020, 0.0), (0.088, 0.0370, 0.0)),
    ),
    (
        Cylinder("body", 0.0450, (0.0, 0.0, 0.0512), (0.0, 0.0, 0.0985)),
        Cylinder("flange", 0.0320, (0.0, 0.0, 0.0985), (0.0, 0.0, 0.1070)),
        Box("lug", (0.086, 0.061, 0.036), (0.0512, 0.0512, 0.0795), (0.0, 0.0, pi / 4)),
    ),
)
"""Collision shapes of links 0 to 7."""

HAND_SHAPES: tuple[Shape, ...] = (
    Box("body", (0.0510, 0.204, 0.039), (0.0, 0.0, 0.0105)),
    Box("nose", (0.0444, 0.204, 0.0364), (0.0, 0.0, 0.0482)),
    # The flange and the bracket. The real bracket is on the side of +y; here it is on both sides,
    # so that a grasp with its fingers swapped gets the same verdict.
    Box("mount", (0.0630, 0.184, 0.0165), (0.0, 0.0, -0.0005)),
)
"""Collision shapes of the hand without fingers; its cable is left out."""

LEFT_FINGER_SHAPES: tuple[Box, ...] = (
    # 7.58 mm in franka_ros, which lets the closed pads overlap by 0.04 mm.
    Box(PAD, (0.0175, 0.0152, 0.0185), (0.0, 0.0076, 0.04525)),
    Box("diagonal", (0.0175, 0.007, 0.0235), (0.0, 0.0159, 0.02835), (pi / 6, 0.0, 0.0)),
    Box("screw_mount", (0.022, 0.015, 0.020), (0.0, 0.0185, 0.011)),
    Box("sledge", (0.022, 0.0088, 0.0038), (0.0, 0.0068, 0.0022)),
)
"""Collision shapes of the left finger (franka_ros, franka_hand.xacro)."""
