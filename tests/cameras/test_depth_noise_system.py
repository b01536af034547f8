"""Depth noise within a diagram: the same image for the same moment, however it is asked for."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.geometry import (
    Box,
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    GeometryInstance,
    MakeRenderEngineVtk,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    Rgba,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem
from pydrake.systems.sensors import (
    CameraInfo,
    ImageDepth32F,
    ImageRgba8U,
    RgbdSensor,
    RgbdSensorDiscrete,
)

from burg_drake.cameras import NOISE_PRESETS, DepthNoise, DepthNoiseSystem, Intrinsics
from burg_drake.core import InvalidInputError
from burg_drake.system_libraries import missing_render_libraries

CAMERA = Intrinsics(width=64, height=48, focal=(60.0, 60.0), center=(31.5, 23.5))
AXIAL = DepthNoise(axial_base=0.01)


def context_of(system: DepthNoiseSystem, z: float = 1.0, width: int = 64) -> Context:
    """One whose image is z but for a corner without depth, in the three ways of Drake."""
    image = ImageDepth32F(width, 48)
    image.mutable_data[:] = z
    image.mutable_data[0, :3, 0] = [0.0, np.inf, np.nan]
    context = system.CreateDefaultContext()
    system.GetInputPort("depth_image").FixValue(context, image)
    return context


def depth(system: DepthNoiseSystem, context: Context, time: float = 0.0) -> NDArray[np.float32]:
    context.SetTime(time)
    return np.array(system.GetOutputPort("depth_image").Eval(context).data[..., 0])


def test_an_image_is_that_of_its_moment() -> None:
    system = DepthNoiseSystem(AXIAL, CAMERA, seed=3)
    context = context_of(system)
    first, later = depth(system, context), depth(system, context, 0.5)
    assert (first != later).mean() > 0.99
    np.testing.assert_array_equal(depth(system, context, 0.5), later)
    np.testing.assert_array_equal(depth(system, context), first)
    context.DisableCaching()
    np.testing.assert_array_equal(depth(system, context), first)
    again = DepthNoiseSystem(AXIAL, CAMERA, seed=3)
    np.testing.assert_array_equal(depth(again, context_of(again)), first)
    other = DepthNoiseSystem(AXIAL, CAMERA, seed=4)
    assert (depth(other, context_of(other)) != first).mean() > 0.99


def test_what_has_no_depth_is_infinite() -> None:
    system = DepthNoiseSystem(AXIAL, CAMERA)
    result = depth(system, context_of(system))
    assert np.isposinf(result[0, :3]).all() and np.isinf(result).sum() == 3
    assert result[1:].std() == pytest.approx(0.01, rel=0.05)


def test_noise_stays_within_a_period() -> None:
    system = DepthNoiseSystem(AXIAL, CAMERA, period=0.1)
    context = context_of(system)
    first = depth(system, context, 0.3)  # 2.9999999999999996 periods
    np.testing.assert_array_equal(depth(system, context, 0.39), first)
    assert (depth(system, context, 0.2) != first).any() and (
        depth(system, context, 0.4) != first
    ).any()


def test_colours_and_normals_are_used() -> None:
    noise = DepthNoise(
        dark_below=10.0, dark_probability=1.0, grazing_from_deg=60.0, grazing_to_deg=60.0
    )
    system = DepthNoiseSystem(noise, CAMERA)
    context = context_of(system)
    assert np.isinf(depth(system, context)).sum() == 3
    color = ImageRgba8U(64, 48)
    color.mutable_data[:] = 255
    color.mutable_data[:, :32, :3] = 0
    system.GetInputPort("color_image").FixValue(context, color)
    assert np.isinf(depth(system, context)).sum() == 32 * 48
    normals = np.zeros((48, 64, 3), np.float32)
    normals[..., 2] = -1.0
    normals[24:] = [0.0, 1.0, 0.0]
    system.GetInputPort("normals").FixValue(context, Value[object](normals))
    assert np.isinf(depth(system, context)).sum() == 32 * 48 + 32 * 24


def test_bad_input_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="seed of depth noise is -1; give 0 to"):
        DepthNoiseSystem(AXIAL, CAMERA, seed=-1)
    with pytest.raises(InvalidInputError, match=r"period.*0 s"):
        DepthNoiseSystem(AXIAL, CAMERA, period=0.0)
    system = DepthNoiseSystem(NOISE_PRESETS["d435"], CAMERA)
    with pytest.raises(InvalidInputError, match=r"depth_noise: .*depth_image"):
        depth(system, system.CreateDefaultContext())
    with pytest.raises(InvalidInputError, match="the depth image has 32 x 48 pixels"):
        depth(system, context_of(system, width=32))


class Reader(LeafSystem):
    """Keeps the depth images of a running simulation: two in each period of a camera's 0.1 s."""

    def __init__(self) -> None:
        super().__init__()
        self.images: list[NDArray[np.float32]] = []
        self._port = self.DeclareAbstractInputPort("depth_image", Value(ImageDepth32F(64, 48)))
        self.DeclarePeriodicPublishEvent(0.05, 0.02, self._read)

    def _read(self, context: Context) -> None:
        self.images.append(np.array(self._port.Eval(context).data[..., 0]))


def camera_before_a_wall(builder: DiagramBuilder) -> RgbdSensorDiscrete:
    """It takes an image each 0.1 s, along z: of a wall at 1 m, of which the left half is black."""
    scene_graph = builder.AddSystem(SceneGraph())
    scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(RenderEngineVtkParams()))
    source = scene_graph.RegisterSource("walls")
    for name, x, shade in (("black", -1.0, 0.0), ("white", 1.0, 1.0)):
        wall = GeometryInstance(RigidTransform([x, 0.0, 1.05]), Box(2.0, 4.0, 0.1), name)
        properties = PerceptionProperties()
        properties.AddProperty("phong", "diffuse", Rgba(shade, shade, shade))
        wall.set_perception_properties(properties)
        scene_graph.RegisterAnchoredGeometry(source, wall)
    info = CameraInfo(64, 48, 60.0, 60.0, 32.0, 24.0)
    core = RenderCameraCore("vtk", info, ClippingRange(0.1, 9.0), RigidTransform())
    sensor = RgbdSensor(
        scene_graph.world_frame_id(),
        RigidTransform(),
        ColorRenderCamera(core, False),
        DepthRenderCamera(core, DepthRange(0.2, 5.0)),
    )
    camera = builder.AddSystem(RgbdSensorDiscrete(sensor, 0.1, False))
    builder.Connect(scene_graph.get_query_output_port(), camera.query_object_input_port())
    return camera


@pytest.mark.skipif(bool(missing_render_libraries()), reason="the renderer's libraries are missing")
def test_between_a_camera_and_a_reader_in_a_simulation() -> None:
    builder = DiagramBuilder()
    camera = camera_before_a_wall(builder)
    dark = DepthNoise(axial_base=0.01, dark_below=10.0, dark_probability=1.0)
    noise = builder.AddSystem(DepthNoiseSystem(dark, CAMERA, period=0.1))
    reader = builder.AddSystem(Reader())
    builder.Connect(camera.depth_image_32F_output_port(), noise.GetInputPort("depth_image"))
    builder.Connect(camera.color_image_output_port(), noise.GetInputPort("color_image"))
    builder.Connect(noise.GetOutputPort("depth_image"), reader.GetInputPort("depth_image"))
    Simulator(builder.Build()).AdvanceTo(0.2)

    first, held, second, held_too = reader.images
    np.testing.assert_array_equal(first, held)
    np.testing.assert_array_equal(second, held_too)
    for image in (first, second):
        assert np.isposinf(image[:, :31]).all() and np.isfinite(image[:, 33:]).all()
        assert image[:, 33:].mean() == pytest.approx(1.0, abs=0.001)
        assert image[:, 33:].std() == pytest.approx(0.01, rel=0.06)
    assert (first != second)[:, 33:].mean() > 0.99
