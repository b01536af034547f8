"""Tables of numbers: units, digits, and no cell that is cut."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.apps.commands import grasp_tables
from burg_drake.core import GraspSet, format_number, make_pose

Capture = pytest.CaptureFixture[str]

VALUES = np.array([-1.2345e-7, 4.0e-9, 8.661e-4, 1.2399e-5, 123456.0])

WIDE = """\
mug
column                    known       0%       5%    50%     95%  100%
──────────────────────────────────────────────────────────────────────
gravity_margin [weights]    200  1.23e-7  8.66e-4  0.707  10,000  1e30
patch_area [mm2]            200      5.9     17.7     82     100   324
antipodal_angle [deg]     1,000        0       90    180     inf     -
"""

NARROW = """\
mug
column                    known       0%    50%  100%
─────────────────────────────────────────────────────
gravity_margin [weights]    200  1.23e-7  0.707  1e30
patch_area [mm2]            200      5.9     82   324
antipodal_angle [deg]     1,000        0    180     -
"""


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (1.2345e-7, "1.23e-7"),
        (-8.661e-4, "-8.66e-4"),
        (0.001, "0.001"),
        (0.70712, "0.707"),
        (999.4, "999"),
        (12345.6, "12,300"),
        (-123456.0, "-123,000"),
        (999_999.0, "1e6"),
        (1.2345e9, "1.23e9"),
        (0.99999e-3, "0.001"),
        (math.inf, "inf"),
        (math.nan, "-"),
    ],
)
def test_short_numbers(value: float, text: str) -> None:
    assert format_number(value) == text
    assert len(text) <= 8


@pytest.mark.parametrize(
    ("columns", "expected"), [("80", WIDE), ("70", WIDE), ("69", NARROW), ("53", NARROW)]
)
def test_a_table_of_quantiles(
    columns: str, expected: str, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    heads = [f"{q:.0%}" for q in grasp_tables.TABLE_QUANTILES]
    rows = {
        "gravity_margin": (200, [1.234e-7, 8.66e-4, 0.7071, 1e4, 1e30]),
        "patch_area": (200, [5.9e-6, 17.7e-6, 82e-6, 1e-4, 324e-6]),
        "antipodal_angle": (1000, [0.0, math.pi / 2, math.pi, math.inf, math.nan]),
    }
    grasp_tables.print_numbers(
        "mug",
        {n: (known, dict(zip(heads, v, strict=True))) for n, (known, v) in rows.items()},
    )
    printed = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert "\n".join(line for line in printed if line) + "\n" == expected


@pytest.mark.parametrize("columns", ["40", "80"])
def test_nothing_is_cut_in_stats(
    columns: str, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    grasps = GraspSet.create(
        make_pose(p_AB=np.outer(np.arange(5.0), (0.01, 0.0, 0.0))),
        object="an_object_with_a_name_that_is_rather_long",
        columns={"volume": VALUES, "patch_area": VALUES, "load_margin": VALUES},
    )
    grasps.save(tmp_path / "a.h5")
    assert main(["grasps", "stats", str(tmp_path / "a.h5"), str(tmp_path / "a.h5")]) == 0
    printed = capsys.readouterr().out
    for text in ("-1.23e-7", "1.24e-5", "123,000", "-0.123", "1.23e11", "[mm2]", "[weights]"):
        assert text in printed
