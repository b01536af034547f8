"""A session: commands, history, selection, and files."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from burg_drake.compose import (
    AddObject,
    ComposeSession,
    Delete,
    FileChanged,
    MoveObjects,
    Rename,
    SceneInUse,
    SceneLock,
    UnsavedChanges,
    journal_path,
    recover_journal,
    scene_storage,
    state as history_module,
)
from burg_drake.core import InvalidInputError, UnknownNameError, make_pose
from burg_drake.generation import sample_scene
from burg_drake.scene import SceneRecipe, load_scene, save_scene
from burg_drake.station import Station


def test_steps_are_undone_and_redone(session: ComposeSession) -> None:
    empty = session.view.document
    session.do(AddObject("bowl", position=(0.1, 0.15)))
    placed = session.do(AddObject("bowl", position=(0.3, 0.15)))
    assert placed.selection == ("bowl_2",)
    assert placed.status == {"bowl": "ok", "bowl_2": "ok"}
    session.do(Delete(("bowl",)))
    assert session.undo().selection == ("bowl",)
    session.undo()
    assert session.undo().document == empty
    session.redo()
    assert session.redo().document == placed.document
    assert session.view.redo_label == "delete bowl"


@pytest.fixture
def slow_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(history_module, "AMEND_PERIOD", 3600.0)


@pytest.mark.usefixtures("slow_machine")
def test_what_is_typed_bit_by_bit_is_one_step(session: ComposeSession) -> None:
    mug = session.do(AddObject("mug"))
    old = "mug"
    for new in ("b", "bo", "box"):
        session.do(Rename(old, new), field="Name")
        old = new
    with pytest.raises(InvalidInputError):
        session.do(Rename("box", "box/"), field="Name")
    named = session.do(Rename("box", "box2"), field="Name")
    assert list(named.instances) == ["box2"]
    for x in (0.002, 0.021, 0.21):
        moved = session.do(MoveObjects({"box2": make_pose(p_AB=(x, 0.1, 0.0))}), field="x")
    journal = recover_journal(journal_path(session.folder / "new_scene.yaml"))
    assert journal is not None and journal.history is not None
    documents = [mug.document, named.document, moved.document]
    assert [s.state.document for s in journal.history.steps][1:] == documents
    assert journal.history.position == 3
    assert session.undo().document == named.document
    assert session.undo().document == mug.document and session.view.redo_label == "rename mug"


@pytest.mark.usefixtures("slow_machine")
def test_what_was_typed_stays_a_step_once_something_else_was_done(
    session: ComposeSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    session.do(AddObject("mug"))
    poses = iter(make_pose(p_AB=(x, 0.1, 0.0)) for x in np.linspace(0.1, 0.3, 40))

    def steps(between: Callable[[], object]) -> int:
        before = session.do(MoveObjects({"mug": next(poses)})).document
        session.do(MoveObjects({"mug": next(poses)}), field="x")
        between()
        session.do(MoveObjects({"mug": next(poses)}), field="x")
        count = 1
        while session.undo().document != before:
            count += 1
        return count

    assert steps(lambda: None) == 1
    assert steps(lambda: session.select(["mug"])) == 2
    assert steps(lambda: session.do(MoveObjects({"mug": next(poses)}), field="y")) == 3
    assert steps(lambda: session.do(MoveObjects({"mug": next(poses)}))) == 3
    assert steps(session.save) == 2
    assert steps(lambda: monkeypatch.setattr(history_module, "AMEND_PERIOD", 0.0)) == 1
    assert steps(lambda: None) == 2  # too late
    monkeypatch.setattr(history_module, "AMEND_PERIOD", 3600.0)
    # typed back to what it was, there is nothing to undo; and nothing typed, nothing to amend
    start = session.view
    session.do(MoveObjects({"mug": next(poses)}), field="x")
    back = session.do(MoveObjects({"mug": start.X_SO("mug")}), field="x")
    assert back.document == start.document and back.undo_label == start.undo_label
    session.do(MoveObjects({"mug": start.X_SO("mug")}), field="y")
    session.do(MoveObjects({"mug": next(poses)}), field="y")
    assert session.undo().document == start.document


def test_a_drag_is_one_step_and_tells_of_collisions_on_its_way(session: ComposeSession) -> None:
    session.do(AddObject("bowl", position=(0.1, 0.15)))
    start = session.do(AddObject("box", position=(0.3, 0.15)))
    drag = session.drag(["box"])
    held = drag.move_by((-0.2, 0.0, 0.3))
    assert held.status == {"bowl": "collision", "box": "collision"}
    assert held.revision == start.revision
    assert held.X_SO("box")[2, 3] == start.X_SO("box")[2, 3]  # movement is planar
    assert drag.cancel().document == start.document
    drag = session.drag(["box"])
    drag.move_by((0.01, 0.0, 0.0))
    assert drag.end().undo_label == "move box"
    assert session.undo().document == start.document


def test_what_is_refused_changes_nothing(session: ComposeSession) -> None:
    before = session.do(AddObject("mug"))
    with pytest.raises(InvalidInputError, match="'mug' has NaN"):
        session.do(MoveObjects({"mug": make_pose(p_AB=(np.nan, 0.0, 0.0))}))
    assert session.view is before


def test_a_file_that_was_changed_is_not_overwritten(session: ComposeSession) -> None:
    session.do(AddObject("mug"))
    path = session.save("breakfast").path
    assert path is not None
    assert load_scene(path).document == session.view.document
    theirs = path.read_text() + "# theirs\n"
    path.write_text(theirs)
    assert session.refresh().notices == (
        f"{path} was changed by another program; load it, or overwrite it by saving",
    )
    session.do(Delete(("mug",)))
    with pytest.raises(FileChanged, match=r"was changed by another program"):
        session.save()
    assert path.read_text() == theirs
    with pytest.raises(UnsavedChanges):
        session.load()
    assert session.load(discard=True).status == {"mug": "ok"}


def test_a_sampled_scene_that_is_changed_forgets_how_it_was_made(
    station: Station, tmp_path: Path
) -> None:
    recipe = SceneRecipe(library="household", count=2, station="wsg_tabletop", settle=False)
    path = tmp_path / "sampled.yaml"
    save_scene(sample_scene(recipe).scene.document, path)
    with ComposeSession.open(path, station) as session:
        name = next(iter(session.view.instances))
        assert session.view.document.origin is not None
        session.do(Rename(name, "other"))
        session.save()
        assert load_scene(path).document.origin is None
        assert session.undo().document.origin is not None


def test_what_is_not_moved_keeps_its_digits(station: Station, tmp_path: Path) -> None:
    path = tmp_path / "exact.yaml"
    path.write_text(
        "version: 1\nname: exact\nlibrary: household\ninstances:\n"
        "  - {object: can, X_SO: {translation: [0.12345678901, 0.2, 0.06],"
        " quaternion_wxyz: [0.6, 0.0, 0.0, 0.8]}}\n"
        "  - {object: marble, X_SO: {translation: [0.4, 0.2, 0.0]}}\n"
    )
    with ComposeSession.open(path, station) as session:
        drag = session.drag(["can", "marble"])
        drag.move_by((0.01, 0.0, 0.0))
        drag.move_by((0.0, 0.0, 0.0))
        assert not drag.end().changed
        session.do(Delete(("marble",)))
        session.save()
    assert "[0.12345678901, 0.2, 0.06]" in path.read_text()
    assert "[0.6, 0.0, 0.0, 0.8]" in path.read_text()


def test_a_scene_with_unknown_objects_is_refused_and_the_open_one_stays(
    session: ComposeSession,
) -> None:
    session.do(AddObject("mug"))
    kept = session.save("breakfast")
    assert kept.path is not None
    right = kept.path.read_text()
    wrong = right.replace("object: mug", "object: mugg")
    strange = kept.path.with_name("strange.yaml")
    strange.write_text(wrong)
    told = r"strange.yaml: instances\[0\]: .*'mugg'.*mug"
    for refused in (
        lambda: session.load("strange"),
        lambda: ComposeSession.open(strange, session.station),
    ):
        with pytest.raises(UnknownNameError, match=told):
            refused()
    assert session.view.document == kept.document and session.view.path == kept.path
    assert not strange.with_name(".strange.yaml.journal").exists()
    strange.write_text(right)  # it is not left locked
    with ComposeSession.open(strange, session.station) as other:
        assert list(other.view.instances) == ["mug"]

    kept.path.write_text(wrong)  # the open one itself
    with pytest.raises(UnknownNameError, match=r"breakfast.yaml: instances\[0\]: .*'mugg'"):
        session.load()
    assert session.view.document == kept.document and session.view.undo_label == "add mug"
    assert list(session.do(AddObject("can")).instances) == ["mug", "can"]
    assert session.save(overwrite=True).saved


def test_two_editors_never_hold_one_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first editor lets go, and so removes its lock file, after the second has opened that
    file and before it locks it: the lock of a file that is gone keeps no third editor out."""
    scene = tmp_path / "breakfast.yaml"
    first = [SceneLock(scene)]
    lock_file = scene_storage.try_lock

    def lock_late(file: int) -> bool:
        if first:
            first.pop().release()
        return lock_file(file)

    monkeypatch.setattr(scene_storage, "try_lock", lock_late)
    second = SceneLock(scene, "http://127.0.0.1:7200")
    with pytest.raises(SceneInUse, match=r"is already open at http://127.0.0.1:7200"):
        SceneLock(scene)
    second.release()
    SceneLock(scene).release()
    assert not list(tmp_path.iterdir())


def test_what_several_pages_do_at_once_is_all_done_and_saved(session: ComposeSession) -> None:
    """Each step is of the scene that the step before has left, on the disk as well."""
    session.do(AddObject("mug"))
    session.save("breakfast")
    failures: list[BaseException] = []

    def work(row: int) -> None:
        try:
            for k in range(6):
                session.do(AddObject("marble", position=(0.05 + 0.05 * k, 0.05 + 0.05 * row)))
                session.save()
        except BaseException as error:
            failures.append(error)

    pages = [threading.Thread(target=work, args=(row,)) for row in range(4)]
    for page in pages:
        page.start()
    for page in pages:
        page.join()
    assert failures == []
    view = session.view
    assert len(view.instances) == 25 and view.saved and view.path is not None
    assert load_scene(view.path).document == view.document
    found = recover_journal(journal_path(view.path))
    assert found is not None and found.history is not None and not found.damage
    assert [len(s.state.instances) for s in found.history.steps] == list(range(26))
