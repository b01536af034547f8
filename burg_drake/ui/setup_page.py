"""The setup page, on which a scene is composed in the browser."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from burg_drake.compose import ComposeSession, SessionView
from burg_drake.objects import ObjectLibrary
from burg_drake.ui.background_pictures import ObjectPictures
from burg_drake.ui.board_panels import BackdropPanel, BoardPanel, DisplayPanel
from burg_drake.ui.board_view import BoardLayers, BoardView
from burg_drake.ui.check_panels import CheckPanel, GraspPanel, ReachPanel, SettlePanel
from burg_drake.ui.gizmo import Gizmo
from burg_drake.ui.library_panels import FillPanel, LibraryPanel
from burg_drake.ui.object_drags import ObjectDrags, Picking
from burg_drake.ui.page_actions import PageActions
from burg_drake.ui.scene_panels import FilePanel, SummaryPanel
from burg_drake.ui.scene_view import (
    HeightView,
    ObjectMeshes,
    ProposalView,
    SceneView,
    ShownInstance,
)
from burg_drake.ui.selection_panels import ArrangePanel, ObjectPanel, PosePanel
from burg_drake.ui.shortcuts import ActionCall, KeysDialog, register_shortcuts, selection_actions
from burg_drake.ui.viewpoints import PageViews


class SetupPage:
    """The page of a session.

    Args:
        server: viser's server, still without content; see `serve_page`.
        session: the scene.

    Attributes:
        actions: actions of the page.
    """

    def __init__(self, server: viser.ViserServer, session: ComposeSession) -> None:
        self.actions = PageActions(server, session)
        self._server, self._session = server, session
        view = session.view
        self._pictures = self._pictures_of(view.library)
        self._meshes = ObjectMeshes(view.library)
        self._configure_scene()
        self._board = BoardView(server.scene, session.station)
        self._layers = BoardLayers(server.scene)
        self._gizmo = Gizmo(server.scene, self.actions)
        self._drags = ObjectDrags(self.actions, self._gizmo)
        self._picking = Picking(server.scene, self.actions, self._drags)
        self._scene = SceneView(server.scene, self._meshes, self._attach)
        self._proposal = ProposalView(server.scene)
        self._heights = HeightView(server.scene)
        self._build()
        self.actions.on_refused = self._refresh
        self._unsubscribe = session.on_change(
            lambda view: self.actions.submit(self._refresh, key="refresh", wait_for_typing=True)
        )
        server.on_client_disconnect(self._on_disconnect)
        self._refresh()

    def close(self) -> None:
        """Finishes the queued actions, and detaches from the session."""
        self._unsubscribe()
        self.actions.queue.close()
        self._reach.close()
        self._backdrop.close()
        self._pictures.close()

    def _configure_scene(self) -> None:
        scene, gui = self._server.scene, self._server.gui
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        gui.configure_theme(
            show_share_button=False,
            show_logo=False,
            control_width="large",
            brand_color=(34, 139, 230),
        )
        gui.set_panel_label("Setup")
        self._views = PageViews(self._server, lambda: self._session.view.document.board)

    def _build(self) -> None:
        gui, actions = self._server.gui, self.actions
        self._keys = KeysDialog(actions)
        left = gui.add_panel()
        with left.add_tab("Library", viser.Icon.PACKAGE):
            self._library = LibraryPanel(gui, actions)
        left.dock_left()
        left.set_width(290)
        panels: list[Any] = [SummaryPanel(gui, actions, self._keys)]
        tabs = gui.add_tab_group()
        with tabs.add_tab("Object", viser.Icon.CUBE):
            self._object = ObjectPanel(gui, actions, self._gizmo.switch_axes)
            self._poses = PosePanel(gui, actions)
            self._arrange = ArrangePanel(gui, actions)
            panels += [self._object, self._arrange]
        with tabs.add_tab("Scene", viser.Icon.LAYOUT_GRID):
            self._board_panel = BoardPanel(gui, actions)
            fill = FillPanel(gui, actions)
            self._files = FilePanel(gui, actions)
            panels += [self._board_panel, fill, self._files]
        with tabs.add_tab("Check", viser.Icon.CHECKLIST):
            panels += [CheckPanel(gui), SettlePanel(gui, actions), GraspPanel(gui, actions)]
        with tabs.add_tab("View", viser.Icon.EYE):
            self._display = DisplayPanel(gui, actions, self._views, self._refresh)
            self._reach = ReachPanel(gui, actions, self._layers)
            self._backdrop = BackdropPanel(gui, actions, self._layers)
            panels += [self._reach, self._backdrop]
        gui.main_panel.dock_right()
        gui.main_panel.set_width(330)
        self._panels = panels
        register_shortcuts(gui, actions, self._shortcut_calls())

    def _shortcut_calls(self) -> dict[str, ActionCall]:
        """Actions by the names of `SHORTCUTS`."""

        def anywhere(action: Callable[[], Any]) -> ActionCall:
            return lambda client: action()

        calls = selection_actions(self._session)
        return {name: anywhere(action) for name, action in calls.items()} | {
            "none": self._release_drags,
            "save": self._files.save,
            "settle": anywhere(self._session.settle),
            "axes": anywhere(self._gizmo.switch_axes),
            "snap": anywhere(self._arrange.snap),
            "top": partial(self._views.set_view, above=True),
            "front": partial(self._views.set_view, above=False),
            "colors": anywhere(self._display.next_colors),
            "help": self._keys.toggle,
        }

    def _release_drags(self, client: viser.ClientHandle | None) -> None:
        if client is not None and self._keys.close(client):
            return
        id = None if client is None else client.client_id
        if id is None or not (self._drags.cancel_drag(id) or self._gizmo.cancel_drag(id)):
            self._session.select(())

    def _attach(self, handle: Any, name: str) -> None:
        self._drags.attach(handle, name)
        self._picking.attach(handle, name)

    def _pictures_of(self, library: ObjectLibrary) -> ObjectPictures:
        def ready(wanted: object) -> None:
            self.actions.submit(
                self._draw_pictures, key="pictures", after=0.1, wait_for_typing=True
            )

        return ObjectPictures(library, ready)

    def _draw_pictures(self) -> None:
        with self._server.atomic():
            self._library.draw()
            self._poses.draw()

    def _refresh(self) -> None:
        """Updates the page from the session's current view."""
        view = self._session.view
        if view.library is not self._meshes.library:
            self._pictures.close()
            self._pictures = self._pictures_of(view.library)
            self._meshes = ObjectMeshes(view.library)
            self._scene.use_library(self._meshes)
        with self._server.atomic():
            self._board.show(view.document.board, markers=self._display.markers)
            self._scene.show(_shown_instances(view), self._display.coloring)
            self._proposal.show(view.proposal, self._meshes)
            self._heights.show(view)
            self._gizmo.show(view)
            for panel in self._panels:
                panel.show(view)
            self._library.show(view, self._pictures)
            self._poses.show(view, self._pictures)
            self._views.show()
        self._server.flush()

    async def _on_disconnect(self, client: viser.ClientHandle) -> None:
        self._drags.forget_page(client.client_id)
        self._gizmo.forget_page(client.client_id)
        self._views.forget_page(client.client_id)


def _shown_instances(view: SessionView) -> dict[str, ShownInstance]:
    fixed = {id(instance) for instance in view.document.background}
    return {
        name: ShownInstance(
            instance.object,
            view.X_SO(name),
            view.status.get(name, "ok"),
            name in view.selection,
            id(instance) in fixed,
        )
        for name, instance in view.instances.items()
    }
