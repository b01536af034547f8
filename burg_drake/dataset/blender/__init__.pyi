from .look import blender_scene as blender_scene
from .process import (
    RENDERERS as RENDERERS,
    Blender as Blender,
    RendererName as RendererName,
    blender as blender,
)
from .scene import (
    BlenderScene as BlenderScene,
    Lamp as Lamp,
)
from .surfaces import (
    Material as Material,
    PaintedSurface as PaintedSurface,
    painted_surfaces as painted_surfaces,
)
