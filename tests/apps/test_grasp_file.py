"""Options about grasp files: each command that reads one takes hand and link of its grasps."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import build_parser, gripper_by_name, main, read_grasps_from_options
from burg_drake.core import GraspSet, grasp_from_axes
from burg_drake.formats import PANDA_GRIPPER, write_grasp_file
from burg_drake.scene import load_scene
from burg_drake.station import load_station

Capture = pytest.CaptureFixture[str]

BOX = GraspSet.create(
    grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18)), object="box", width=0.06, score=1.0
)
"""A grasp of the household box, from above."""


@pytest.fixture
def theirs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A file with the grasp in which the hand's body is called `fr3_hand`."""
    monkeypatch.chdir(tmp_path)
    write_grasp_file(
        BOX, "a.yaml", "isaac_grasp", dataclasses.replace(PANDA_GRIPPER, body="fr3_hand")
    )
    return "a.yaml"


@pytest.mark.parametrize(
    "verb",
    [
        ["grasps", "stats", "a.yaml"],
        ["grasps", "score", "a.yaml", "--library", "household"],
        ["grasps", "convert", "a.yaml", "b.h5"],
        ["grasps", "show", "a.yaml", "--library", "household", "--html", "a.html"],
        ["evaluate", "tabletop_six", "--grasps", "a.yaml", "-o", "run"],
    ],
    ids=lambda verb: " ".join(verb[:2]),
)
def test_every_verb_can_be_told_the_link(verb: list[str], theirs: str, capsys: Capture) -> None:
    assert main(verb) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "'/World/fr3_hand' is not 'panda_hand'" in line and "name 'fr3_hand'" in line
    if verb[0] == "evaluate":  # reading is what matters here
        arguments = build_parser().parse_args([*verb, "--gripper-link", "fr3_hand"])
        given = read_grasps_from_options(
            arguments, load_scene(verb[1]), load_station("panda_tabletop")
        )
        np.testing.assert_allclose(given.by_instance["box"].X_OG, BOX.X_OG, atol=1e-12)
    else:
        assert main([*verb, "--gripper-link", "fr3_hand"]) == 0


@pytest.mark.parametrize("verb", ["stats", "score", "convert", "show"])
def test_the_format_can_be_named(verb: str, theirs: str, capsys: Capture) -> None:
    more = {"convert": ["b.h5"], "stats": []}.get(verb, ["--library", "household"])
    assert main(["grasps", verb, theirs, *more, "--from", "graspnet"]) == 2
    assert "a.yaml is not a .npy file of numbers" in capsys.readouterr().err


def test_stats_of_another_hand(tmp_path: Path, capsys: Capture) -> None:
    ours, theirs, figures = (str(tmp_path / name) for name in ("a.h5", "a.yaml", "f.json"))
    BOX.save(ours)
    write_grasp_file(BOX, theirs, "isaac_grasp", gripper_by_name("wsg_50"))
    assert main(["grasps", "stats", ours, theirs]) == 2
    assert "the frame of hand 'panda_hand'" in capsys.readouterr().err
    options = ["--hand", "wsg_50", "--json", figures]
    assert main(["grasps", "stats", ours, theirs, *options]) == 0
    overall = json.loads(Path(figures).read_text())["comparison"]["overall"]
    assert overall["to_grasps"]["mean"] == pytest.approx(0.0, abs=1e-9)


def test_an_option_about_the_link_needs_a_file(capsys: Capture) -> None:
    assert main(["evaluate", "tabletop_six", "--gripper-link", "fr3_hand"]) == 2
    assert "--gripper-link is for grasp files; add --grasps FILE" in capsys.readouterr().err
