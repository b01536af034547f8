"""Tables of numbers as text, many times as fast as number by number.

Numbers on a grid of 1e-12 are written with their decimals and read back with the same bits: both
sides are the floating-point number nearest to the same decimal one.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.arrays import Array

Words = NDArray[np.uint32]

PLACES = 12
"""Decimals of the grid: a thousandth of a nanometre, nanoradian or a joint's rate of them."""
LARGEST = 9000.0
"""Up to here a number on the grid is a whole multiple of it that floating-point numbers count
exactly."""
GROUP = 10_000
"""Four digits are looked up together, as the four bytes of a word."""
PAD = b"\0"
"""Where a number has no character."""


def rounded_to_places(values: Array) -> Array:
    """The nearest numbers with 12 decimals; what is beyond 9000 in size stays as it is."""
    small = np.abs(values) <= LARGEST
    units = np.rint(np.where(small, values, 0.0) * 10.0**PLACES)
    return np.where(small, units / 10.0**PLACES + 0.0, values)  # no negative zeros


def format_rows(values: Array, separator: str = ",") -> list[str]:
    """Each row of finite numbers (T, n) as text, which reads back bit by bit.

    Args:
        values: on the grid, see `rounded_to_places`, for the most part: others take longer.
        separator: of the numbers of a row, one or two characters.
    """
    bits = np.ascontiguousarray(values).view(np.int64)
    new = np.append(np.ones(min(1, len(bits)), bool), (bits[1:] != bits[:-1]).any(axis=1))
    texts = _texts(values[new], separator)
    return [texts[k] for k in (np.cumsum(new) - 1).tolist()]  # what rests is written once


def _texts(values: Array, separator: str) -> list[str]:
    units = np.rint(np.where(np.abs(values) <= LARGEST, values, np.nan) * 10.0**PLACES)
    exact = units / 10.0**PLACES == values
    exact &= (values != 0.0) | ~np.signbit(values)
    others = np.flatnonzero(~exact.all(axis=1))
    texts = _written(np.where(exact, units, 0.0), separator)
    for k in others.tolist():
        texts[k] = separator.join(map(repr, values[k].tolist()))
    return texts


def _written(units: Array, separator: str) -> list[str]:
    """Rows of whole multiples of the grid: all characters that a number may have, less those that
    it has not."""
    if not units.size:
        return [""] * len(units)
    upper, lower = _split(np.abs(units).astype(np.int64), GROUP**2)
    groups = [*_split(upper.astype(np.int32), GROUP), *_split(lower.astype(np.int32), GROUP)]
    text = np.empty((*units.shape, 5), dtype=np.uint32)
    text[..., :2] = _whole()[groups[0] + GROUP * (units < 0.0)]
    text[..., 0] |= _word(separator)
    text[:, 0, 0] ^= _word(separator) ^ _word("\n")
    after = np.zeros(units.shape, dtype=bool)  # whether there are digits further to the right
    for k in (3, 2, 1):
        text[..., 1 + k] = _decimals()[min(k, 2) - 1, groups[k] + GROUP * after]
        after |= groups[k] > 0
    return text.tobytes().translate(None, PAD).decode("ascii").split("\n")[1:]


def _split(numbers: NDArray[Any], unit: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Whole units in numbers, and what is left."""
    whole = numbers // unit
    return whole, numbers - whole * unit


def _word(character: str) -> np.uint32:
    """A word with a character at its beginning."""
    word: np.uint32 = np.frombuffer(character.encode().ljust(4, PAD), dtype=np.uint32)[0]
    return word


def _words(texts: Iterable[str]) -> Words:
    return np.frombuffer("".join(texts).encode("ascii"), dtype=np.uint32)


@functools.cache
def _whole() -> Words:
    """Two words for what stands before the decimals; the first bytes are free for a separator."""
    numbers = (f"{sign}{k}.".rjust(8, "\0") for sign in ("", "-") for k in range(GROUP))
    return _words(numbers).reshape(-1, 2)


@functools.cache
def _decimals() -> Words:
    """Four decimals: the first ones, of which one stays, and later ones; without the zeros at the
    end, and with them if more follows."""
    digits = [f"{k:04d}" for k in range(GROUP)]
    least = [[d[:n] + d[n:].rstrip("0").ljust(4 - n, "\0") for d in digits] for n in (1, 0)]
    return np.stack([_words([*short, *digits]) for short in least])
