"""Objects held in the hand: they move live, and where they are let go is one step."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.compose.commands import MoveObjects
from burg_drake.core import InvalidInputError, make_pose, rot_z

if TYPE_CHECKING:
    from burg_drake.compose.editing.view import SessionView


class DragOwner(Protocol):
    """What a drag needs of the session that it belongs to."""

    @property
    def view(self) -> SessionView:
        """What one sees."""

    def holds(self, drag: Drag) -> bool:
        """Whether a drag is the one that goes on."""

    def preview(self, drag: Drag, move: MoveObjects) -> SessionView:
        """Shows what is dragged elsewhere."""

    def drop(self, drag: Drag) -> SessionView:
        """Makes a drag a step."""

    def put_back(self, drag: Drag) -> SessionView:
        """Ends a drag without a step."""


class Drag:
    """What `ComposeSession.drag` gives.

    `move` may be called from several threads, and faster than a scene is checked: then only the
    newest poses are, and older calls come back with what is known by then.

    Attributes:
        names: instances that are held.
    """

    def __init__(self, session: DragOwner, names: tuple[str, ...], start: SessionView) -> None:
        self.names = names
        self._session = session
        self._start = {name: start.X_SO(name) for name in names}
        self._X_SO: dict[str, ArrayLike] = dict(self._start)
        self._changes_height = False
        self._asked = self._checked = 0
        self._newest = threading.Lock()
        self._checking = threading.Lock()

    @property
    def is_over(self) -> bool:
        """It was ended or cancelled, or something else changed the scene."""
        return not self._session.holds(self)

    def move(self, X_SO: Mapping[str, ArrayLike], *, changes_height: bool = False) -> SessionView:
        """Holds instances at poses.

        Args:
            X_SO: (4, 4) by name of all instances that are held, or of some.
            changes_height: Heights change even while objects are kept upright.

        Returns:
            The scene with them there, and the status of all instances.

        Raises:
            InvalidInputError: a pose is none, an instance is not held, or the drag is over.
        """
        for name in X_SO:
            if name not in self._start:
                raise InvalidInputError(
                    f"{name!r} is not part of this drag; start a drag that includes it"
                )
        with self._newest:
            self._X_SO, self._changes_height = {**self._X_SO, **X_SO}, changes_height
            self._asked += 1
            number = self._asked
        with self._checking:
            with self._newest:
                if number <= self._checked:  # newer poses were checked while this call waited
                    return self._session.view
                self._checked, move = self._asked, MoveObjects(self._X_SO, self._changes_height)
            return self._session.preview(self, move)

    def move_by(self, offset: tuple[float, float, float], yaw: float = 0.0) -> SessionView:
        """Holds all instances away from where they were taken, as one.

        Args:
            offset: along x, y and z of the scene [m].
            yaw: turned about the vertical through the middle of their origins [rad].
        """
        middle = np.mean([X[:3, 3] for X in self._start.values()], axis=0)
        X = make_pose(rot_z(yaw), middle + offset) @ make_pose(p_AB=-middle)
        return self.move({name: X @ X_SO for name, X_SO in self._start.items()})

    def end(self) -> SessionView:
        """Lets the instances go: one step, or none if they did not move."""
        return self._session.drop(self)

    def cancel(self) -> SessionView:
        """Puts the instances back where they were taken."""
        return self._session.put_back(self)
