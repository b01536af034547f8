"""`grasps show` on runs by any column, on files in scenes and in rows, and what it refuses."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.core import GraspSet, grasp_from_axes
from burg_drake.evaluation import Run
from burg_drake.formats import write_grasp_file
from burg_drake.scene import load_scene
from burg_drake.station import load_station

Capture = pytest.CaptureFixture[str]
N = 12


@pytest.fixture
def grasps() -> GraspSet:
    """From above on mug and bottle, with numbers, names, and one number missing."""
    height = np.linspace(0.02, 0.08, N)
    X_OG = grasp_from_axes((1, 0, 0), (0, 0, -1), np.stack([0 * height, 0 * height, height], -1))
    clearance = np.linspace(-0.002, 0.02, N)
    clearance[4] = np.nan
    return GraspSet.create(
        X_OG,
        object=["mug"] * 8 + ["bottle"] * 4,
        width=0.05,
        score=height,
        columns={"clearance": clearance, "maker": ["a", "b", "b"] * 4},
    )


@pytest.fixture
def file(grasps: GraspSet, tmp_path: Path) -> Path:
    path = tmp_path / "grasps.h5"
    grasps.save(path)
    return path


def shown(capsys: Capture, *arguments: object) -> list[str]:
    """Lines that the verb prints, without the last one, about the page."""
    assert main(["grasps", "show", *map(str, arguments), "--no-wait"]) == 0
    lines = capsys.readouterr().out.splitlines()[:-1]
    return [line for line in lines if not line.startswith("note: ")]


def refused(capsys: Capture, *arguments: object) -> str:
    assert main(["grasps", "show", *map(str, arguments), "--no-wait"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_objects_in_rows_by_score(file: Path, tmp_path: Path, capsys: Capture) -> None:
    page = tmp_path / "page.html"
    arguments = ["grasps", "show", str(file), "--library", "household", "--html", str(page)]
    assert main(arguments) == 0
    title, histogram, ticks, wrote = capsys.readouterr().out.splitlines()
    assert title == "score" and wrote == f"wrote {page}"
    assert len(histogram) == 64 and ticks.split()[0] == "0.02"
    text = page.read_text()
    assert "<title>grasps.h5</title>" in text and "12 of 12 grasps" in text
    assert 'class="bar"' in text and 'type="range"' in text
    assert "<script src" not in text and "@import" not in text


def test_in_the_scene_by_any_column(file: Path, scene_file: Path, capsys: Capture) -> None:
    scene = ("--scene", scene_file)
    lines = shown(capsys, file, *scene, "--color", "clearance", "--range", 0, 0.01)
    assert lines[0] == "clearance [m]"
    assert lines[2].startswith("≤ 0") and lines[2].endswith("≥ 0.01")
    assert lines[3:] == ["1 below the range, 5 above the range", "■ not known (1)"]
    assert shown(capsys, file, *scene, "--color", "maker") == ["■ b (8)", "■ a (4)"]
    assert shown(capsys, file, *scene, "--color", "instance") == ["■ mug (8)", "■ bottle (4)"]


@pytest.mark.thorough
def test_choice(file: Path, capsys: Capture) -> None:
    library = ("--library", "household", "--color", "object")
    assert shown(capsys, file, *library, "--only", "bottle") == [
        "■ bottle (4)",
        "4 of 12 grasps shown",
    ]
    assert shown(capsys, file, *library, "--most", 3) == [
        "■ bottle (3)",
        "■ mug (3)",
        "6 of 12 grasps shown: the best 3 of each object by score; --most N or --all shows more",
    ]
    assert shown(capsys, file, *library, "--all") == ["■ mug (8)", "■ bottle (4)"]
    named = ("--grasps-object", "mug=can", "--grasps-object", "bottle=box")
    assert shown(capsys, file, *library, *named) == ["■ can (8)", "■ box (4)"]


def picker(page: Path) -> tuple[list[str], dict[str, Any], str]:
    """The list of a page, its data, and what is chosen at first."""
    text = page.read_text()
    options = re.findall(r'<option value="(-?\d+)"( selected="selected")?>([^<]*)<', text)
    (data,) = re.findall(r'<script type="application/json" id="picker">(.*?)</script>', text)
    (chosen,) = (label for _, selected, label in options if selected)
    return [label for _, _, label in options], json.loads(data), chosen


def test_the_list_has_the_best_first_and_any_that_is_asked_for(
    file: Path, grasps: GraspSet, tmp_path: Path, capsys: Capture
) -> None:
    page, worst = tmp_path / "page.html", str(grasps.id[0])
    options = ("--library", "household", "--most", 2, "--html", page)
    shown(capsys, file, *options)
    labels, _, chosen = picker(page)
    best = [7, 6, 11, 10]  # of mug and bottle by score
    assert labels == ["no gripper", *(f"{grasps.score[k]:.3g} {grasps.id[k]}" for k in best)]
    assert chosen == "no gripper"
    shown(capsys, file, *options, "--select", worst)
    labels, data, chosen = picker(page)
    assert chosen == labels[3] == f"0.02 {worst}"
    assert len(data["grasps"]) == len(labels) - 1 == 5
    line = refused(capsys, file, *options, "--select", worst[:-1])
    assert f"grasps.h5 has no grasp {worst[:-1]!r}; did you mean {worst!r}" in line


def test_the_list_tells_what_is_coloured_highest_first(
    file: Path, grasps: GraspSet, tmp_path: Path, capsys: Capture
) -> None:
    """The best by score stay those that are shown: the number missing, of grasp 4, comes last."""
    page = tmp_path / "page.html"
    columns = grasps.columns | {"margin": np.array([0, 1, 2, 3, np.nan, 9, 7, 8, 1, 3, 2, 4.0])}
    grasps.with_columns(**columns).save(file)
    options = ("--library", "household", "--color", "margin", "--most", 4, "--html", page)
    shown(capsys, file, *options, "--select", str(grasps.id[3]))
    labels, _, chosen = picker(page)
    assert [label.split()[0] for label in labels[1:]] == [*"9873-", *"4321"]
    assert labels[1] == f"9 {grasps.id[5]}" and chosen == labels[4] == f"3 {grasps.id[3]}"
    text = page.read_text()
    assert "<p>margin and identifier, object by object, highest first</p>" in text
    assert "the best 4 of each object by score" in text


def test_the_gripper_is_put_where_the_grasp_is(
    file: Path, grasps: GraspSet, scene_file: Path, tmp_path: Path, capsys: Capture
) -> None:
    """Of the Panda hand, G is 0.1034 m before the flange, and two parts slide, half each."""
    page = tmp_path / "page.html"
    shown(capsys, file, "--scene", scene_file, "--html", page, "--only", "mug")
    labels, data, _ = picker(page)
    assert len(labels) == 9 and all(label.split()[1].startswith("mug-") for label in labels[1:])
    X_WO = load_station("panda_tabletop").document.X_WS.matrix()
    X_WO = X_WO @ load_scene(scene_file).X_SO("mug")
    for entry, k in zip(data["grasps"], range(7, -1, -1), strict=True):
        X_WG, X_WH = (np.reshape(entry[frame], (4, 4)).T for frame in "GH")
        assert pytest.approx(X_WO @ grasps.X_OG[k], abs=2e-6) == X_WG
        assert X_WH[:3, 3] == pytest.approx(X_WG[:3, 3] - 0.1034 * X_WG[:3, 2], abs=1e-5)
        assert entry["closed"] == pytest.approx(0.03)  # from 80 mm to 50 mm
        assert data["groups"][entry["group"]].startswith("/drake/grasps/")
    slides = sorted(np.round(slide, 6).tolist() for _, slide in data["slides"])
    assert [abs(v) for slide in slides for v in slide if v] == [0.5, 0.5]
    assert np.sum(slides, axis=0) == pytest.approx(0.0, abs=1e-9)


def test_what_the_file_says_of_its_objects(
    grasps: GraspSet, scene_file: Path, tmp_path: Path, capsys: Capture
) -> None:
    path = tmp_path / "told.npz"
    told = GraspSet.create(grasps.X_OG, object="mug", provenance={"scene": str(scene_file)})
    told.save(path)
    assert shown(capsys, path) == [f"■ grasps ({N})"]
    grasps.save(tmp_path / "untold.npz")
    assert "does not say where its objects are; give --scene or --library" in refused(
        capsys, tmp_path / "untold.npz"
    )


def test_foreign_files(grasps: GraspSet, tmp_path: Path, capsys: Capture) -> None:
    mug = grasps.select(grasps.object == "mug")
    path = tmp_path / "mug_1.0.h5"
    write_grasp_file(mug, path, "acronym")
    lines = shown(
        capsys, path, "--library", "household", "--grasps-object", "mug", "--color", "object"
    )
    assert lines == ["■ mug (8)"]
    camera = tmp_path / "camera.npy"
    write_grasp_file(mug, camera, "graspnet")
    assert "grasps in the camera frame, not in those of objects; place them" in refused(
        capsys, camera, "--library", "household"
    )
    world = tmp_path / "world.csv"
    write_grasp_file(mug, world, "vgn")
    assert "grasps in the world frame" in refused(capsys, world, "--library", "household")


def test_a_run_by_its_margins(run: Run, capsys: Capture) -> None:
    lines = shown(capsys, run.path, "--color", "pad_force")
    assert lines[0] == "pad_force [N]" and lines[-1].startswith("■ not known (")
    assert shown(capsys, run.path, "--color", "stage") == ["■ executed (2)", "■ clear (1)"]


def test_columns_of_a_run_by_the_names_of_its_table(
    scene_file: Path, tmp_path: Path, capsys: Capture
) -> None:
    X_OG = grasp_from_axes((1, 0, 0), (0, 0, -1), np.array([[0.0, 0.0, 0.0]]))  # in the table
    given = GraspSet.create(X_OG, object="mug", columns={"maker": ["me"], "outcome": ["slipped"]})
    given.save(tmp_path / "given.h5")
    folder = str(tmp_path / "run")
    options = ["--mode", "hand", "--engine", "screening", "--workers", "1", "--quiet"]
    file = str(tmp_path / "given.h5")
    scene = str(scene_file)
    assert main(["evaluate", scene, "--grasps", file, *options, "-o", folder]) == 0
    capsys.readouterr()
    assert shown(capsys, folder, "--color", "given_maker") == ["■ me (1)"]
    assert shown(capsys, folder, "--color", "maker") == ["■ me (1)"]
    assert shown(capsys, folder, "--color", "given_outcome") != shown(capsys, folder)
    assert "no column 'given_makers'" in refused(capsys, folder, "--color", "given_makers")


def test_refusals(file: Path, run: Run, tmp_path: Path, capsys: Capture) -> None:
    library = ("--library", "household")
    for arguments, message in [
        ((file, *library, "--color", "clearence"), "no column 'clearence'; did you mean 'clear"),
        ((file, *library, "--only", "mugg"), "has no grasps of 'mugg'; did you mean 'mug'"),
        ((file, *library, "--outcome", "lifted"), "no column 'outcome'"),
        ((file, *library, "--color", "maker", "--range", 0, 1), "column 'maker' has names"),
        ((file, *library, "--range", 1, 0), "the range 1 to 0 does not rise"),
        ((file, "--library", "kitchen"), "is neither a scene nor an object library"),
        ((tmp_path / "none.h5",), "none.h5 does not exist"),
        ((run.path, "--scene", "tabletop_six"), "--scene is for grasp files"),
        ((run.path, "--station", "panda_wsg"), "--station is for grasp files"),
    ]:
        assert message in refused(capsys, *arguments)


def test_an_empty_file(tmp_path: Path, capsys: Capture) -> None:
    path = tmp_path / "empty.npz"
    GraspSet.create(np.empty((0, 4, 4)), object="mug").save(path)
    assert "empty.npz has no grasps" in refused(capsys, path, "--library", "household")
