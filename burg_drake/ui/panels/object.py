"""The panel of what is selected: its name, numbers for its pose, and what can be done with it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import viser

from burg_drake.compose.commands import Delete, Duplicate, MoveObjects, Rename, SetFixed, Turn
from burg_drake.compose.editing import SessionView
from burg_drake.core import Array, rotation_from_rpy, rpy_from_rotation
from burg_drake.ui.widgets import (
    NAME_TYPING_DELAY,
    PageActions,
    all_of,
    box,
    dot,
    quiet,
    quiet_button,
    style_of,
    title,
)

QUARTER_TURN_DEG = 90.0
DECIMALS_MM, DECIMALS_DEG = 2, 2
MAX_COORDINATE_MM = 100_000.0


class ObjectPanel:
    """Shows the selection and edits it.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
        switch_axes: makes arrows lie along the board or along the object.
    """

    def __init__(
        self, gui: viser.GuiApi, actions: PageActions, switch_axes: Callable[[], None]
    ) -> None:
        self._actions = actions
        self._text = gui.add_html("")
        self._one = gui.add_folder(None)
        with self._one:
            self._name = actions.typed(
                gui.add_text("Name", ""), self._rename, after=NAME_TYPING_DELAY
            )
            self._fixed = actions.chosen(
                gui.add_checkbox(
                    "Background", False, hint="It stays where it is when the scene is simulated"
                ),
                self._fix,
            )
            self._numbers = _Numbers(gui, actions)
        self._restrict = actions.chosen(
            gui.add_checkbox(
                "Keep upright",
                True,
                hint="Objects keep their tilt while they are moved, and their height unless they"
                " are raised; without it they have handles for all six directions",
            ),
            lambda planar: actions.session.restrict_movement(planar),
        )
        self._axes = actions.clicked(
            quiet_button(
                gui,
                "Arrows: board or object",
                icon=viser.Icon.AXIS_X,
                hint="Arrows lie along the axes of the board, or of the object (X); rings always"
                " lie about those of the object",
            ),
            switch_axes,
        )
        self._some = gui.add_folder(None)
        with self._some:
            self._buttons(gui, actions)

    def show(self, view: SessionView) -> None:
        """Brings the panel to a view."""
        names = view.selection
        self._restrict.value = view.planar
        self._one.visible = len(names) == 1
        self._some.visible = bool(names)
        self._axes.visible = len(names) == 1 and not view.planar
        self._text.content = _description(view)
        if len(names) == 1:
            self._name.show(names[0])
            self._fixed.value = view.instances[names[0]] in view.document.background
            self._numbers.show(view.X_SO(names[0]), free=not view.planar)

    def _rename(self, new: str) -> None:
        names = self._actions.session.view.selection
        if len(names) == 1:
            self._actions.session.do(Rename(names[0], new), field="name")

    def _fix(self, fixed: bool) -> None:
        self._actions.session.do(SetFixed(self._actions.session.view.selection, fixed))

    def _buttons(self, gui: viser.GuiApi, actions: PageActions) -> None:
        icon, selected = viser.Icon, actions.with_selection
        actions.clicked(
            quiet_button(gui, "−90°", width=2, hint="Turn clockwise"),
            selected(lambda names: Turn(names, -QUARTER_TURN_DEG)),
        )
        actions.clicked(
            quiet_button(gui, "+90°", width=2, hint="Turn counter-clockwise"),
            selected(lambda names: Turn(names, QUARTER_TURN_DEG)),
        )
        actions.clicked(
            quiet_button(gui, "Copy", width=4, icon=icon.COPY, hint="Duplicate (Ctrl+D)"),
            selected(Duplicate),
        )
        actions.clicked(
            quiet_button(gui, "Delete", width=4, icon=icon.TRASH, hint="Delete (Del)"),
            selected(Delete),
        )


class _Numbers:
    """Fields of a pose: position, and yaw or all three angles."""

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        self._actions = actions
        zeros = (0.0, 0.0, 0.0)
        self._position = actions.typed(
            gui.add_vector3("x, y, z [mm]", zeros, step=0.01), self._place
        )
        self._yaw = actions.typed(
            gui.add_number(
                "yaw [°]", 0.0, step=0.01, min=-MAX_COORDINATE_MM, max=MAX_COORDINATE_MM
            ),
            self._turn,
        )
        self._angles = actions.typed(
            gui.add_vector3("roll, pitch, yaw [°]", zeros, step=0.01), self._turn_freely
        )

    def show(self, X_SO: Array, *, free: bool) -> None:
        """Shows a pose (4, 4)."""
        position, angles = _numbers(X_SO)
        self._yaw.handle.visible, self._angles.handle.visible = not free, free
        self._position.show(position)
        self._yaw.show(angles[2])
        self._angles.show(angles)

    def _place(self, typed_mm: tuple[float, ...]) -> None:
        """Moves the selected object; numbers that were left alone stay exact."""
        if (X_SO := self._selected()) is None:
            return
        shown_mm, _ = _numbers(X_SO)
        exact_mm = 1e3 * X_SO[:3, 3]
        p_mm = [e if t == s else t for t, s, e in zip(typed_mm, shown_mm, exact_mm, strict=True)]
        X_SO[:3, 3] = 1e-3 * np.array(p_mm)
        self._move(X_SO, "position")

    def _turn(self, yaw_deg: float) -> None:
        """Turns the selected object about the vertical."""
        if (X_SO := self._selected()) is not None:
            self._turn_freely((*_numbers(X_SO)[1][:2], yaw_deg))

    def _turn_freely(self, typed_deg: tuple[float, ...]) -> None:
        """Turns the selected object; angles that were left alone stay exact."""
        if (X_SO := self._selected()) is None:
            return
        _, shown_deg = _numbers(X_SO)
        exact_deg = np.rad2deg(rpy_from_rotation(X_SO[:3, :3]))
        rpy = [e if t == s else t for t, s, e in zip(typed_deg, shown_deg, exact_deg, strict=True)]
        if tuple(typed_deg) != shown_deg:
            X_SO[:3, :3] = rotation_from_rpy(np.deg2rad(rpy))
        self._move(X_SO, "angles")

    def _selected(self) -> Array | None:
        """(4, 4) pose of the selected object; None unless it is one."""
        view = self._actions.session.view
        return view.X_SO(view.selection[0]) if len(view.selection) == 1 else None

    def _move(self, X_SO: Array, field: str) -> None:
        session = self._actions.session
        name = session.view.selection[0]
        session.do(MoveObjects({name: X_SO}, changes_height=True), field=field)


def _numbers(X_SO: Array) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """x, y, z [mm] and roll, pitch, yaw [degrees], rounded for people."""
    position = tuple((np.round(1e3 * X_SO[:3, 3], DECIMALS_MM) + 0.0).tolist())
    angles = np.rad2deg(rpy_from_rotation(X_SO[:3, :3]))
    return position, tuple((np.round(angles, DECIMALS_DEG) + 0.0).tolist())


def _description(view: SessionView) -> str:
    names = view.selection
    if not names:
        return all_of(
            box(
                quiet(
                    "Nothing is selected. Click an object; Ctrl-click adds one, Shift-drag on"
                    " free space selects all in a rectangle."
                )
            )
        )
    if len(names) > 1:
        return all_of(box(title(f"{len(names)} objects"), quiet(", ".join(names))))
    status = view.status.get(names[0], "ok")
    entry = view.library.objects.get(view.instances[names[0]].object)
    kind = view.instances[names[0]].object
    if entry is not None and not entry.is_fixed:
        kind = f"{kind}, {1e3 * entry.mass:.0f} g"
    look = style_of(status)
    gap = view.gaps.get(names[0])
    height = quiet(f"{1e3 * gap:.1f} mm above what is below") if gap else None
    return all_of(box(title(names[0]), quiet(kind), dot(look.hex), look.words, height))
