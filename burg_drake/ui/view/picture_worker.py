"""Rendering a picture of an object in a worker, so that the page never waits for a renderer."""

from __future__ import annotations


def render_picture(root: str, name: str, stable_pose: int | None, size: tuple[int, int]) -> bytes:
    """A PNG of an object.

    Args:
        root: folder of the library.
        name: of the object.
        stable_pose: in which it stands; None: as it looks best.
        size: width and height [pixel].

    Raises:
        BurgError: it cannot be rendered.
    """
    from burg_drake.objects.library import load_library
    from burg_drake.visualization.pictures import ObjectRenderer

    renderer = ObjectRenderer(load_library(root), [name])
    return renderer.portrait(name, size, stable_pose=stable_pose).png()
