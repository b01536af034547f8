"""What is selected by the mouse: a click, a click with Ctrl, a rectangle."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser

from burg_drake.ui.pointing.centers import center
from burg_drake.ui.pointing.object_drags import ObjectDrags
from burg_drake.ui.pointing.pointer import PageCamera
from burg_drake.ui.widgets import PageActions

ADD_MODIFIER = "cmd/ctrl"


class Picking:
    """Selects instances.

    A click on an object reaches us twice, of the object and of the scene; the second one must not
    be taken for a click beside all objects.

    Args:
        scene: of viser.
        actions: what may be done with the session.
        drags: with Shift they are no rectangles.
    """

    def __init__(self, scene: viser.SceneApi, actions: PageActions, drags: ObjectDrags) -> None:
        self._actions, self._drags = actions, drags
        self._last: tuple[int, tuple[float, float]] | None = None

        async def beside(event: Any) -> None:
            last, self._last = self._last, None
            if last != (event.client_id, tuple(event.screen_pos)):
                actions.submit(lambda: actions.session.select(()), event.client)

        scene.on_click()(beside)  # type: ignore[arg-type]
        for modifier in ("shift", "cmd/ctrl+shift"):
            scene.on_rect_select(modifier=modifier)(self._rectangle)  # type: ignore[arg-type]

    def attach(self, handle: Any, name: str) -> None:
        """Lets pages select an instance by a click on a handle of viser."""

        async def choose(event: Any) -> None:
            self._last = (event.client_id, tuple(event.screen_pos))
            self._actions.submit(lambda: self._actions.session.select((name,)), event.client)

        async def add(event: Any) -> None:
            self._last = (event.client_id, tuple(event.screen_pos))
            self._actions.submit(lambda: self._toggle(name), event.client)

        handle.on_click(choose)
        handle.on_click(modifier=ADD_MODIFIER)(add)

    async def _rectangle(self, event: Any) -> None:
        camera = PageCamera.of(event.client.camera)
        lower, upper = np.array(event.screen_min), np.array(event.screen_max)
        if self._drags.is_end_of_turn(event.client_id, np.stack([lower, upper])):
            return
        more = ADD_MODIFIER in (event.modifier or "")
        self._actions.submit(lambda: self._within(camera, lower, upper, more), event.client)

    def _within(self, camera: PageCamera, lower: Any, upper: Any, more: bool) -> None:
        view = self._actions.session.view
        names = [
            name for name in view.instances if _center_within(view, name, camera, lower, upper)
        ]
        before = view.selection if more else ()
        self._actions.session.select(dict.fromkeys((*before, *names)))

    def _toggle(self, name: str) -> None:
        selection = self._actions.session.view.selection
        if name in selection:
            self._actions.session.select([other for other in selection if other != name])
        else:
            self._actions.session.select((*selection, name))


def _center_within(view: Any, name: str, camera: PageCamera, lower: Any, upper: Any) -> bool:
    """Whether the middle of an instance's bounds is seen within a rectangle."""
    seen = camera.on_screen(center(view, name))[0]
    return bool((seen >= lower).all() and (seen <= upper).all())
