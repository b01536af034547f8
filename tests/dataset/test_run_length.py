"""Run lengths of masks: against COCO's own code where it is installed, and written by hand."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.core import InvalidInputError
from burg_drake.dataset import decode_mask, encode_mask

RNG = np.random.default_rng(7)
MASKS = [
    np.zeros((3, 4), bool),
    np.ones((3, 4), bool),
    *(RNG.random(tuple(RNG.integers(1, 50, 2))) < share for share in np.linspace(0.02, 0.98, 25)),
    np.pad(np.ones((300, 5), bool), ((20, 30), (100, 7))),
]


@pytest.mark.parametrize("mask", MASKS)
def test_a_mask_comes_back(mask: np.ndarray) -> None:
    assert (decode_mask(encode_mask(mask), *mask.shape) == mask).all()


@pytest.mark.parametrize(
    ("columns", "text"),
    [
        ("0000", "4"),
        ("1111", "04"),
        ("0110", "121"),
        ("0100100100", "1120000"),  # 1 1 2 1 2 1 2: the last four are those two before
        ("0" * 16 + "1", "`01"),  # 16 has the bit of the sign, so that a group follows
        ("0011101000", "231N2"),  # 2 3 1 1 3: 1 - 3 = -2, which is 30 of 32, and 3 - 1 = 2
    ],
)
def test_texts_worked_out_by_hand(columns: str, text: str) -> None:
    assert encode_mask(np.array([[one == "1"] for one in columns])) == text


@pytest.mark.parametrize("mask", MASKS)
def test_texts_are_those_of_coco(mask: np.ndarray) -> None:
    coco = pytest.importorskip("pycocotools.mask")
    theirs = coco.encode(np.asfortranarray(mask.astype(np.uint8)))
    assert encode_mask(mask) == theirs["counts"].decode()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("5", "have 5 pixels; a mask of 2 x 2 has 4"),
        ("3N3", "have 4 pixels"),
        ("P", "end within a number"),
        ("4 ", "invalid character ' '"),
        ("PPPPPPPPPPPP1", "invalid character 'P'"),
        ("", "have 0 pixels"),
    ],
)
def test_what_is_no_mask_is_refused(text: str, message: str) -> None:
    with pytest.raises(InvalidInputError) as refused:
        decode_mask(text, 2, 2)
    assert message in str(refused.value)
