"""A library of boxes written by hand, and scenes of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import trimesh

from burg_drake.core import Pose
from burg_drake.objects import (
    LibraryDocument,
    MassProperties,
    ObjectEntry,
    ObjectLibrary,
    Source,
    StablePose,
)
from burg_drake.scene import Board, Instance, Scene, SceneDocument, load_scene, save_scene

SIZES = {"cube": (0.06, 0.06, 0.06), "slab": (0.20, 0.10, 0.02)}
"""Extents [m]; the object frame is in the centre of the lower face."""

MakeScene = Callable[..., Scene]


@pytest.fixture
def library(tmp_path: Path) -> ObjectLibrary:
    entries = {}
    for name, size in SIZES.items():
        mesh = trimesh.creation.box(size)
        mesh.apply_translation((0.0, 0.0, size[2] / 2))
        (tmp_path / "boxes" / name).mkdir(parents=True)
        mesh.export(tmp_path / "boxes" / name / "mesh.obj")
        entries[name] = ObjectEntry(
            mesh=f"{name}/mesh.obj",
            sdf=f"{name}/{name}.sdf",
            pieces=(),
            lower=(-size[0] / 2, -size[1] / 2, 0.0),
            upper=(size[0] / 2, size[1] / 2, size[2]),
            mass_properties=MassProperties(
                mass=0.1,
                source="given",
                volume=size[0] * size[1] * size[2],
                center_of_mass=(0.0, 0.0, size[2] / 2),
                inertia=(1e-4, 1e-4, 1e-4, 0.0, 0.0, 0.0),
            ),
            stable_poses=(StablePose(probability=1.0, X_SO=Pose()),),
            source=Source(file=f"{name}.obj", sha256="0"),
            build=f"build of {name}",
        )
    made = ObjectLibrary(LibraryDocument(name="boxes", objects=entries), tmp_path / "boxes")
    made.save()
    return made


@pytest.fixture
def make_scene(library: ObjectLibrary, tmp_path: Path) -> MakeScene:
    """Saves and loads a scene of `(object, translation, rpy_deg)` on a board of 600 x 400 mm."""

    def make(*placed: tuple, background: tuple = ()) -> Scene:  # type: ignore[type-arg]
        def instances(items: tuple) -> tuple[Instance, ...]:  # type: ignore[type-arg]
            return tuple(
                Instance(name=f"{item[0]}_{i}", object=item[0], X_SO=Pose(*item[1:]))
                for i, item in enumerate(items)
            )

        document = SceneDocument(
            name="boxes",
            library="boxes",
            board=Board(size=(0.6, 0.4)),
            instances=instances(placed),
            background=tuple(
                Instance(name=f"fixed_{i}", object=item[0], X_SO=Pose(*item[1:]))
                for i, item in enumerate(background)
            ),
        )
        path = tmp_path / "scene.yaml"
        save_scene(document, path)
        return load_scene(path)

    return make
