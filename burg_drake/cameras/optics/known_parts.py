"""The parts of an image in which a calibrated camera is known, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

PARTS = (
    *("upper left corner", "upper edge", "upper right corner"),
    *("left edge", "middle", "right edge"),
    *("lower left corner", "lower edge", "lower right corner"),
)
LARGEST = 10.0
"""Larger bounds say no more than that a part is unknown [pixels]."""


def known_words(known_to: float, except_at: Sequence[str], bounds: Mapping[str, str] = {}) -> str:
    """How well a camera is known, such as `to 0.21 pixels over the whole image`.

    Args:
        known_to: bound of its error outside of the parts that are excepted [pixels].
        except_at: those, of `PARTS`; where they are most of the image, the others are named.
        bounds: what to say of some of them.
    """
    if not known_to < LARGEST:
        return f"no better than to {LARGEST:g} pixels"
    if not except_at:
        return f"to {known_to:.2f} pixels over the whole image"
    others = ", ".join(f"{name} ({bounds[name]})" if name in bounds else name for name in except_at)
    if not is_local(except_at):
        return f"to {known_to:.2f} pixels, but for the {others}"
    held = ", ".join(name for name in PARTS if name not in except_at)
    return f"in the {held} only, to {known_to:.2f} pixels there, and not in the {others}"


def is_local(except_at: Sequence[str]) -> bool:
    """Most parts of the image are excepted."""
    return 2 * len(except_at) > len(PARTS)
