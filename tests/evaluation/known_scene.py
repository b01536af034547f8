"""A small scene without physics behind it: two cubes and a bar on a board."""

from __future__ import annotations

from pathlib import Path

import trimesh

from burg_drake.core import Pose
from burg_drake.objects import (
    LibraryDocument,
    MassProperties,
    ObjectEntry,
    ObjectLibrary,
    Source,
    StablePose,
    load_library,
)
from burg_drake.scene import Instance, Scene, SceneDocument, load_scene, save_scene


def write_library(folder: Path) -> ObjectLibrary:
    """A library of a cube and a bar, with meshes for sampling but nothing for Drake."""
    entries = {}
    for name, extents in (("cube", (0.05, 0.05, 0.05)), ("bar", (0.2, 0.03, 0.03))):
        (folder / name).mkdir(parents=True)
        trimesh.creation.box(extents).export(folder / name / "mesh.obj")
        half = tuple(e / 2 for e in extents)
        entries[name] = ObjectEntry(
            mesh=f"{name}/mesh.obj",
            sdf=f"{name}/{name}.sdf",
            pieces=(),
            lower=tuple(-h for h in half),
            upper=half,
            mass_properties=MassProperties(
                mass=0.1,
                source="given",
                volume=1e-4,
                center_of_mass=(0.0, 0.0, 0.0),
                inertia=(1e-4, 1e-4, 1e-4, 0.0, 0.0, 0.0),
            ),
            stable_poses=(StablePose(probability=1.0, X_SO=Pose((0.0, 0.0, half[2]))),),
            source=Source(file="none", sha256="0"),
            build=f"build of {name}",
        )
    library = ObjectLibrary(LibraryDocument(name="shapes", objects=entries), folder)
    library.save()
    return load_library(folder)


def write_scene(folder: Path) -> Scene:
    """Two cubes and a bar on a board, with their library beside it."""
    write_library(folder / "shapes")
    document = SceneDocument(
        name="three",
        library="shapes",
        instances=(
            Instance(name="left", object="cube", X_SO=Pose((0.1, 0.2, 0.025))),
            Instance(name="right", object="cube", X_SO=Pose((0.3, 0.2, 0.025))),
            Instance(object="bar", X_SO=Pose((0.2, 0.35, 0.015))),
        ),
    )
    save_scene(document, folder / "three.yaml")
    return load_scene(folder / "three.yaml")
