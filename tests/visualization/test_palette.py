"""Every outcome has a colour, and colours stay apart for colour-blind eyes."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from burg_drake.core import Outcome
from burg_drake.visualization import OUTCOME_GROUPS, UNJUDGED_GROUP, outcome_group

# Linear RGB to what protanopes and deuteranopes see: Machado, Oliveira, Fernandes, "A
# Physiologically-based Model for Simulation of Color Vision Deficiency" (2009), severity 1.0.
VISION = {
    "normal": np.eye(3),
    "protanope": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranope": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
}


def lab(rgb: np.ndarray) -> np.ndarray:
    """Linear RGB to CIE L*a*b* (D65)."""
    xyz = (
        np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
        @ rgb
    )
    f = np.cbrt(np.maximum(xyz / (0.9505, 1.0, 1.089), 0.0))
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def test_every_outcome_is_in_exactly_one_group() -> None:
    members = [outcome for group in OUTCOME_GROUPS for outcome in group.outcomes]
    assert sorted(members) == sorted(Outcome)


def test_group_of() -> None:
    assert outcome_group(Outcome.LIFTED).name == "lifted"
    assert outcome_group(Outcome.NO_IK) is outcome_group(Outcome.ARM_COLLISION)
    assert outcome_group(None) is UNJUDGED_GROUP


def test_hex() -> None:
    assert OUTCOME_GROUPS[0].hex == "#009e73"


@pytest.mark.parametrize("vision", VISION)
def test_groups_can_be_told_apart(vision: str) -> None:
    seen = {}
    for group in (*OUTCOME_GROUPS, UNJUDGED_GROUP):
        linear = np.power(group.rgba[:3], 2.2)
        seen[group.name] = lab(np.clip(VISION[vision] @ linear, 0.0, 1.0))
    for a, b in itertools.combinations(seen, 2):
        assert np.linalg.norm(seen[a] - seen[b]) > 12.0, (a, b)
