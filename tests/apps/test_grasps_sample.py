"""`burg-drake grasps sample`."""

from __future__ import annotations

import json
import re
from pathlib import Path

import h5py
import numpy as np
import pytest

from burg_drake.apps import build_parser, main
from burg_drake.apps.commands import reach
from burg_drake.core import GraspSet
from burg_drake.evaluation import given_candidates, read_grasps, sample_candidates, scored_set
from burg_drake.formats import read_grasp_file
from burg_drake.objects import load_library
from burg_drake.scene import load_scene
from burg_drake.station import load_station

TILTED = """\
version: 1
name: tilted
library: household
instances:
  - object: box
    X_SO: {{translation: [0.3, 0.2, 0.1], rpy_deg: [35, 40, 0]}}
{second}
"""

RENAMED = ("--rename", "mug=cup")
Capture = pytest.CaptureFixture[str]


def sample(*arguments: str | Path) -> int:
    return main(["grasps", "sample", *map(str, arguments)])


@pytest.mark.parametrize("suffix", [".h5", ".npz"])
def test_a_scene(scene_file: Path, tmp_path: Path, capsys: Capture, suffix: str) -> None:
    out = tmp_path / f"grasps{suffix}"
    assert sample(scene_file, "-n", 10, "-o", out) == 0
    grasps = GraspSet.load(out)
    assert grasps.column("instance").tolist() == ["mug"] * 10 + ["bottle"] * 10
    assert grasps.provenance["scene"] == str(scene_file.resolve())
    words = [line.split() for line in capsys.readouterr().out.splitlines() if line.strip()]
    assert words[0] == ["on", "asked", "found", "rays", "tried", "seconds"]
    assert [row[:3] for row in words[2:4]] == [["mug", "10", "10"], ["bottle", "10", "10"]]
    assert words[-1] == ["wrote", "20", "grasps", "to", str(out)]


@pytest.mark.thorough
def test_evaluate_and_reach_judge_the_same_grasps(scene_file: Path, tmp_path: Path) -> None:
    assert sample(scene_file, "-n", 20, "--seed", 7, "-o", tmp_path / "grasps.h5") == 0
    scene, station = load_scene(scene_file), load_station("panda_tabletop")
    given = given_candidates(scene, read_grasps(scene, tmp_path / "grasps.h5").by_instance)
    assert given.id == sample_candidates(scene, station, 20, seed=7).id
    asked = ["reach", str(scene_file), "--grasps-per-object", "20", "--seed", "7", "--only", "mug"]
    reached = reach.sampled_grasps(build_parser().parse_args(asked), scene, station)
    assert list(reached) == ["mug"]
    assert [f"mug-{id}" for id in reached["mug"].id] == given.id[:20]


@pytest.mark.thorough
def test_a_library_with_many_options(tmp_path: Path) -> None:
    faces = len(load_library("household").surface("mug").faces)
    np.save(tmp_path / "weights.npy", np.arange(float(faces)))
    out = tmp_path / "grasps.h5"
    options = [
        "--only",
        "mug",
        "--only",
        "can",
        "--friction",
        "0.3",
        "--approaches",
        "2",
        "--quiet",
    ]
    options += ["--standoffs-mm", "0", "4", "-4", "--diverse", "2"]
    options += ["--weights", f"mug={tmp_path / 'weights.npy'}"]
    assert sample("household", "-n", 12, *options, "-o", out) == 0
    grasps = GraspSet.load(out)
    assert grasps.object.tolist() == ["mug"] * 12 + ["can"] * 12
    told = grasps.provenance["parts"]["mug"]
    assert told["standoffs"] == [0.0, 0.004, -0.004]
    assert (told["friction"], told["approaches"], told["diverse"]) == (0.3, 2, 2)
    assert told["weights"] is not None and told["tested"]
    assert grasps.provenance["parts"]["can"]["weights"] is None


@pytest.mark.thorough
def test_clear_grasps_keep_a_margin(scene_file: Path, tmp_path: Path) -> None:
    """The screen itself, asked about the grasps of each file, is the oracle."""
    scene, station = load_scene(scene_file), load_station("panda_tabletop")
    found = {}
    for options in ((), ("--margin-mm", "4"), ("--conservative",)):
        out = tmp_path / "grasps.h5"
        mug = ["--only", "mug", "-n", 30, "-o", out]
        assert sample(scene_file, *options, *mug) == 0
        found[options] = GraspSet.load(out)
    least = {
        options: scored_set(grasps, scene.library, station, scene).column("clearance").min()
        for options, grasps in found.items()
    }
    assert 0.0 <= least[()] < 0.004 <= least["--margin-mm", "4"]
    assert least["--conservative",] >= 0.0
    assert set(found["--conservative",].id) != set(found[()].id)
    settings = found["--margin-mm", "4"].provenance["settings"]
    assert (settings["margin"], settings["conservative"]) == (0.004, False)


@pytest.mark.parametrize("way", ["sampled", "renamed and converted"])
def test_files_of_other_projects_name_the_mesh(
    scene_file: Path, tmp_path: Path, capsys: Capture, way: str
) -> None:
    options = ["--only", "mug", "-n", 5, "-o"]
    graspgen, acronym = tmp_path / "mug.json", tmp_path / "theirs.h5"
    if way == "sampled":
        assert sample("household", *options, graspgen) == 0
        assert sample("household", *options, acronym, "--to", "acronym") == 0
    else:
        ours = str(tmp_path / "ours.h5")
        assert sample(scene_file, *options, ours) == 0
        for out, format in ((graspgen, "graspgen"), (acronym, "acronym")):
            assert main(["grasps", "convert", ours, str(out), "--to", format, *RENAMED]) == 0
    said = capsys.readouterr()
    assert "it is not known which mesh" not in said.out + said.err
    mug = load_library("household").entry("mug")
    mesh = f"package://burg_drake/models/household/{mug.mesh}"
    told = json.loads(graspgen.read_text())["object"]
    assert told == {"file": mesh, "scale": 1.0}
    with h5py.File(acronym) as file:
        assert file["object/file"].asstr()[()] == told["file"]
        assert file["object/scale"][()] == 1.0
        assert file["object/mass"][()] == mug.mass
        assert file["object/friction"][()] == mug.friction
        assert file["object/com"][()].tolist() == list(mug.mass_properties.center_of_mass)
    for path in (graspgen, acronym):
        assert set(read_grasp_file(path).grasps.object) == {"mug"}


def test_a_folder_gets_a_file_an_object(scene_file: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "out"
    out.mkdir()
    assert sample(scene_file, "-n", 3, "-o", out, "--to", "acronym") == 0
    assert sorted(path.name for path in out.iterdir()) == ["bottle.h5", "mug.h5"]
    assert len(read_grasp_file(out / "mug.h5").grasps) == 3
    text = capsys.readouterr().out
    assert f"wrote 6 grasps to {out} as acronym (ACRONYM)\n" in text and "NaN for 3" in text
    new = f"{tmp_path}/new/"
    assert sample(scene_file, "-n", 3, "--only", "mug", "-o", new, "--to", "acronym") == 0
    assert [path.name for path in Path(new).iterdir()] == ["mug.h5"]


def test_nothing_is_sampled_in_vain(
    scene_file: Path, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    from burg_drake.evaluation.grasp_sets import sampling

    monkeypatch.delattr(sampling, "sample_on_scene")
    (tmp_path / "file").write_text("")
    for out, message in (
        (("x.h5", "--to", "acronym"), "grasps of one object, and these are of 2 (bottle, mug)"),
        ((tmp_path / "file" / "x.h5",), "cannot write"),
        ((tmp_path,), "is a folder; say in which format to write (--to)"),
    ):
        assert sample(scene_file, "-n", 3, "-o", *out) == 2
        assert message in capsys.readouterr().err


def test_instances_by_name_or_object(scene_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "grasps.h5"
    assert sample(scene_file, "--only", "bottle", "-n", 5, "--from-arm-side", "-o", out) == 0
    assert set(GraspSet.load(out).column("instance")) == {"bottle"}


def test_an_object_without_grasps_is_said(
    scene_file: Path, tmp_path: Path, capsys: Capture
) -> None:
    """A box stands on a corner: no line across it is level, and the hand comes straight down."""
    scene_file.write_text(TILTED.format(second="  - object: mug"))
    out = tmp_path / "grasps.h5"
    options = ["--friction", "0.05", "--approach-angle", "5", "--blind", "-n", 5, "-o", out]
    assert sample(scene_file, *options) == 0
    (note,) = (line for line in capsys.readouterr().out.splitlines() if "note" in line)
    counts = re.findall(r"(?<![\d.])[\d,]+(?= [a-z])", note.partition("through it")[2])
    assert note.startswith("note: box: only 0 of 5 grasps were found: of 262,144 lines through it ")
    assert "allow no approach within the limits" in note and note.endswith("would help")
    lines = GraspSet.load(out).provenance["parts"]["box"]["left_out"]
    assert counts == [f"{n:,}" for n in sorted(lines.values(), reverse=True) if n]
    assert GraspSet.load(out).column("instance").tolist() == ["mug"] * 5
    scene_file.write_text(TILTED.format(second=""))
    assert sample(scene_file, *options) == 1
    assert len(GraspSet.load(out)) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["tabletop", "-o", "x.h5"], "tabletop is neither a scene nor an object library"),
        (["household", "--only", "bxo", "-o", "x.h5"], "has no object 'bxo'; did you mean 'box'?"),
        (["household", "--only", "mug, bxo", "-o", "x.h5"], "has no object 'bxo'; did you mean"),
        (["household", "--approach-angle", "60", "-o", "x.h5"], "limit the approach"),
        (["tabletop_six", "--only", "can", "-o", "x.h5"], "has no free instance 'can'"),
        (["tabletop_six", "-o", "x.txt"], "no format of grasps has the suffix '.txt'"),
        (
            ["tabletop_six", "-o", "x.csv"],
            "have grasps in the world frame; write burg_drake's own format (--to burg_drake)",
        ),
        (["tabletop_six", "--to", "acronim", "-o", "x.h5"], "there is no grasp format 'acronim'"),
        (["household", "--weights", "mug=no.npy", "-o", "x.h5"], "cannot read no.npy"),
        (
            ["household", "--margin-mm", "3", "--blind", "-o", "x.h5"],
            "margin and conservative concern the hand, which blind sampling ignores",
        ),
        (["household", "--standoffs-mm", "20", "-o", "x.h5"], "give -9 to 9.5 mm"),
    ],
)
def test_what_cannot_be_done(
    arguments: list[str], message: str, tmp_path: Path, capsys: Capture, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert sample(*arguments) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("option", "value"),
    [("--standoffs-mm", "x"), ("--weights", "mug"), ("--diverse", "0"), ("-n", "0")],
)
def test_values_that_no_option_takes(option: str, value: str, capsys: Capture) -> None:
    with pytest.raises(SystemExit) as ended:
        sample("household", "-o", "x.h5", option, value)
    assert ended.value.code == 2
    assert repr(value) in capsys.readouterr().err


def test_weights_that_are_no_array(tmp_path: Path, capsys: Capture) -> None:
    np.savez(tmp_path / "two.npz", a=np.ones(3))
    (tmp_path / "text.npy").write_text("1 2 3")
    for name, message in (("two.npz", "is not a .npy file"), ("text.npy", "is not a .npy file")):
        given = f"mug={tmp_path / name}"
        assert sample("household", "--weights", given, "-o", tmp_path / "x.h5") == 2
        assert message in capsys.readouterr().err
