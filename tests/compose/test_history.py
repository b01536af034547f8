"""Every step can be undone, redone, and found in the journal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from burg_drake.compose import ComposeSession, journal_path, recover_journal
from burg_drake.core import BurgError
from burg_drake.scene import SceneDocument
from burg_drake.station import Station
from tests.compose.random_commands import adding, commands

UNDO, REDO, SAVE = "undo", "redo", "save"
actions = st.tuples(
    st.lists(adding, min_size=2, max_size=4),
    st.lists(commands | st.sampled_from((UNDO, UNDO, REDO, SAVE)), min_size=8, max_size=16),
)


class Steps:
    """The expected history: the documents that the session showed, and a position."""

    def __init__(self, first: SceneDocument) -> None:
        self.documents = [first]
        self.at = 0

    @property
    def now(self) -> SceneDocument:
        return self.documents[self.at]

    def do(self, session: ComposeSession, action: Any) -> None:
        """Applies the same operation as the session, which may refuse it."""
        before = session.view
        try:
            if action == SAVE:
                view = session.save("saved", overwrite=True)
                self.documents = [_saved(d, view.document.library) for d in self.documents]
            elif action in (UNDO, REDO):
                view = session.undo() if action == UNDO else session.redo()
                self.at += 1 if action == REDO else -1
            else:
                view = session.do(action(list(before.instances)))
                if view.document != self.now:
                    self.documents[self.at + 1 :] = [view.document]
                    self.at += 1
        except BurgError:
            view = session.view
            assert view is before
        assert view.document == self.now
        assert view.changed == (not view.saved if view.path else self.at > 0)
        assert set(view.status) == set(view.instances) >= set(view.selection)


def _saved(document: SceneDocument, library: str) -> SceneDocument:
    return replace(document, name="saved", library=library)


@pytest.fixture(scope="module")
def session(station: Station, tmp_path_factory: pytest.TempPathFactory) -> ComposeSession:
    return ComposeSession.open("household", station, folder=tmp_path_factory.mktemp("scenes"))


@pytest.mark.thorough
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(actions)
def test_all_steps_are_undone_and_redone_and_recovered(
    session: ComposeSession, given_actions: tuple[list[Any], list[Any]]
) -> None:
    steps = Steps(session.new(discard=True).document)
    for action in given_actions[0] + given_actions[1]:
        steps.do(session, action)
    view = session.view
    journal = journal_path(view.path or session.folder / f"{view.document.name}.yaml")
    if len(steps.documents) > 1:
        found = recover_journal(journal)
        assert found is not None and found.history is not None and not found.damage
        assert [step.state.document for step in found.history.steps] == steps.documents
        assert found.history.position == steps.at
        assert found.history.undo_label == view.undo_label
        assert (found.saved == view.document) == view.saved
    for _ in range(steps.at):
        session.undo()
    assert session.view.document == steps.documents[0]
    assert session.view.undo_label is None
    for _ in steps.documents[1:]:
        session.redo()
    assert session.view.document == steps.documents[-1]
    assert session.view.redo_label is None
    if view.path is not None:
        view.path.unlink()


def test_the_folder_is_left_clean(session: ComposeSession) -> None:
    session.new(discard=True)
    session.close()
    assert not list(Path(session.folder).iterdir())
