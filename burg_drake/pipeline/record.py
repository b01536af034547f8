"""What is kept beside an object's files in `build.json`: keys, and figures that later builds need.

A new mass then rewrites the SDF and nothing else, and an object that has not changed is not even
loaded.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core import DocumentError
from burg_drake.core.documents import Vector3, load_document, load_json, plain_data
from burg_drake.core.files import atomic_write
from burg_drake.objects.library import ContactGeometry, Fit, ObjectEntry, StablePose
from burg_drake.objects.physics import Solid
from burg_drake.pipeline.keys import VERSION, StageKeys

RECORD_FILE = "build.json"


@dataclass(frozen=True, kw_only=True)
class Geometry:
    """What a build found out about an object's shape.

    Attributes:
        repairs: made to the surface.
        surface: file of the surface where it is not the visual one; else empty.
        closed: whether the surface is watertight.
        wall: thickness of the wall that an open surface became [m]; None for others.
        lower, upper: bounds [m].
        volume, p_OOcm, G_OOcm: see `mass.Solid`; the matrix by rows.
        pieces: file names in the object's folder.
        threshold: that the pieces were cut with; None for pieces that came with the object.
        cut: what was done to get them beyond what was asked for; or empty.
        fit: how well the pieces stand for the surface.
        contact: what touches; file names are those in the object's folder.
        stable_poses: most probable first.
        notes: remarks on the poses.
    """

    repairs: tuple[str, ...]
    surface: str = ""
    closed: bool
    wall: float | None = None
    lower: Vector3
    upper: Vector3
    volume: float
    p_OOcm: Vector3
    G_OOcm: tuple[float, ...]
    pieces: tuple[str, ...]
    threshold: float | None = None
    cut: str = ""
    fit: Fit | None
    contact: ContactGeometry
    stable_poses: tuple[StablePose, ...]
    notes: tuple[str, ...] = ()

    @property
    def solid(self) -> Solid:
        """What the mass properties follow from."""
        return Solid(self.volume, np.array(self.p_OOcm), np.reshape(self.G_OOcm, (3, 3)))


@dataclass(frozen=True, kw_only=True)
class Record:
    """Contents of `build.json`.

    Attributes:
        keys: of the last build.
        geometry: what it found out.
        files: SHA-256 of each file in the object's folder, by name.
        entry: hash of the entry in `library.yaml`, see `entry_hash`.
    """

    version: int = VERSION
    keys: StageKeys
    geometry: Geometry
    files: dict[str, str]
    entry: str


def write_record(home: Path, record: Record) -> None:
    """Writes the record of an object's folder."""
    atomic_write(home / RECORD_FILE, json.dumps(plain_data(record), indent=1) + "\n")


def read_record(home: Path) -> Record | None:
    """The record in an object's folder, or None where this release can read none."""
    try:
        return load_document(home / RECORD_FILE, Record)
    except DocumentError:
        return None


def is_as_built(home: Path, keys: StageKeys, entry: ObjectEntry) -> bool:
    """Whether a folder is what a build with these keys left, and the entry what it listed."""
    data = _read_json(home)
    if data is None or data.get("version") != VERSION:
        return False
    return (
        data.get("keys") == asdict(keys)
        and data.get("entry") == entry_hash(entry)
        and data.get("files") == file_hashes(home)
    )


def intact(home: Path, record: Record, names: Iterable[str]) -> bool:
    """Whether files of an object's folder are those that were built."""
    found = file_hashes(home)
    return all(name in found and found[name] == record.files.get(name) for name in names)


def entry_hash(entry: ObjectEntry) -> str:
    """SHA-256 of an entry; the same before and after it was written to a document."""
    return hashlib.sha256(json.dumps(plain_data(entry)).encode()).hexdigest()


def is_object_folder(home: Path) -> bool:
    """Whether a folder was made by a build, of this release or of another one."""
    data = _read_json(home)
    return data is not None and "keys" in data


def touched_by_pieces(home: Path) -> bool:
    """Whether pads touch the convex pieces of what a build, of any release, left in a folder."""
    data = _read_json(home) or {}
    geometry = data.get("geometry")
    if not isinstance(geometry, dict):
        return False
    contact = geometry.get("contact", {})
    return isinstance(contact, dict) and contact.get("kind", "pieces") == "pieces"


def file_hashes(home: Path) -> dict[str, str]:
    """SHA-256 of all files of an object's folder but the record, by name."""
    files = sorted(p for p in home.rglob("*") if p.is_file() and p.name != RECORD_FILE)
    return {
        p.relative_to(home).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest() for p in files
    }


def _read_json(home: Path) -> dict[str, Any] | None:
    try:
        data = load_json(home / RECORD_FILE)
    except DocumentError:
        return None
    return data if isinstance(data, dict) else None
