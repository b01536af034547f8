"""Exports scenes to other simulators: the formats, and the folder that holds an export."""

from __future__ import annotations

import importlib.util
import os
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import burg_drake
from burg_drake.core import (
    DocumentError,
    InvalidInputError,
    MissingDependencyError,
    UnknownNameError,
    atomic_folder,
    list_names,
    load_document,
    save_document,
    suggest_names,
)
from burg_drake.scene import SceneLike, as_scene
from burg_drake.station import StationLike, as_station

if TYPE_CHECKING:
    from burg_drake.export.layout import Layout


@dataclass(frozen=True)
class SceneFormat:
    """A format that scenes are exported to.

    Attributes:
        writer: MODULE:NAME, in this room, of a function of a layout and a folder that returns
            notes; imported when needed.
        main: file to open.
        about: description of the format and the programs that read it.
        hydroelastic: whether it has Drake's contact properties.
        with_hand: whether the station's hand can be above the scene.
        package: names in pip and in Python of a package that only this format needs.
    """

    writer: str
    main: str
    about: str
    hydroelastic: bool = False
    with_hand: bool = False
    package: tuple[str, str] | None = None


SCENE_FORMATS = {
    "sdf": SceneFormat(
        writer="sdf:write_sdf",
        main="world.sdf",
        about="an SDFormat world, for Gazebo and Drake",
        hydroelastic=True,
    ),
    "dmd": SceneFormat(
        writer="sdf:write_directives",
        main="scene.dmd.yaml",
        about="Drake's model directives",
        hydroelastic=True,
    ),
    "mjcf": SceneFormat(
        writer="mjcf_scene:write_mjcf", main="scene.xml", about="MuJoCo's XML", with_hand=True
    ),
    "usd": SceneFormat(
        writer="usd:write_usd",
        main="scene.usda",
        about="USD, for Isaac Sim; needs burg-drake[usd]",
        package=("usd-core", "pxr"),
    ),
}
"""Export formats by name."""


@dataclass(frozen=True)
class Exported:
    """An export.

    Attributes:
        main: file to open.
        layout: exported layout.
        notes: differences from the scene, one sentence each.
    """

    main: Path
    layout: Layout
    notes: tuple[str, ...]


def export_scene(
    scene: SceneLike,
    folder: str | Path,
    to: str,
    station: StationLike | None = None,
    *,
    hand: bool = False,
) -> Exported:
    """Exports a scene for another program, to a folder that can be moved or zipped.

    Example::

        burg.export_scene("tabletop_six", "for_mujoco", "mjcf", "panda_tabletop")

    Args:
        scene: what stands on the board. The board itself, which is paper, is left out.
        folder: new, empty, or an earlier export, which is replaced when the new one is complete.
        to: one of `SCENE_FORMATS`.
        station: its table and obstacles are exported, too, and the world is the station's. Without
            one the world is the scene frame S, and nothing is under the objects.
        hand: `mjcf` alone: with the station's hand floating above the scene, as in grasp trials of
            the engine `mujoco`. A note tells how it is moved.

    Raises:
        UnknownNameError: no such format, or a file of the library is missing.
        InvalidInputError: the folder holds something else or cannot be written to; an instance and
            a part of the station share a name; an object's model or the hand cannot be exported.
        MeshError: a mesh of the library is damaged.
        MissingDependencyError: `usd` without the package usd-core.
    """
    from burg_drake.export.layout import lay_out

    scene = as_scene(scene)
    station = None if station is None else as_station(station)
    if to not in SCENE_FORMATS:
        raise UnknownNameError(f"format {to!r} does not exist; {suggest_names(to, SCENE_FORMATS)}")
    chosen = SCENE_FORMATS[to]
    if hand and (station is None or not chosen.with_hand):
        able = ", ".join(name for name, format in SCENE_FORMATS.items() if format.with_hand)
        what = f"a hand can only be exported to {able}, not to {to}"
        if chosen.with_hand:
            what = "a hand belongs to a station; name the station, too"
        raise InvalidInputError(what)
    write = _load_writer(to)
    path = require_own_folder(folder)
    layout = lay_out(scene, station)
    if hand and station is not None:
        from burg_drake.station import build_station_diagram, read_hand

        parts = read_hand(build_station_diagram(scene, station, robot="hand"))
        write = partial(write, hand=parts)
    with atomic_folder(path, replace=True) as fresh:
        notes = write(layout, fresh)
        record = ExportRecord(
            format=to,
            scene=scene.name,
            scene_content=scene.content,
            station=station.name if station is not None else "",
            main=chosen.main,
            software=f"burg_drake {burg_drake.__version__}",
        )
        write_record(fresh, record)
    if not chosen.hydroelastic:
        notes = (*notes, *_contact_notes(layout, to))
    return Exported(path / chosen.main, layout, notes)


def _load_writer(to: str) -> Callable[..., tuple[str, ...]]:
    chosen = SCENE_FORMATS[to]
    if chosen.package is not None and importlib.util.find_spec(chosen.package[1]) is None:
        raise MissingDependencyError(
            f"exports to {to} need the package {chosen.package[0]}; install it with"
            f" pip install 'burg-drake[{to}]'"
        )
    writer: Callable[..., tuple[str, ...]] = pkgutil.resolve_name(
        f"burg_drake.export.{chosen.writer}"
    )
    return writer


def _contact_notes(layout: Layout, to: str) -> list[str]:
    """Notes on contact properties that a format without Drake's properties lacks."""
    notes = []
    for name, entry in layout.entries.items():
        if entry.contact.kind == "primitive":
            continue
        if not entry.pieces:
            notes.append(f"{name!r} has no convex pieces; its convex hull collides in {to}")
        elif entry.contact.kind == "mesh":
            notes.append(f"{name!r} is a rigid mesh in Drake; in {to} its convex pieces collide")
        elif entry.contact.kind == "compliant_pieces":
            notes.append(f"{name!r} is compliant in Drake; {to} has no hydroelastic modulus")
    return notes


EXPORT_RECORD_FILE = "export.yaml"
"""Lists the files of an export; the next export replaces them."""


@dataclass(frozen=True, kw_only=True)
class ExportRecord:
    """An exported scene (`export.yaml`).

    Attributes:
        format: format of the export.
        scene: name of the scene.
        scene_content: hash of the scene and its objects.
        station: name of the station; empty without one.
        main: file to open.
        software: name and version of the program that wrote it.
        files: all other files, relative to the folder.
    """

    version: int = 1
    format: str
    scene: str
    scene_content: str
    station: str = ""
    main: str
    software: str
    files: tuple[str, ...] = ()


def require_own_folder(folder: str | Path) -> Path:
    """Checks the target folder of an export.

    Args:
        folder: new, empty, or with an earlier export and nothing else in it.

    Returns:
        Its real path, through links.

    Raises:
        InvalidInputError: it is a file, or contains anything else.
    """
    path = Path(os.path.realpath(folder))
    if not os.path.lexists(path):
        return path
    if not path.is_dir():
        raise InvalidInputError(f"{folder} is a file; name a folder for the export")
    present = _list_files(path)
    if not present and not any(path.iterdir()):
        return path
    try:
        known = load_document(path / EXPORT_RECORD_FILE, ExportRecord).files
    except DocumentError as error:
        raise InvalidInputError(
            f"{folder} has files in it and is not an earlier export; choose a new folder"
        ) from error
    foreign = sorted(set(present) - {*known, EXPORT_RECORD_FILE})
    if foreign:
        raise InvalidInputError(
            f"{folder} is an earlier export, but has files in it that the export did not"
            f" write ({list_names(foreign)}); move them away, or choose a new folder"
        )
    return path


def write_record(folder: Path, record: ExportRecord) -> None:
    """Writes `export.yaml` with the names of all files in the folder.

    Args:
        folder: folder of the export, otherwise complete.
        record: record without file names.
    """
    save_document(replace(record, files=tuple(_list_files(folder))), folder / EXPORT_RECORD_FILE)


def _list_files(folder: Path) -> list[str]:
    """Relative paths of everything in a folder and its subfolders."""
    found = (p for p in folder.rglob("*") if p.is_symlink() or not p.is_dir())
    return sorted(p.relative_to(folder).as_posix() for p in found)
