"""Where cameras stand: on a sphere around a point, and near a place that they are meant for."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array, make_pose, rot_z, rotation_from_quaternion
from burg_drake.dataset.views.settings import ViewpointSettings


def looking_at(
    p_ST: Array, distance: float, elevation: float, azimuth: float, roll: float = 0.0
) -> Array:
    """`X_SC` (4, 4) of a camera that looks at a point.

    Args:
        p_ST: (3,) the point [m].
        distance: of the camera from it [m].
        elevation: of the camera above the point's level [rad].
        azimuth: of the camera, from x, counter-clockwise about z [rad].
        roll: about the optical axis [rad]; at 0 the camera's x axis is level.
    """
    (se, ce), (sa, ca) = ((np.sin(a), np.cos(a)) for a in (elevation, azimuth))
    outward = np.array([ce * ca, ce * sa, se])
    right = np.array([-sa, ca, 0.0])
    R_SC = np.stack([right, np.cross(-outward, right), -outward], axis=1) @ rot_z(roll)
    return make_pose(R_SC, p_ST + distance * outward)


def draw_on_sphere(settings: ViewpointSettings, p_SM: Array, rng: np.random.Generator) -> Array:
    """`X_SC` (4, 4) of a camera on a sphere around a point near the scene's middle `p_SM` (3,);
    uniform on the part of the sphere that the settings allow."""
    low, high = np.sin(np.deg2rad(settings.elevation_deg))
    elevation = np.arcsin(np.clip(rng.uniform(low, high), -1.0, 1.0))
    azimuth, roll = np.deg2rad(
        [rng.uniform(*settings.azimuth_deg), rng.uniform(*settings.roll_deg)]
    )
    distance = rng.uniform(*settings.distance)
    p_ST = p_SM + in_ball(settings.aim, rng)
    return looking_at(p_ST, distance, float(elevation), float(azimuth), float(roll))


def jittered(X_SC: Array, settings: ViewpointSettings, rng: np.random.Generator) -> Array:
    """A camera (4, 4) somewhat beside its place and turned a little; exactly there without
    jitter."""
    offset = in_ball(settings.position_jitter, rng)
    half = 0.5 * np.deg2rad(rng.uniform(0.0, settings.angle_jitter_deg))
    axis = _unit(rng)
    if not settings.position_jitter and not settings.angle_jitter_deg:
        return X_SC
    turn = rotation_from_quaternion([np.cos(half), *(np.sin(half) * axis)])
    return make_pose(X_SC[:3, :3] @ turn, X_SC[:3, 3] + offset)


def in_ball(radius: float, rng: np.random.Generator) -> Array:
    """(3,) a random point in a ball around the origin [m]."""
    return radius * float(np.cbrt(rng.random())) * _unit(rng)


def _unit(rng: np.random.Generator) -> Array:
    """(3,) a random direction."""
    v = rng.standard_normal(3)
    unit: Array = v / np.linalg.norm(v)
    return unit
