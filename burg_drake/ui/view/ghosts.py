"""Where objects would come to rest, as shades beside the objects themselves."""

from __future__ import annotations

from typing import Any

import viser

from burg_drake.compose.background import SettlingProposal, moved_names
from burg_drake.compose.document import name_of
from burg_drake.core import BurgError, quaternion_from_rotation
from burg_drake.ui.view.object_meshes import ObjectMeshes
from burg_drake.ui.widgets import Rgb8

COLOR: Rgb8 = (245, 159, 0)
OPACITY = 0.5
SEEN, SEEN_DEG = 2e-3, 2.0
"""What moves by less [m, degrees] has no shade, which would flicker within the object."""


class GhostView:
    """Shows a proposal of the session.

    Args:
        scene: of viser.
    """

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._shown: SettlingProposal | None = None
        self._handles: list[Any] = []

    def show(self, proposal: SettlingProposal | None, shapes: ObjectMeshes) -> None:
        """Brings the browser to a proposal, or to none.

        Args:
            proposal: of the view.
            shapes: of the library's objects.
        """
        if proposal is self._shown:
            return
        self._shown = proposal
        for handle in self._handles:
            handle.remove()
        self._handles = []
        if proposal is None:
            return
        moved = moved_names(proposal, SEEN, SEEN_DEG)
        for instance in proposal.document.instances:
            if name_of(instance) in moved:
                self._add(name_of(instance), instance.object, instance.X_SO.matrix(), shapes)

    def _add(self, name: str, object: str, X_SO: Any, shapes: ObjectMeshes) -> None:
        try:
            shape = shapes[object]
        except BurgError:  # what is wrong with it is told elsewhere
            return
        self._handles.append(
            self._scene.add_mesh_simple(
                f"/ghosts/{name}",
                shape.vertices,
                shape.faces,
                color=COLOR,
                opacity=OPACITY,
                side="double",
                cast_shadow=False,
                position=X_SO[:3, 3],
                wxyz=quaternion_from_rotation(X_SO[:3, :3]),
            )
        )
