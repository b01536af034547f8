"""Masks as COCO has them: run lengths, as text of printable characters.

The format is that of `rleToString` in github.com/cocodataset/cocoapi, common/maskApi.c: lengths of
runs column by column, of zeros first; from the fourth one on, the difference to the last but one
before; each as groups of five bits, lowest first, in characters from 48 on, with 32 added if more
follow. The highest bit of the last group is the sign.
"""

from __future__ import annotations

import numpy as np

from burg_drake.core import Booleans

FIRST_CHARACTER = 48
MORE = 0x20
SIGN = 0x10


def run_lengths(mask: Booleans) -> list[int]:
    """Lengths of runs of equal pixels of a mask (H, W), column by column; first of unset ones."""
    flat = np.concatenate([[False], np.asarray(mask, bool).ravel(order="F")])
    changes = np.flatnonzero(flat[1:] != flat[:-1])
    return [int(n) for n in np.diff(np.concatenate([[0], changes, [flat.size - 1]]))]


def mask_text(mask: Booleans) -> str:
    """A mask (H, W) as the text of its run lengths."""
    lengths = run_lengths(mask)
    numbers = [n - lengths[k - 2] if k > 2 else n for k, n in enumerate(lengths)]
    return "".join(_characters(number) for number in numbers)


def _characters(number: int) -> str:
    text = ""
    while True:
        group, number = number & 0x1F, number >> 5
        done = number == (-1 if group & SIGN else 0)
        text += chr(FIRST_CHARACTER + (group if done else group | MORE))
        if done:
            return text
