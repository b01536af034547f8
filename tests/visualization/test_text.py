"""Text as triangles: where the ink is, and which way it faces."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.visualization import text_triangles


def areas(text: str, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Signed areas of the triangles [m^2] and their centres (N, 2)."""
    vertices, faces = text_triangles(text, height)
    a, b, c = (vertices[:2, faces[k]].T for k in range(3))
    u, v = b - a, c - a
    return (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2, (a + b + c) / 3


def test_faces_up() -> None:
    signed, _ = areas("Mug_1", 0.01)
    assert (signed > 0.0).all()


@pytest.mark.parametrize("height", [0.01, 0.03])
def test_capitals_stand_on_the_baseline_with_the_given_height(height: float) -> None:
    vertices, _ = text_triangles("HEH", height)
    assert vertices[1].min() == pytest.approx(0.0, abs=0.06 * height)
    assert np.ptp(vertices[1]) == pytest.approx(height, rel=0.08)
    assert vertices[0].min() == pytest.approx(-vertices[0].max(), abs=0.1 * height)
    assert (vertices[2] == 0.0).all()


def test_reads_from_left_to_right_and_upright() -> None:
    signed, centres = areas("L", 0.01)
    middle = (centres[:, 0].min() + centres[:, 0].max()) / 2
    left = signed[centres[:, 0] < middle].sum()
    low = signed[centres[:, 1] < 0.005].sum()
    assert left > 0.6 * signed.sum()
    assert low > 0.6 * signed.sum()


def test_longer_text_is_wider() -> None:
    widths = [np.ptp(text_triangles("H" * n, 0.01)[0][0]) for n in (1, 2, 4)]
    assert widths[0] < widths[1] < widths[2]
    # the advance is the same for each further letter
    assert widths[2] - widths[1] == pytest.approx(2 * (widths[1] - widths[0]), rel=0.05)
