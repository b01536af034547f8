"""Scene and station of a row: found by content, beside the table, where they were, or as given."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from burg_drake.core import InvalidInputError
from burg_drake.evaluation import Run, find_inputs, origin_of
from burg_drake.scene import Scene


@pytest.fixture
def run(own_run: Run) -> Run:
    return own_run


def move_an_object(path: Path) -> None:
    path.write_text(path.read_text().replace("0.35", "0.36"))


def test_documents_are_where_they_were(run: Run, scene: Scene, tmp_path: Path) -> None:
    found = find_inputs(origin_of(run.document), "row 1", tmp_path / "elsewhere")
    assert found.scene.content == scene.content and found.scene.path == scene.path
    assert found.station.content == run.document.station.content
    assert found.notes == ()


def test_the_copies_of_the_run_serve_its_own_table(run: Run, scene: Scene, tmp_path: Path) -> None:
    move_an_object(scene.path)
    origin = origin_of(run.document)
    assert find_inputs(origin, "row 1", run.path).scene.content == scene.content
    with pytest.raises(InvalidInputError, match=r"three.yaml has content"):
        find_inputs(origin, "row 1", tmp_path)


def test_a_lost_scene_is_asked_for_by_its_content(run: Run, scene: Scene, tmp_path: Path) -> None:
    content, origin = scene.content, origin_of(run.document)
    moved = scene.path.rename(tmp_path / "moved.yaml")
    with pytest.raises(InvalidInputError) as caught:
        find_inputs(origin, "a.csv, row 1", tmp_path)
    message = str(caught.value)
    assert message.startswith(f"a.csv, row 1 needs the scene with content {content[:12]}")
    assert f"but {scene.path} does not exist; give its file" in message
    assert f"give its file (a copy is scene.yaml in the folder of run {origin.run})" in message
    assert "by force" not in message  # there is nothing to replay on
    assert find_inputs(origin, "row 1", tmp_path, scene=str(moved)).scene.content == content


def test_a_lost_station_is_said_with_the_scene(run: Run, scene: Scene, tmp_path: Path) -> None:
    scene.path.unlink()
    with pytest.raises(InvalidInputError) as caught:
        find_inputs(origin_of(run.document), "row 1", tmp_path, station="gone.yaml")
    first, second = str(caught.value).split("; and ")
    assert first.startswith("row 1 needs the scene") and "give its file" in first
    assert second.startswith("the station with content") and "give its file" in second
    assert "but gone.yaml does not exist; give" in second


def test_a_changed_scene_is_taken_by_force_only(run: Run, scene: Scene, tmp_path: Path) -> None:
    move_an_object(scene.path)
    origin = origin_of(run.document)
    with pytest.raises(InvalidInputError, match=f"or replay on {scene.path} by force"):
        find_inputs(origin, "row 1", tmp_path)
    found = find_inputs(origin, "row 1", tmp_path, force=True)
    assert found.scene.content != scene.content
    (note,) = found.notes
    assert note.startswith(f"the scene is not the one of the trial (content {scene.content[:12]})")


def test_a_missing_library_is_named(run: Run, scene: Scene, tmp_path: Path) -> None:
    shutil.rmtree(scene.library.root)
    with pytest.raises(InvalidInputError, match=r"three.yaml: library: shapes does not exist"):
        find_inputs(origin_of(run.document), "row 1", tmp_path)


def test_another_station_is_refused(run: Run, tmp_path: Path) -> None:
    text = (run.path / "station.yaml").read_text().replace("0.24", "0.25")
    (tmp_path / "other.yaml").write_text(text)
    with pytest.raises(InvalidInputError, match=r"needs the station .*robot models count"):
        find_inputs(
            origin_of(run.document), "row 1", run.path, station=str(tmp_path / "other.yaml")
        )
