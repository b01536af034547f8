"""Panels of the selected objects: names and poses, stable poses, and alignment."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import viser

from burg_drake.compose import (
    Align,
    Axis,
    Delete,
    Direction,
    Distribute,
    Duplicate,
    Edge,
    MoveObjects,
    PutDown,
    Rename,
    SessionView,
    SetFixed,
    SetPose,
    SnapToContact,
    SnapToGrid,
    Turn,
    nearest_stable_pose,
)
from burg_drake.core import Array, rot_z, rotation_angle, rotation_from_rpy, rpy_from_rotation
from burg_drake.objects import ObjectEntry
from burg_drake.ui.background_pictures import ObjectPictures
from burg_drake.ui.page_actions import NAME_TYPING_DELAY, PageActions
from burg_drake.ui.panel_parts import (
    SidePanel,
    color_dot,
    paragraph,
    picture_button,
    secondary_text,
    set_button_picture,
    small_heading,
    status_style,
    title_html,
)


class ObjectPanel(SidePanel):
    """Shows the selection and edits it.

    Args:
        gui: API of viser, inside the container for the panel.
        actions: actions of the page.
        switch_axes: switches the arrows between the axes of the board and of the object.
    """

    def __init__(
        self, gui: viser.GuiApi, actions: PageActions, switch_axes: Callable[[], None]
    ) -> None:
        super().__init__(gui, actions)
        session = actions.session
        self._text = gui.add_html("")
        self._instance_folder = gui.add_folder(None)
        with self._instance_folder:
            self._name = actions.typed_field(
                gui.add_text("Name", ""), self._rename, after=NAME_TYPING_DELAY
            )
            self._fixed = actions.on_choice(
                gui.add_checkbox(
                    "Background", False, hint="It stays where it is when the scene is simulated"
                ),
                lambda fixed: session.do(SetFixed(session.view.selection, fixed)),
            )
            self._pose_fields = _PoseFields(gui, actions)
        self._restrict = actions.on_choice(
            gui.add_checkbox(
                "Keep upright",
                True,
                hint="Objects keep their tilt while they are moved, and their height unless they"
                " are raised; without it they have handles for all six directions",
            ),
            session.restrict_movement,
        )
        self._axes = self._button(
            "Arrows: board or object",
            switch_axes,
            icon=viser.Icon.AXIS_X,
            hint="Arrows lie along the axes of the board, or of the object (X); rings always"
            " lie about those of the object",
        )
        self._selection_folder = gui.add_folder(None)
        with self._selection_folder:
            self._add_buttons()

    def show(self, view: SessionView) -> None:
        """Updates the panel from a view."""
        names = view.selection
        self._restrict.value = view.planar
        self._instance_folder.visible = len(names) == 1
        self._selection_folder.visible = bool(names)
        self._axes.visible = len(names) == 1 and not view.planar
        self._text.content = _selection_html(view)
        if len(names) == 1:
            self._name.show(names[0])
            self._fixed.value = view.instances[names[0]] in view.document.background
            self._pose_fields.show(view.X_SO(names[0]), free=not view.planar)

    def _rename(self, new: str) -> None:
        names = self._actions.session.view.selection
        if len(names) == 1:
            self._actions.session.do(Rename(names[0], new), field="name")

    def _add_buttons(self) -> None:
        icon, add = viser.Icon, self._selection_button
        add("−90°", lambda names: Turn(names, -90.0), width=2, hint="Turn clockwise")
        add("+90°", lambda names: Turn(names, 90.0), width=2, hint="Turn counter-clockwise")
        add("Copy", Duplicate, width=4, icon=icon.COPY, hint="Duplicate (Ctrl+D)")
        add("Delete", Delete, width=4, icon=icon.TRASH, hint="Delete (Del)")


class _PoseFields:
    """Fields of a pose: position, and yaw or all three angles."""

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        max_value = 100_000.0  # Millimetres or degrees.
        self._actions = actions
        zeros = (0.0, 0.0, 0.0)
        self._position = actions.typed_field(
            gui.add_vector3("x, y, z [mm]", zeros, step=0.01), self._place
        )
        self._yaw = actions.typed_field(
            gui.add_number("yaw [°]", 0.0, step=0.01, min=-max_value, max=max_value), self._turn
        )
        self._angles = actions.typed_field(
            gui.add_vector3("roll, pitch, yaw [°]", zeros, step=0.01), self._turn_freely
        )

    def show(self, X_SO: Array, *, free: bool) -> None:
        """Shows a pose (4, 4)."""
        position, angles = _pose_numbers(X_SO)
        self._yaw.handle.visible, self._angles.handle.visible = not free, free
        self._position.show(position)
        self._yaw.show(angles[2])
        self._angles.show(angles)

    def _place(self, typed_mm: tuple[float, ...]) -> None:
        """Moves the selected object; coordinates that were not edited stay exact."""
        if (X_SO := self._selected()) is None:
            return
        shown_mm, _ = _pose_numbers(X_SO)
        exact_mm = 1e3 * X_SO[:3, 3]
        p_mm = [e if t == s else t for t, s, e in zip(typed_mm, shown_mm, exact_mm, strict=True)]
        X_SO[:3, 3] = 1e-3 * np.array(p_mm)
        self._move(X_SO, "position")

    def _turn(self, yaw_deg: float) -> None:
        """Turns the selected object about the vertical."""
        if (X_SO := self._selected()) is not None:
            self._turn_freely((*_pose_numbers(X_SO)[1][:2], yaw_deg))

    def _turn_freely(self, typed_deg: tuple[float, ...]) -> None:
        """Turns the selected object; angles that were not edited stay exact."""
        if (X_SO := self._selected()) is None:
            return
        _, shown_deg = _pose_numbers(X_SO)
        exact_deg = np.rad2deg(rpy_from_rotation(X_SO[:3, :3]))
        rpy = [e if t == s else t for t, s, e in zip(typed_deg, shown_deg, exact_deg, strict=True)]
        if tuple(typed_deg) != shown_deg:
            X_SO[:3, :3] = rotation_from_rpy(np.deg2rad(rpy))
        self._move(X_SO, "angles")

    def _selected(self) -> Array | None:
        """(4, 4) pose of the selected object; None unless one object is selected."""
        view = self._actions.session.view
        return view.X_SO(view.selection[0]) if len(view.selection) == 1 else None

    def _move(self, X_SO: Array, field: str) -> None:
        session = self._actions.session
        name = session.view.selection[0]
        session.do(MoveObjects({name: X_SO}, changes_height=True), field=field)


def _pose_numbers(X_SO: Array) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """x, y, z [mm] and roll, pitch, yaw [degrees], rounded for display."""
    position = tuple((np.round(1e3 * X_SO[:3, 3], 2) + 0.0).tolist())
    angles = np.rad2deg(rpy_from_rotation(X_SO[:3, :3]))
    return position, tuple((np.round(angles, 2) + 0.0).tolist())


def _selection_html(view: SessionView) -> str:
    names = view.selection
    if not names:
        return paragraph(
            secondary_text(
                "Nothing is selected. Click an object; Ctrl-click adds one, Shift-drag on"
                " free space selects all in a rectangle."
            )
        )
    if len(names) > 1:
        return paragraph(title_html(f"{len(names)} objects"), secondary_text(", ".join(names)))
    status = view.status.get(names[0], "ok")
    entry = view.library.objects.get(view.instances[names[0]].object)
    kind = view.instances[names[0]].object
    if entry is not None and not entry.is_fixed:
        kind = f"{kind}, {1e3 * entry.mass:.0f} g"
    look = status_style(status)
    gap = view.gaps.get(names[0])
    height = secondary_text(f"{1e3 * gap:.1f} mm above what is below") if gap else None
    return paragraph(
        title_html(names[0]), secondary_text(kind), color_dot(look.hex), look.words, height
    )


class PosePanel(SidePanel):
    """Offers the stable poses of the selected object, or of several of the same kind."""

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        super().__init__(gui, actions)
        self._folder = gui.add_folder("Stable poses")
        with self._folder:
            self._text = gui.add_html("")
        self._buttons: list[Any] = []
        self._object: str | None = None
        self._pictures: ObjectPictures | None = None
        self._chosen: int | None = None

    def show(self, view: SessionView, pictures: ObjectPictures) -> None:
        """Updates the panel from a view."""
        objects = {view.instances[name].object for name in view.selection}
        self._folder.visible = bool(objects)
        object = objects.pop() if len(objects) == 1 else None
        entry = view.library.objects.get(object) if object else None
        if object != self._object or pictures is not self._pictures:
            self._object, self._pictures = object, pictures
            self._fill(entry)
        self._chosen = _current_stable_pose(view)
        self.draw()

    def draw(self) -> None:
        """Shows the pictures that are finished."""
        if self._object is None or self._pictures is None:
            return
        for k, button in enumerate(self._buttons):
            picture = self._pictures.get(self._object, k)
            set_button_picture(button, picture, chosen=k == self._chosen)

    def _set(self, stable_pose: int) -> None:
        session = self._actions.session
        session.do(SetPose(session.view.selection, stable_pose))

    def _fill(self, entry: ObjectEntry | None) -> None:
        max_poses = 12  # Maximum number of poses offered; further ones are improbable.
        for button in self._buttons:
            button.remove()
        self._buttons = []
        poses = entry.stable_poses if entry else ()
        self._text.visible = not poses
        if not poses:
            missing = "It has no stable poses." if entry else "Select objects of one kind."
            self._text.content = paragraph(secondary_text(missing))
        with self._folder:
            for k, pose in enumerate(poses[:max_poses]):
                tested = "confirmed by dropping it" if pose.residual is not None else "not dropped"
                button = picture_button(
                    self._gui,
                    f"{100.0 * pose.probability:.0f} %",
                    f"Pose {k}: {100.0 * pose.probability:.1f} % of drops end so; {tested}"
                    + ("; it can roll on" if pose.rolls else ""),
                )
                self._actions.on_click(button, partial(self._set, k))
                self._buttons.append(button)


def _current_stable_pose(view: SessionView) -> int | None:
    """The stable pose that a single selected object is in."""
    max_tilt = 0.02  # Maximum angle between an object and its stable pose, in radians.
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
    return k if float(rotation_angle(R_k.T @ R_SO)) < max_tilt else None


class ArrangePanel(SidePanel):
    """Buttons that move the selected objects."""

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        super().__init__(gui, actions)
        self._folder = gui.add_folder("Arrange")
        with self._folder:
            self._add_contact_buttons()
            self._grid = gui.add_number("Grid [mm]", 10.0, min=0.1, max=1000.0, step=0.1)
            self._button("Snap to grid", self.snap, icon=viser.Icon.GRID_DOTS, hint="Snap (G)")
            self._several = gui.add_folder(None)
            with self._several:
                self._add_alignment_buttons()

    def snap(self) -> None:
        """Snaps the selected objects to the grid."""
        session = self._actions.session
        session.do(SnapToGrid(session.view.selection, 1e-3 * float(self._grid.value)))

    def show(self, view: SessionView) -> None:
        """Updates the panel from a view."""
        self._folder.visible = bool(view.selection)
        self._several.visible = len(view.selection) > 1

    def _add_contact_buttons(self) -> None:
        self._gui.add_html(paragraph(small_heading("Move until it touches")))
        directions: tuple[tuple[str, Direction, str], ...] = (
            ("←", "-x", "to the left"),
            ("→", "x", "to the right"),
            ("↓", "-y", "to the front"),
            ("↑", "y", "to the back"),
        )
        for label, direction, where in directions:
            self._selection_button(
                label,
                partial(SnapToContact, direction=direction),
                width=2,
                hint=f"Move {where} until it touches something",
            )
        self._selection_button("Put down", PutDown, width=4, hint="Lower it until it stands (B)")

    def _add_alignment_buttons(self) -> None:
        self._gui.add_html(paragraph(small_heading("Align")))
        icon = viser.Icon
        edges: tuple[tuple[Edge, Any, str], ...] = (
            ("left", icon.LAYOUT_ALIGN_LEFT, "left edges"),
            ("center_x", icon.LAYOUT_ALIGN_CENTER, "middles, in a column"),
            ("right", icon.LAYOUT_ALIGN_RIGHT, "right edges"),
            ("top", icon.LAYOUT_ALIGN_TOP, "far edges"),
            ("center_y", icon.LAYOUT_ALIGN_MIDDLE, "middles, in a row"),
            ("bottom", icon.LAYOUT_ALIGN_BOTTOM, "near edges"),
        )
        for edge, drawn, what in edges:
            align = partial(Align, edge=edge)
            self._selection_button("", align, width=2, hint=f"Align {what}", icon=drawn)
        axes: tuple[tuple[str, Axis], ...] = (("Even gaps ↔", "x"), ("Even gaps ↕", "y"))
        for label, axis in axes:
            distribute = partial(Distribute, axis=axis)
            self._selection_button(label, distribute, width=6, hint=f"Distribute along {axis}")
