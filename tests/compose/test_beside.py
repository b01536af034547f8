"""Sessions beyond editing: settling, another library, a changed library, the printout, drags from
several threads."""

from __future__ import annotations

import os
import shutil
import signal
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

from burg_drake.compose import (
    AddObject,
    ComposeSession,
    Delete,
    MoveObjects,
    SessionView,
    SettlingProposal,
    scene_of_known_objects,
)
from burg_drake.core import (
    InvalidInputError,
    SimulationError,
    TaskCancelled,
    UnknownNameError,
    resolve_reference,
)
from burg_drake.objects import LIBRARY_FILE, load_library
from burg_drake.scene import load_scene
from burg_drake.station import Station
from tests.hang_guard import HANG_GUARD


def test_settling_is_a_proposal(session: ComposeSession) -> None:
    session.do(AddObject("box", position=(0.2, 0.15)))
    session.restrict_movement(False)
    X_SO = session.view.X_SO("box")
    X_SO[2, 3] += 0.03
    hovering = session.do(MoveObjects({"box": X_SO}))
    views: list[SessionView] = []
    session.on_change(views.append)
    proposal = session.settle().wait(HANG_GUARD)
    assert session.view.proposal is proposal and session.view.document == hovering.document
    assert any(view.working for view in views) and session.view.working is None
    assert 0.029 < proposal.displacements["box"].distance < 0.031
    with pytest.raises(InvalidInputError, match=r"there is no proposal"):
        session.revert()
        session.accept()
    assert session.accept(proposal).undo_label == "settle"
    assert session.view.status == {"box": "ok"}
    with pytest.raises(InvalidInputError, match=r"the scene has changed since it was settled"):
        session.accept(proposal)
    assert session.undo().document == hovering.document

    job = session.settle()
    job.cancel()
    with pytest.raises(TaskCancelled):
        job.wait(HANG_GUARD)
    job = session.settle()
    while job.progress[1] == "waiting":
        time.sleep(0.001)
    process = session._settler.process
    assert process is not None
    os.kill(process, signal.SIGKILL)
    with pytest.raises(SimulationError, match=r"SIGKILL; the scene was not changed"):
        job.wait(HANG_GUARD)
    assert "cannot settle the scene" in session.view.notices[0]


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """A library that can be changed."""
    folder = tmp_path / "mine"
    whole = load_library("household")
    for name in ("can", "marble"):
        shutil.copytree(whole.root / name, folder / name)
    text = resolve_reference("household", "models").joinpath(LIBRARY_FILE).read_text()
    (folder / LIBRARY_FILE).write_text(only(text, "can", "marble"))
    return folder


def only(library: str, *names: str) -> str:
    """The document of a library with these objects only."""
    head, _, objects = library.partition("objects:\n")
    entries: dict[str, list[str]] = {}
    for line in objects.splitlines(keepends=True):
        if line.startswith("  ") and line[2] != " ":
            name = line.strip().rstrip(":")
        entries.setdefault(name, []).append(line)
    return head + "objects:\n" + "".join("".join(entries[name]) for name in names)


def test_a_library_that_loses_an_object_is_told(station: Station, library: Path) -> None:
    with ComposeSession.open(library, station, folder=library.parent) as session:
        session.do(AddObject("can", position=(0.1, 0.1)))
        session.do(AddObject("marble", position=(0.3, 0.2)))
        file = library / LIBRARY_FILE
        file.write_text(only(file.read_text(), "can"))
        view = session.refresh()
        assert view.notices == (
            f"library {library} has changed: it no longer has the objects of marble",
        )
        assert view.status == {"can": "ok", "marble": "unknown"}
        assert session.do(AddObject("can")).status["can_2"] == "ok"
        saved = session.save("kept").path
        assert saved is not None and "object: marble" in saved.read_text()
        session.do(Delete(("marble",)))
        session.save()
        assert set(load_scene(saved).instances) == {"can", "can_2"}
        session.undo()
        known = scene_of_known_objects(session.view.state, saved).document
        assert [instance.object for instance in known.instances] == ["can", "can"]
        settled = replace(known, instances=known.instances[:1])  # as if the other one had fallen
        kept = session.accept(SettlingProposal(known, settled, {}, {}, ("can_2",), 1.0))
        assert list(kept.instances) == ["can", "marble"]
        file.write_text("nonsense")
        assert "can no longer be read" in session.refresh().notices[-1]
        assert session.undo().instances


def test_another_library_is_a_step(session: ComposeSession, library: Path) -> None:
    session.do(AddObject("can", position=(0.1, 0.1)))
    view = session.use_library("mine")
    assert set(view.library.objects) == {"can", "marble"}
    assert view.undo_label == "use library household"
    saved = session.save("scene").path
    assert saved is not None and "library: mine\n" in saved.read_text()
    assert len(session.undo().library.objects) > 2
    session.do(AddObject("box"))
    with pytest.raises(UnknownNameError, match=r"mine has no 'box'; delete their instances"):
        session.use_library("mine")
    with pytest.raises(UnknownNameError, match=r"'../mine' is neither a library"):
        session.use_library("../mine")


def test_a_new_scene_takes_a_library_of_the_folder_alone(
    session: ComposeSession, library: Path
) -> None:
    assert session.new("mine").document.library == "mine"
    for elsewhere in ("../mine", str(library)):
        with pytest.raises(UnknownNameError, match=r"'.*mine' is neither a library"):
            session.new(elsewhere)


def test_names_of_files_stay_in_the_folder(session: ComposeSession) -> None:
    session.do(AddObject("can"))
    for name in ("../scene", "/tmp/scene", ".scene", "a/b", "", "x" * 300, "a\0b"):
        if name:
            with pytest.raises(InvalidInputError, match=r"cannot be used in paths"):
                session.save(name)
        with pytest.raises(InvalidInputError):
            session.load(name, discard=True)
    link = session.folder / "link.yaml"
    link.symlink_to(session.folder.parent / "elsewhere.yaml")
    with pytest.raises(InvalidInputError, match=r"is a link to another folder"):
        session.save("link")


def test_the_printout_has_what_is_on_the_board(session: ComposeSession) -> None:
    session.do(AddObject("can"))
    assert session.printout().pdf.startswith(b"%PDF")


def test_of_many_moves_at_once_the_last_one_counts(session: ComposeSession) -> None:
    start = session.do(AddObject("can", position=(0.05, 0.15))).X_SO("can")
    drag = session.drag(["can"])
    views: list[SessionView] = []

    def move(i: int) -> None:
        views.append(drag.move_by((0.01 * i, 0.0, 0.0)))

    threads = [threading.Thread(target=move, args=(i,)) for i in range(1, 20)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    drag.move_by((0.2, 0.0, 0.0))
    assert drag.end().X_SO("can")[0, 3] == pytest.approx(start[0, 3] + 0.2, abs=2e-6)
    assert len(views) == 19
    assert drag.is_over
    with pytest.raises(InvalidInputError, match=r"changed during the drag"):
        drag.move_by((0.0, 0.0, 0.0))
