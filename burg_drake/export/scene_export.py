"""Exports of scenes: which formats there are, and the folder that holds one."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import burg_drake
from burg_drake.core import InvalidInputError, MissingDependencyError, UnknownNameError, nearest
from burg_drake.export.folder import (
    ExportRecord,
    replaced_folder,
    require_own_folder,
    write_record,
)
from burg_drake.scene.document import SceneLike, as_scene
from burg_drake.station.document import StationLike, as_station

if TYPE_CHECKING:
    from burg_drake.export.layout import Layout


@dataclass(frozen=True)
class Format:
    """A format that scenes are exported to.

    Attributes:
        module: in this room, imported when needed.
        writer: its function of a layout and a folder, which returns notes.
        main: the file to open.
        about: what it is, and for whom.
        hydroelastic: whether it has Drake's contact properties.
        with_hand: whether the station's hand can be above the scene.
        package: that it needs beside those of burg_drake, as pip and as Python know it.
    """

    module: str
    writer: str
    main: str
    about: str
    hydroelastic: bool = False
    with_hand: bool = False
    package: tuple[str, str] | None = None


FORMATS = {
    "sdf": Format(
        module="sdf_world",
        writer="write_sdf",
        main="world.sdf",
        about="an SDFormat world, for Gazebo and Drake",
        hydroelastic=True,
    ),
    "dmd": Format(
        module="directives",
        writer="write_directives",
        main="scene.dmd.yaml",
        about="Drake's model directives",
        hydroelastic=True,
    ),
    "mjcf": Format(
        module="mjcf.writer",
        writer="write_mjcf",
        main="scene.xml",
        about="MuJoCo's XML",
        with_hand=True,
    ),
    "usd": Format(
        module="usd",
        writer="write_usd",
        main="scene.usda",
        about="USD, for Isaac Sim; needs burg-drake[usd]",
        package=("usd-core", "pxr"),
    ),
}
"""Formats by name."""


@dataclass(frozen=True)
class Exported:
    """An export.

    Attributes:
        main: the file to open.
        layout: what is in it.
        notes: what became other than it is in the scene, one sentence each.
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
    """Writes a scene for another program: a folder that can be moved or zipped as it is.

    Example::

        burg.export_scene("tabletop_six", "for_mujoco", "mjcf", "panda_tabletop")

    Args:
        scene: what stands on the board. The board itself, which is paper, is left out.
        folder: new, empty, or an earlier export, which is replaced as a whole when the new one is
            complete.
        to: one of `FORMATS`.
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
    if to not in FORMATS:
        raise UnknownNameError(f"format {to!r} does not exist; {nearest(to, FORMATS)}")
    chosen = FORMATS[to]
    if hand and (station is None or not chosen.with_hand):
        able = ", ".join(name for name, format in FORMATS.items() if format.with_hand)
        raise InvalidInputError(
            f"a hand can only be exported to {able}, not to {to}"
            if not chosen.with_hand
            else "a hand belongs to a station; name the station, too"
        )
    write = _writer(to)
    path = require_own_folder(folder)
    layout = lay_out(scene, station)
    if hand and station is not None:
        from burg_drake.station.diagram import build_station_diagram, read_hand

        parts = read_hand(build_station_diagram(scene, station, robot="hand"))
        write = partial(write, hand=parts)
    with replaced_folder(path) as fresh:
        notes = write(layout, fresh)
        write_record(
            fresh,
            ExportRecord(
                format=to,
                scene=scene.name,
                scene_content=scene.content,
                station=station.name if station is not None else "",
                main=chosen.main,
                software=f"burg_drake {burg_drake.__version__}",
            ),
        )
    if not chosen.hydroelastic:
        notes = (*notes, *_contact_notes(layout, to))
    return Exported(path / chosen.main, layout, notes)


def _writer(to: str) -> Callable[..., tuple[str, ...]]:
    chosen = FORMATS[to]
    if chosen.package is not None and importlib.util.find_spec(chosen.package[1]) is None:
        raise MissingDependencyError(
            f"exports to {to} need the package {chosen.package[0]}; install it with"
            f" pip install 'burg-drake[{to}]'"
        )
    writer: Callable[..., tuple[str, ...]] = getattr(
        importlib.import_module(f"burg_drake.export.{chosen.module}"), chosen.writer
    )
    return writer


def _contact_notes(layout: Layout, to: str) -> list[str]:
    """What of the objects' contact a format without Drake's properties does not have."""
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
