from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.core import UnknownNameError, paths, resolve_reference


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An installation with two scenes, a library and a hand, and an empty working directory."""
    root, cwd = tmp_path / "data", tmp_path / "cwd"
    for file in (
        "scenes/tabletop_six.yaml",
        "scenes/close_six.yaml",
        "models/household/library.yaml",
        "models/panda/panda_arm.sdf",
        "models/hands/panda_hand.yaml",
    ):
        (root / file).parent.mkdir(parents=True, exist_ok=True)
        (root / file).write_text("version: 1\n")
    cwd.mkdir()
    monkeypatch.chdir(cwd)
    monkeypatch.setattr(paths, "data_root", lambda: root)
    return root


def test_built_in_names_and_package_references(root: Path):
    assert resolve_reference("tabletop_six", "scenes") == root / "scenes/tabletop_six.yaml"
    assert resolve_reference("household", "models") == root / "models/household"
    assert resolve_reference("panda_hand", "models/hands") == root / "models/hands/panda_hand.yaml"
    arm = resolve_reference("package://burg_drake/models/panda/panda_arm.sdf")
    assert arm == root / "models/panda/panda_arm.sdf"
    assert paths.builtin_names("models") == ["household"]  # the arm is not a library


def test_paths_start_from_the_document_or_the_working_directory(root: Path, tmp_path: Path):
    for folder in (tmp_path / "mine", Path.cwd()):
        folder.mkdir(exist_ok=True)
        (folder / "scene.yaml").write_text(str(folder))
    assert resolve_reference("scene.yaml", "scenes") == Path.cwd() / "scene.yaml"
    assert (
        resolve_reference("scene.yaml", "scenes", tmp_path / "mine")
        == tmp_path / "mine" / "scene.yaml"
    )
    assert resolve_reference("../mine/scene.yaml", "scenes") == tmp_path / "mine" / "scene.yaml"
    absolute = tmp_path / "mine" / "scene.yaml"
    assert resolve_reference(absolute, "scenes", root) == absolute


def test_messages_list_what_exists(root: Path, tmp_path: Path):
    def message(*arguments):
        with pytest.raises(UnknownNameError) as caught:
            resolve_reference(*arguments)
        return str(caught.value)

    assert message("tabletop_sx", "scenes") == (
        "scene tabletop_sx does not exist; did you mean 'tabletop_six'?"
        " Known: close_six, tabletop_six"
    )
    assert message("lib", "models", tmp_path) == (
        f"lib does not exist (relative to {tmp_path}); known: household"
    )
    assert message("nowhere/file.obj") == "nowhere/file.obj does not exist"
    assert message("package://burg_drake/models/none.sdf") == (
        f"package://burg_drake/models/none.sdf does not exist in {root}"
    )
    assert message("package://other/x.sdf").startswith(
        f"package://other/x.sdf: package 'other' is not found in {Path.cwd()} and the folders"
    )


@pytest.mark.parametrize("reference", ["~nobody-of-that-name/lib", "x" * 5000, "lib/link"])
def test_paths_that_cannot_be(root: Path, reference: str):
    """Nobody's home, a name beyond any limit, and a link to itself."""
    Path("lib").mkdir()
    Path("lib/link").symlink_to("link")
    with pytest.raises(UnknownNameError, match=r"has no home folder|does not exist"):
        resolve_reference(reference, "models", Path.cwd())


def test_the_installation_has_its_data():
    assert resolve_reference("household", "models").joinpath("library.yaml").is_file()
    assert resolve_reference("tabletop_six", "scenes").is_file()
    assert resolve_reference("panda_tabletop", "stations").is_file()
    assert resolve_reference("panda_hand", "models/hands").is_file()
