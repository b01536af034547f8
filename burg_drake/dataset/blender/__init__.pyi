from .look import blender_scene as blender_scene
from .process import (
    RENDERERS as RENDERERS,
    RendererName as RendererName,
    blender as blender,
)
from .scene import BlenderScene as BlenderScene
