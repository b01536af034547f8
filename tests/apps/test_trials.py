"""`burg-drake trials`: the verbs, from the choice of grasps to the last entry."""

from __future__ import annotations

import math
import shutil
from datetime import datetime
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.cameras import Intrinsics, load_placement, save_intrinsics, write_image
from burg_drake.core import make_pose
from burg_drake.experiment import RealTrial, TrialBook, load_trials
from burg_drake.system_libraries import missing_render_libraries
from tests.experiment.known_runs import ended, make_run, make_scene

Capture = pytest.CaptureFixture[str]
INTRINSICS = Intrinsics(width=480, height=360, focal=(450.0, 450.0), center=(239.5, 179.5))


def trials(*words: str | Path) -> int:
    return main(["trials", *map(str, words)])


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The text of a trials file of a run in the same folder."""
    folder = tmp_path_factory.mktemp("trials")
    scene = make_scene(folder)
    verdicts = {"mug": [ended("lifted")] * 3, "box": [ended("lifted"), ended("slipped")]}
    make_run(folder / "run", scene, verdicts)
    save_intrinsics(INTRINSICS, folder / "K.yaml")
    assert trials("plan", folder / "run", "--per-object", "2", "-o", folder / "plan.yaml") == 0
    return folder


@pytest.fixture
def sheet(planned: Path) -> Path:
    """The trials file without entries."""
    for path in planned.glob("trials.*"):
        path.unlink()
    for name in ("photos", "placements"):
        shutil.rmtree(planned / name, ignore_errors=True)
    path = planned / "trials.yaml"
    path.write_text((planned / "plan.yaml").read_text())
    return path


def trial(sheet: Path, number: int) -> RealTrial:
    return load_trials(sheet).trial(number)


def test_plan_tells_what_was_chosen_and_what_it_will_tell(planned: Path, capsys: Capture) -> None:
    words = (planned / "run", "--per-object", "2", "--seed", "3", "-o", planned / "other.yaml")
    assert trials("plan", *words) == 0
    printed = capsys.readouterr().out
    assert "note: mug of run two: 0 of 1 with failure; others make up for it" in printed
    assert "precision" in printed and "McNemar's exact test" in printed
    assert f"wrote 4 trials to {planned / 'other.yaml'}" in printed
    assert trials("plan", planned / "no_run", "-o", planned / "x.yaml") == 2
    assert "is not the folder of a run" in capsys.readouterr().err
    assert not (planned / "x.yaml").exists()


def test_record_and_show(sheet: Path, capsys: Capture) -> None:
    first = ("record", sheet, "next", "--outcome", "slipped", "--note", "wet", "--operator", "Ada")
    assert trials(*first, "--width-mm", "12.5", "--effort-n", "30") == 0
    printed = capsys.readouterr().out
    assert "trial 1: slipped" in printed and "3 of 4 left; next is 2" in printed
    done = trial(sheet, 1)
    assert (done.outcome, done.note, done.operator) == ("slipped", "wet", "Ada")
    assert done.robot is not None and (done.robot.width_mm, done.robot.effort_n) == (12.5, 30.0)
    for words, message in (
        (("1", "--outcome", "lifted"), "trial 1 already has outcome 'slipped'"),
        (("2", "--outcome", "liftet"), "no outcome 'liftet'; did you mean 'lifted'?"),
        (("2",), "nothing to record"),
        (("7", "--outcome", "lifted"), "there is no trial 7; they have 1 to 4"),
        (("2", "--outcome", "lifted", "--intrinsics", "K"), "--intrinsics is for photos"),
        (("abc", "--outcome", "lifted"), "'abc': give the number of a trial, 1 to 4, or next"),
        (("2", "--note", "  "), "nothing to record"),
        (
            ("2", "--outcome", "xyzzy"),
            "known: lifted, lifted_disturbed, lifted_turned, slipped, dropped, clos",
        ),
        (("2", "--photo", "none.png"), "cannot read none.png"),
    ):
        assert trials("record", sheet, *words) == 2
        assert message in capsys.readouterr().err
    with pytest.raises(SystemExit):  # before anything else is looked at
        trials("record", "none.yaml", "abc", "--time", "noon")
    assert "'noon' is not a time; give ISO 8601 such as" in capsys.readouterr().err
    assert trial(sheet, 2).outcome is None
    assert trials("record", sheet, "1", "--outcome", "dropped", "--correct") == 0
    assert (trial(sheet, 1).outcome, trial(sheet, 1).note) == ("dropped", "wet")
    capsys.readouterr()
    assert trials("show", sheet, "--all") == 0
    printed = capsys.readouterr().out
    assert "next is 2" in printed and "wet" in printed and "simulat" not in printed
    assert not any(word in printed for word in ("failure", "success\nin", "note:"))
    assert printed.split("all  ")[1].split()[:3] == ["4", "1", "1"]
    assert trials("show", sheet, "--all", "--show-simulated") == 0
    printed = capsys.readouterr().out
    assert "simulated" in printed and "in simulation" in printed
    assert "note:" not in printed  # trials have begun


def test_notes_are_shown_before_trials_have_begun(sheet: Path, capsys: Capture) -> None:
    assert trials("show", sheet, "--show-simulated") == 0
    assert "note: mug of run two: 0 of 1 with failure" in capsys.readouterr().out
    assert trials("show", sheet) == 0
    printed = capsys.readouterr().out
    assert "note:" not in printed and "simulation" not in printed and "mug" in printed


def test_times_notes_and_widths_as_people_give_them(sheet: Path, capsys: Capture) -> None:
    words = ("1", "--outcome", "lifted", "--note", "  wet ", "--time", "2026-05-05")
    assert trials("record", sheet, *words, "--width-mm", "500") == 0
    assert "opens 80 mm" in capsys.readouterr().err
    done = trial(sheet, 1)
    assert (done.note, done.time) == ("wet", "2026-05-05")
    assert done.robot is not None and done.robot.width_mm == 500.0
    words = ("2", "--outcome", "lifted", "--note", " ", "--time", "2026-05-05T10:12")
    assert trials("record", sheet, *words, "--width-mm", "79") == 0
    assert not capsys.readouterr().err and not trial(sheet, 2).note
    local = datetime.fromisoformat("2026-05-05T10:12").astimezone()
    assert datetime.fromisoformat(trial(sheet, 2).time) == local
    assert trials("record", sheet, "1", "--note", "", "--correct") == 0
    assert not trial(sheet, 1).note


def test_next_is_what_is_open_when_it_is_recorded(
    sheet: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody else records the same just before."""
    record = TrialBook.record

    def faster(book: TrialBook, *words: Any, **entry: Any) -> RealTrial:
        record(TrialBook(sheet), "next", outcome="slipped")
        return record(book, *words, **entry)

    monkeypatch.setattr(TrialBook, "record", faster)
    assert trials("record", sheet, "next", "--outcome", "slipped") == 0
    assert "trial 2: slipped" in capsys.readouterr().out
    photo = sheet.parent / "any.png"
    photo.write_bytes(b"any")
    assert trials("record", sheet, "next", "--outcome", "slipped", "--photo", photo) == 2
    assert "any.png is not a readable image" in capsys.readouterr().err
    write_image(photo, np.zeros((4, 6, 3), np.uint8))
    assert trials("record", sheet, "next", "--outcome", "slipped", "--photo", photo) == 2
    told = capsys.readouterr().err
    assert (
        "trial 3 was changed by someone else; nothing was recorded, but the photo is kept" in told
    )
    assert trial(sheet, 3).photo == "" and trial(sheet, 4).outcome is None
    assert (sheet.parent / "photos" / "003.png").read_bytes() == photo.read_bytes()


def test_an_old_buffer_is_seen_and_mended(sheet: Path, capsys: Capture) -> None:
    buffer = sheet.read_text()
    trials("record", sheet, "2", "--outcome", "lifted", "--note", "good")
    sheet.write_text(buffer)
    assert trials("show", sheet) == 1
    shown = capsys.readouterr()
    assert "trial 2 lacks what was recorded: outcome lifted" in shown.err
    assert trials("restore", sheet) == 0
    assert "trial 2: restored, lifted" in capsys.readouterr().out
    assert trial(sheet, 2).note == "good"
    assert trials("show", sheet) == 0
    sheet.write_text(buffer)
    assert trials("restore", sheet, "--keep") == 0 and sheet.read_text() == buffer
    assert trials("show", sheet) == 0


@pytest.mark.thorough
@pytest.mark.skipif(
    bool(missing_render_libraries()), reason="the renderer's system libraries are missing"
)
def test_a_photo_is_measured_and_kept(sheet: Path, capsys: Capture) -> None:
    from burg_drake.scene import load_scene
    from tests.cameras.placement_photo import ScenePhotographer

    folder = sheet.parent
    scene = load_scene(folder / "run" / "scene.yaml")
    X_SC = make_pose(np.diag([1.0, -1.0, -1.0]), (0.25, 0.18, 0.7))
    X_SO = scene.X_SO("box")
    turned = make_pose(_about_z(4.0), (0.008, -0.003, 0.0))
    moved = make_pose(turned[:3, :3] @ X_SO[:3, :3], X_SO[:3, 3] + turned[:3, 3])
    photo = ScenePhotographer(scene).take(X_SC, INTRINSICS, {"box": moved})
    cv2.imwrite(str(folder / "shot.png"), photo.color[..., ::-1])
    words = ("--photo", folder / "shot.png", "--intrinsics", folder / "K.yaml")
    assert trials("record", sheet, "3", *words, "--outcome", "lifted") == 0
    done = trial(sheet, 3)
    assert done.photo == "photos/003.png" and done.outcome == "lifted"
    assert (folder / done.photo).read_bytes() == (folder / "shot.png").read_bytes()
    box = done.placement["box"]
    assert box.status == "measured" and box.offset_mm == pytest.approx((8.0, -3.0), abs=0.6)
    assert box.turn_deg == pytest.approx(4.0, abs=0.5)
    assert box.X_SO is not None and box.offset_sd_mm is not None
    np.testing.assert_allclose(box.X_SO.matrix()[:2, 3], moved[:2, 3], atol=1e-3)
    whole = load_placement(folder / "placements" / "003.yaml").instances["box"]
    assert whole.displacement is not None and whole.angle is not None
    assert box.offset_mm == pytest.approx([1e3 * way for way in whole.displacement], abs=1e-3)
    assert box.turn_deg == pytest.approx(math.degrees(whole.angle), abs=1e-3)

    kept = folder / "placements" / "003.yaml"
    assert trials("record", sheet, "4", "--placement", kept, "--note", "as before") == 0
    assert trial(sheet, 4).placement == done.placement
    kept.write_text(kept.read_text().replace(scene.content, "0" * 64))
    capsys.readouterr()
    assert trials("record", sheet, "4", "--placement", kept, "--correct") == 2
    assert "is of scene 'two' (000000000000), but trial 4 is on 'two'" in capsys.readouterr().err


def _about_z(degrees: float) -> np.ndarray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def test_a_photo_without_a_board_loses_nothing(sheet: Path, capsys: Capture) -> None:
    folder = sheet.parent
    cv2.imwrite(str(folder / "grey.png"), np.full((360, 480, 3), 128, np.uint8))
    words = ("--photo", folder / "grey.png", "--intrinsics", folder / "K.yaml")
    assert trials("record", sheet, "2", *words, "--outcome", "dropped") == 1
    error = capsys.readouterr().err
    assert "grey.png: the board was not found" in error and error.count("\n") == 1
    done = trial(sheet, 2)
    assert (done.outcome, done.placement) == ("dropped", {}) and done.photo
    assert trials("record", sheet, "2", *words, "--outcome", "dropped") == 2  # another photo
    assert trials("record", sheet, "2", *words, "--again", "--outcome", "lifted") == 1
    assert trial(sheet, 2).photo != done.photo and (folder / done.photo).exists()
