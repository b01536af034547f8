"""Poses X_AB as (4, 4) arrays, and random generators whose seed is content."""

from burg_drake.core import (
    inverse as inverse,
    make_pose as make_pose,
    rng_from as rng_from,
    rot_z as rot_z,
)
