"""Stable poses of the selected object: a picture and a probability each."""

from __future__ import annotations

from functools import partial
from typing import Any

import viser

from burg_drake.compose.commands import SetPose
from burg_drake.compose.document import nearest_stable_pose
from burg_drake.compose.editing import SessionView
from burg_drake.core import Array, rot_z, rotation_angle
from burg_drake.objects.library import ObjectEntry
from burg_drake.ui.view import ObjectPictures
from burg_drake.ui.widgets import PageActions, all_of, box, picture_button, quiet, show_picture

MAX_POSES = 12
"""Poses that are offered; further ones are rare."""
SAME_POSE_ANGLE = 0.02
"""An object is in a stable pose if it is tilted no further from it [rad]."""


class PosePanel:
    """Offers the stable poses that the objects selected have in common.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        self._gui, self._actions = gui, actions
        self._folder = gui.add_folder("Stable poses")
        with self._folder:
            self._text = gui.add_html("")
        self._buttons: list[Any] = []
        self._object: str | None = None
        self._pictures: ObjectPictures | None = None
        self._chosen: int | None = None

    def show(self, view: SessionView, pictures: ObjectPictures) -> None:
        """Brings the panel to a view."""
        objects = {view.instances[name].object for name in view.selection}
        self._folder.visible = bool(objects)
        object = objects.pop() if len(objects) == 1 else None
        entry = view.library.objects.get(object) if object else None
        if object != self._object or pictures is not self._pictures:
            self._object, self._pictures = object, pictures
            self._fill(entry)
        self._chosen = _pose_of(view)
        self.draw()

    def draw(self) -> None:
        """Shows the pictures that are there by now."""
        if self._object is None or self._pictures is None:
            return
        for k, button in enumerate(self._buttons):
            picture = self._pictures.get(self._object, k)
            show_picture(button, picture, chosen=k == self._chosen)

    def _set(self, stable_pose: int) -> None:
        session = self._actions.session
        session.do(SetPose(session.view.selection, stable_pose))

    def _fill(self, entry: ObjectEntry | None) -> None:
        for button in self._buttons:
            button.remove()
        self._buttons = []
        poses = entry.stable_poses if entry else ()
        self._text.visible = not poses
        if not poses:
            missing = "It has no stable poses." if entry else "Select objects of one kind."
            self._text.content = all_of(box(quiet(missing)))
        with self._folder:
            for k, pose in enumerate(poses[:MAX_POSES]):
                tested = "confirmed by dropping it" if pose.residual is not None else "not dropped"
                button = picture_button(
                    self._gui,
                    f"{100.0 * pose.probability:.0f} %",
                    None,
                    hint=f"Pose {k}: {100.0 * pose.probability:.1f} % of drops end so; {tested}"
                    + ("; it can roll on" if pose.rolls else ""),
                )
                self._actions.clicked(button, partial(self._set, k))
                self._buttons.append(button)


def _pose_of(view: SessionView) -> int | None:
    """The stable pose that a single selected object is in."""
    if len(view.selection) != 1:
        return None
    (name,) = view.selection
    if view.instances[name].object not in view.library.objects:
        return None
    found = nearest_stable_pose(view.state, name)
    if found is None:
        return None
    k, yaw = found
    R_SO: Array = view.X_SO(name)[:3, :3]
    R_k = rot_z(yaw) @ view.state.entry(name).X_SO(k)[:3, :3]
    return k if float(rotation_angle(R_k.T @ R_SO)) < SAME_POSE_ANGLE else None
