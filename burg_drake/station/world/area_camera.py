"""A colour camera whose pixels are means of light over their area, as those of real sensors are.

Drake renders one ray a pixel and smooths the steps of edges afterwards (FXAA), which moves edges by
some hundredths of a pixel; what that costs a board's pose is in `benchmarks/board_loop.py`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.geometry import ColorRenderCamera, FrameId, QueryObject
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, LeafSystem
from pydrake.systems.sensors import ImageRgba8U

from burg_drake.core import levels_of_light, photo_light
from burg_drake.station.document import HALF_PIXEL, Camera


def finer(camera: Camera) -> Camera:
    """The camera with `samples` times the pixels along each side, one ray each."""
    n = camera.samples
    (fx, fy), (cx, cy) = camera.focal, camera.principal_point
    return replace(
        camera,
        width=n * camera.width,
        height=n * camera.height,
        focal=(n * fx, n * fy),
        center=(n * (cx + HALF_PIXEL) - HALF_PIXEL, n * (cy + HALF_PIXEL) - HALF_PIXEL),
        samples=1,
    )


class AreaCamera(LeafSystem):
    """Renders finely and averages.

    Ports:
        geometry_query: of the scene graph.
        X_WC: pose of the camera's optical frame in the world.
        color_image: what it sees (output).
    """

    def __init__(self, rendered: ColorRenderCamera, samples: int, world: FrameId) -> None:
        """Declares the ports.

        Args:
            rendered: Drake's camera of `finer(camera)`.
            samples: of the camera.
            world: the scene graph's world frame.
        """
        super().__init__()
        self._rendered, self._world = rendered, world
        info = rendered.core().intrinsics()
        self._size = info.width() // samples, info.height() // samples
        self._query = self.DeclareAbstractInputPort("geometry_query", Value[QueryObject]())
        self._X_WC = self.DeclareAbstractInputPort("X_WC", Value[RigidTransform]())
        blank = ImageRgba8U(*self._size)
        self.DeclareAbstractOutputPort("color_image", lambda: Value(blank), self._calc)

    def _calc(self, context: Context, output: AbstractValue) -> None:
        import cv2

        query = self._query.Eval(context)
        fine = query.RenderColorImage(self._rendered, self._world, self._X_WC.Eval(context))
        image = ImageRgba8U(*self._size)
        light = photo_light(np.asarray(fine.data))
        image.mutable_data[:] = levels_of_light(
            cv2.resize(light, self._size, interpolation=cv2.INTER_AREA)
        )
        output.set_value(image)
