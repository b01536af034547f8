"""`burg-drake scene sample`: files, folders, again, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.apps import main
from burg_drake.scene import load_scene

SAMPLE = ("scene", "sample", "household", "--no-settle", "--quiet")
Captured = pytest.CaptureFixture[str]


def test_one_file_and_the_same_again(tmp_path: Path, capsys: Captured) -> None:
    file, again = tmp_path / "one.yaml", tmp_path / "two.yaml"
    layout = ("-n", "3", "--size", "a3", "--portrait", "--spacing", "touching", "--seed", "5")
    assert main([*SAMPLE, *layout, "-o", str(file)]) == 0
    assert capsys.readouterr().out == f"wrote {file}: 3 objects\n"
    scene = load_scene(file)
    assert scene.board.size == (0.297, 0.42)
    assert scene.document.origin is not None
    assert scene.document.origin.recipe.layout == "touching"
    assert main(["scene", "sample", "--again", str(file), "-o", str(again)]) == 0
    assert capsys.readouterr().out == f"wrote {again}: the same scene\n"
    assert again.read_bytes() == file.read_bytes()
    file.write_text(file.read_text().replace("object: ", "name: mine\n    object: ", 1))
    assert main(["scene", "sample", "--again", str(file), "-o", str(again)]) == 1
    assert "the file was changed after it was sampled" in capsys.readouterr().err


def test_a_folder_of_scenes(tmp_path: Path, capsys: Captured) -> None:
    folder = tmp_path / "scenes"
    command = [*SAMPLE, "--only", "can,mug", "-n", "4", "--repeat", "--size", "700x500"]
    assert main([*command, "--count", "2", "-o", str(folder)]) == 0
    assert capsys.readouterr().out == f"{folder}: 2 of 2 scenes accepted\n"
    assert main([*command, "--count", "3", "-o", str(folder)]) == 0
    assert capsys.readouterr().out == f"{folder}: 3 of 3 scenes accepted (1 new)\n"
    assert sorted(path.name for path in folder.iterdir()) == [
        "recipe.yaml",
        "scene_0000.yaml",
        "scene_0001.yaml",
        "scene_0002.yaml",
        "scenes.csv",
    ]
    names = list(load_scene(folder / "scene_0002.yaml").instances)
    assert len(set(names)) == 4 and all(name[:3] in ("can", "mug") for name in names)


def test_no_room(tmp_path: Path, capsys: Captured) -> None:
    file = tmp_path / "one.yaml"
    command = [*SAMPLE, "--only", "bowl,box", "-n", "2", "--size", "180x170", "--attempts", "3"]
    assert main([*command, "-o", str(file)]) == 1
    assert capsys.readouterr().err == (
        "burg-drake: 3 refused: an object found no place\n"
        "burg-drake: no scene: none of 3 attempts was accepted; an object found no place (--fewer"
        " accepts scenes without it); give a larger --size, a smaller -n, another --seed or more"
        " --attempts\n"
    )
    assert not file.exists()
    assert main([*command, "--fewer", "-o", str(file)]) == 0
    assert "no place was found for" in capsys.readouterr().err
    assert len(load_scene(file).instances) == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-o", "x.yaml"], "give a LIBRARY to sample from, or --again SCENE"),
        (
            ["household", "--count", "3", "-o", "x.yaml"],
            "-o x.yaml is a file, for a single scene; give a folder for 3",
        ),
        (
            ["household", "--size", "A9", "-o", "x.yaml"],
            "board size 'A9' does not exist; known: A0, A1, A2, A3, A4; or give WxH in mm",
        ),
        (["household", "-n", "5000", "-o", "x"], "-n 5000: a scene has 1000 objects at most"),
        (["household", "--force", "-o", "x"], "--force goes with --again"),
        (["--again", "tabletop_six", "-o", "x.yaml"], "has no `origin`, so it was not sampled"),
        (
            ["--again", "tabletop_six", "--seed", "3", "-o", "x.yaml"],
            "--again takes the recipe of its scene: leave out --seed",
        ),
    ],
)
def test_what_cannot_be(arguments: list[str], message: str, capsys: Captured) -> None:
    assert main(["scene", "sample", *arguments]) == 2
    assert message in capsys.readouterr().err
