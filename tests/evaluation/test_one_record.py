"""A verdict is declared once, and what follows from it follows by itself."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest

from burg_drake.core import (
    MarginNames,
    Margins,
    Outcome,
    RecordedFields,
    Stage,
    TableShape,
    Verdict,
    describe_column,
)
from burg_drake.evaluation import decode_verdict, encode_verdict

MADE_UP = Path(__file__).with_name("made_up_margin.py")


def test_a_new_margin_is_one_line(tmp_path: Path) -> None:
    """It is in journals, tables, their units and meanings, rows that are read, and replays."""
    pytest.importorskip("pyarrow")
    ran = subprocess.run([sys.executable, str(MADE_UP), str(tmp_path)], capture_output=True)
    assert ran.returncode == 0, ran.stderr.decode()


def test_every_field_is_in_the_journal_and_comes_back() -> None:
    verdict = Verdict(
        Outcome.SLIPPED,
        Stage.EXECUTED,
        blocker="a",
        reason="b",
        margins={name: k / 3 for k, name in enumerate(MarginNames.all)},
        displacements={"c": 0.1},
        turned={"c": 0.3},
        toppled="c",
        pushed={"d": 0.2},
        touched="e",
        confidence=0.75,
        judged_again="g",
        outcome_before="h",
        q_grasp=(1 / 7,),
        q_pregrasp=(2 / 7,),
        cpu={Stage.CLEAR: 0.5},
        interrupted=True,
        device="i",  # where, not what: sessions count it
    )
    empty = Verdict(Outcome.LIFTED, Stage.EXECUTED)
    for one in fields(Verdict):
        differs = getattr(verdict, one.name) != getattr(empty, one.name)
        assert differs or one.name == "stage"
    line = encode_verdict("f", verdict)
    assert decode_verdict(line) == ("f", verdict)
    written = {one.name for one in fields(Verdict)} - {"device"}
    assert json.loads(line).keys() == {"id", *written}


def test_every_column_of_a_verdict_has_a_meaning() -> None:
    shape = TableShape("arm", ["a mug"], 2)
    for one in RecordedFields.verdict:
        assert all(map(describe_column, one.columns(shape))), one.name
    assert all(one.metadata["column"].description for one in fields(Margins))
