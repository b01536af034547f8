"""Surfaces that pass through themselves."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.objects import MAX_SELF_OVERLAP, self_overlap


def _torus(reach: float) -> trimesh.Trimesh:
    return trimesh.creation.torus(reach, 0.02, major_sections=48, minor_sections=24)


@pytest.mark.parametrize(
    "sound",
    [
        trimesh.creation.box((0.1, 0.06, 0.03)),
        trimesh.creation.icosphere(subdivisions=3, radius=0.05),
        _torus(0.05),
        trimesh.creation.annulus(0.03, 0.031, 0.1),
    ],
)
def test_sound_surfaces_do_not(sound: trimesh.Trimesh) -> None:
    assert self_overlap(sound) < 0.1 * MAX_SELF_OVERLAP


def test_the_share_is_that_of_the_volume() -> None:
    """Two equal spheres as one surface: the lens that both fill, over what either fills."""
    r, apart = 0.05, 0.04
    one = trimesh.creation.icosphere(subdivisions=4, radius=r)
    both = trimesh.util.concatenate([one, one.copy().apply_translation([apart, 0.0, 0.0])])
    lens = np.pi * (4.0 * r + apart) * (2.0 * r - apart) ** 2 / 12.0
    ball = 4.0 / 3.0 * np.pi * r**3
    assert self_overlap(both) == pytest.approx(lens / (2.0 * ball - lens), abs=0.04)


def test_cavities_do_not() -> None:
    inner = trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    inner.invert()
    shell = trimesh.util.concatenate([trimesh.creation.icosphere(3, 0.05), inner])
    assert self_overlap(shell) == 0.0


def test_insides_out_do() -> None:
    box = trimesh.creation.box((0.1, 0.06, 0.03))
    box = trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False)
    assert self_overlap(box) == pytest.approx(1.0)
