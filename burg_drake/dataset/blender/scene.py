"""A scene as Blender gets it: plain data, and the files that are made of it."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from burg_drake.core import Array
from burg_drake.core.documents import Vector3
from burg_drake.dataset.blender.surfaces import PaintedSurface

SAMPLES = 16
"""Paths of light a pixel, whose noise is then removed by Open Image Denoise."""


@dataclass(frozen=True, kw_only=True)
class Lamp:
    """A light far away.

    Attributes:
        direction: that it shines in.
        frame: of the direction: the world, or that of the camera, as OpenCV has it.
        irradiance: of a surface that faces it [W/m^2]: one that is white and gets pi is white in
            the image.
        color: red, green, blue, linear.
        shadows: whether it casts them.
        angle: that its disc takes, which makes the edges of shadows soft [rad].
    """

    direction: Vector3
    frame: Literal["world", "camera"]
    irradiance: float
    color: Vector3
    shadows: bool
    angle: float


@dataclass(frozen=True, eq=False)
class BlenderScene:
    """What there is to be rendered.

    Attributes:
        surfaces: everything that can be seen; poses of their bodies come with each view.
        lamps: that shine on it.
        environment: light from all around, as the content of a Radiance file: the first row up, the
            middle of a row along x of the world, a quarter of the image to the left of it along y.
            There is none if empty.
        samples: paths of light a pixel; with 1 their noise stays.
    """

    surfaces: tuple[PaintedSurface, ...]
    lamps: tuple[Lamp, ...]
    environment: bytes = b""
    samples: int = SAMPLES

    def write(self, folder: Path, threads: int) -> None:
        """Writes `scene.json`, `meshes.npz` and images.

        Args:
            folder: that exists, and nothing else is in.
            threads: that shall render; as many as there are processors if 0.
        """
        textures = {one.material.texture for one in self.surfaces} - {b""}
        names = {png: f"texture_{k}.png" for k, png in enumerate(sorted(textures))}
        files = {name: png for png, name in names.items()}
        if self.environment:
            files["environment.hdr"] = self.environment
        parts = [
            {"body": one.body, "material": _plain(one, names.get(one.material.texture, ""))}
            for one in self.surfaces
        ]
        described = {
            "version": 1,
            "samples": self.samples,
            "threads": threads,
            "parts": parts,
            "lamps": [asdict(lamp) for lamp in self.lamps],
            "environment": "environment.hdr" if self.environment else "",
        }
        files["scene.json"] = json.dumps(described).encode()
        arrays = io.BytesIO()
        named: dict[str, Any] = dict(self._arrays())
        np.savez(arrays, **named)
        files["meshes.npz"] = arrays.getvalue()
        for name, content in files.items():
            (folder / name).write_bytes(content)

    def _arrays(self) -> Iterator[tuple[str, Array]]:
        for k, one in enumerate(self.surfaces):
            yield f"part_{k}.vertices", one.vertices.astype(np.float32)
            yield f"part_{k}.faces", one.faces.astype(np.int32)
            if one.normals is not None:
                yield f"part_{k}.normals", one.normals.astype(np.float32)
            if one.uv is not None:
                yield f"part_{k}.uv", one.uv.astype(np.float32)


def _plain(surface: PaintedSurface, texture: str) -> dict[str, Any]:
    return asdict(surface.material) | {"texture": texture}
