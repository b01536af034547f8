"""Masks as COCO writes them: lengths of runs, column by column, as a text.

A mask is read down its columns, from left to right. Its runs are the numbers of pixels that are off
and on by turns; the first run is of pixels that are off, and may be empty. The text has for each
run, from the fourth on, its difference to the run before the last one, as these are alike. A number
is cut into groups of five bits, lowest first, in two's complement; each group is a character, 48
above its value, with a sixth bit that is set if another one follows
(https://github.com/cocodataset/cocoapi, `common/maskApi.c`, rleToString).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Booleans, Indices, InvalidInputError

FIRST_CHARACTER = 48
BITS = 5
FOLLOWS = 1 << BITS
"""Bit of a character after which its number goes on."""
SIGN = 1 << (BITS - 1)
LONGEST_NUMBER = 8
"""Characters of a number, at most: 40 bits."""
FIRST_DIFFERENCE = 3
"""Index of the first run that is written as a difference."""


def encode_mask(mask: Booleans) -> str:
    """The text of a mask.

    Args:
        mask: (H, W).
    """
    runs = run_lengths(mask)
    steps = runs.copy()
    steps[FIRST_DIFFERENCE:] -= runs[FIRST_DIFFERENCE - 2 : -2]
    return "".join(map(_number_text, steps.tolist()))


def decode_mask(text: str, height: int, width: int) -> NDArray[np.bool_]:
    """(H, W) mask of a text.

    Args:
        text: as `encode_mask` writes it.
        height, width: of the mask; a caller bounds them.

    Raises:
        InvalidInputError: the text is no mask, or one of another size.
    """
    runs = _runs(text)
    total, size = sum(runs), height * width
    if min(runs, default=0) < 0 or total != size:
        raise InvalidInputError(
            f"the run lengths of a mask have {total} pixels; a mask of {width} x {height} has"
            f" {size}"
        )
    mask = np.zeros((height, width), dtype=bool)
    if len(runs) < 2:
        return mask
    is_on = np.zeros(len(runs), dtype=bool)
    is_on[1::2] = True
    columns = np.repeat(is_on, runs).reshape(width, height)
    first = runs[0] // height  # all columns before it are off, and so are those behind the last
    last = width - (runs[-1] // height if len(runs) % 2 else 0)
    mask[:, first:last] = columns[first:last].T
    return mask


def run_lengths(mask: Booleans) -> Indices:
    """(N,) lengths of the runs of a mask, the first one of pixels that are off.

    Args:
        mask: (H, W).
    """
    height, width = mask.shape
    used = np.flatnonzero(mask.any(axis=0))
    if not len(used):
        return np.array([mask.size], dtype=np.intp)
    first, last = int(used[0]), int(used[-1]) + 1  # all other columns are off
    column = np.zeros((last - first) * height + 2, dtype=bool)
    column[1:-1] = mask[:, first:last].T.ravel()
    changes = np.flatnonzero(column[1:] != column[:-1]) + first * height
    runs = np.diff(changes, prepend=0)
    rest = width * height - changes[-1]
    return np.append(runs, rest) if rest else runs


def _number_text(number: int) -> str:
    characters = []
    while True:
        group, number = number & (FOLLOWS - 1), number >> BITS
        is_last = number == (-1 if group & SIGN else 0)  # the rest follows from the sign
        characters.append(chr(FIRST_CHARACTER + (group if is_last else group | FOLLOWS)))
        if is_last:
            return "".join(characters)


def _runs(text: str) -> list[int]:
    runs: list[int] = []
    number = shift = 0
    for character in text:
        group = ord(character) - FIRST_CHARACTER
        if not 0 <= group < 2 * FOLLOWS or shift >= BITS * LONGEST_NUMBER:
            raise InvalidInputError(
                f"the run lengths of a mask have the invalid character {character!r}"
            )
        number |= (group & (FOLLOWS - 1)) << shift
        shift += BITS
        if group & FOLLOWS:
            continue
        if group & SIGN:
            number -= 1 << shift
        runs.append(number + runs[-2] if len(runs) >= FIRST_DIFFERENCE else number)
        number = shift = 0
    if shift:
        raise InvalidInputError("the run lengths of a mask end within a number")
    return runs
