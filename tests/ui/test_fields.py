"""Fields of a page that no browser has open: keys come as viser passes them on."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

viser = pytest.importorskip("viser", reason="pages need viser: pip install 'burg-drake[ui]'")

from burg_drake.compose import AddObject, ComposeSession  # noqa: E402
from burg_drake.core import resolve_reference  # noqa: E402
from burg_drake.station import load_station  # noqa: E402
from burg_drake.ui import (  # noqa: E402
    SetupPage,
    TypedField,
    serve_page,
)
from tests.hang_guard import HANG_GUARD  # noqa: E402


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SetupPage]:
    """On a scene whose file has another name than the scene in it."""
    file = tmp_path_factory.mktemp("scenes") / "my_scene.yaml"
    file.write_text(resolve_reference("tabletop_six", "scenes").read_text())
    session = ComposeSession.open(file, load_station("wsg_tabletop"))
    with session, serve_page(port=0) as door:
        page = SetupPage(door.server, session)
        yield page
        page.close()


def press(field: TypedField, value: Any) -> None:
    """A browser's value of a field, as after a key."""
    handle = field.handle
    handle._impl.value = value
    event = viser.GuiEvent(client=None, client_id=0, target=handle)
    for callback in handle._impl.update_cb:
        loop = handle._impl.gui_api._event_loop
        asyncio.run_coroutine_threadsafe(callback(event), loop).result(HANG_GUARD)


def settle(page: SetupPage) -> None:
    assert page.actions.queue.idle(HANG_GUARD)


def test_a_scene_is_saved_to_its_file_whatever_the_scene_is_called(page: SetupPage) -> None:
    session = page.actions.session
    path = session.folder / "my_scene.yaml"
    page._files.save(None)
    assert session.view.path == path and session.view.document.name == "tabletop_six"
    assert [p for p in Path(session.folder).iterdir() if p.suffix == ".yaml"] == [path]


@pytest.mark.thorough
def test_what_is_typed_is_one_step_and_what_is_refused_is_set_back(page: SetupPage) -> None:
    session = page.actions.session
    session.do(AddObject("marble"))
    settle(page)
    before, undo_label = session.view.document, session.view.undo_label
    field = page._object._name
    for name in ("b", "bo", "bowl"):  # there is a bowl
        press(field, name)
    page.actions.submit(page._refresh, wait_for_typing=True)
    settle(page)
    assert session.view.document == before and session.view.undo_label == undo_label
    assert field.handle.value == "marble"
    press(field, "glass")
    page.actions.submit(lambda: None)  # as Enter does
    settle(page)
    assert session.view.selection == ("glass",) and field.handle.value == "glass"
    position = page._object._pose_fields._position
    _, y, z = position.handle.value
    press(position, (210.0, y, z))
    page.actions.submit(lambda: None)
    settle(page)
    assert session.view.X_SO("glass")[0, 3] == pytest.approx(0.21)
    np.testing.assert_allclose(1e3 * session.view.X_SO("glass")[1, 3], y, atol=5e-3)
    session.undo()
    assert session.undo().document == before


@pytest.mark.thorough
def test_while_somebody_types_nothing_changes_the_field(page: SetupPage) -> None:
    session = page.actions.session
    session.select([next(iter(session.view.instances))])
    settle(page)
    field = page._object._name
    old = field.handle.value
    press(field, f"{old}_")
    session.notify("something else is told meanwhile")
    page._refresh()
    assert field.handle.value == f"{old}_"
    press(field, old)
    settle(page)
    assert session.view.selection == (old,)
