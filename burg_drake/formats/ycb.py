"""Finds the meshes of the YCB object set in a folder, in any of the usual folder layouts.

The layouts are those of the downloads (one folder an object with `google_16k`, `google_64k`,
`google_512k`, `poisson` or `tsdf` in it), of the archives unpacked each into a folder of its own
(`003_cracker_box_google_16k/...`), of YCB-Video (`003_cracker_box/textured.obj`), and flat files
(`003_cracker_box.obj`, `003_cracker_box_textured.obj`). Nothing is downloaded.

Masses are those of the object table in B. Calli, A. Walsman, A. Singh, S. Srinivasa, P. Abbeel,
A. M. Dollar, "Benchmarking in Manipulation Research: Using the Yale-CMU-Berkeley Object and Model
Set", IEEE Robotics & Automation Magazine 22(3), 2015, p. 43. They were taken from the transcription
in github.com/google-deepmind/dm_robotics, py/manipulation/props/ycb_objects/ycb_object.py, and each
was found again in at least one more. Objects have none here where the table gives one figure for a
set of which the meshes are the parts (wood blocks, peg test, toy airplane, Lego Duplo), or no
figure (marbles).
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from burg_drake.core import InvalidInputError, data_root, load_plain_yaml

YCB_MASS_SOURCE = "Calli et al. 2015 (IEEE RAM 22(3), object table)"
"""Publication that the masses are from."""

YCB_MASSES: dict[str, float] = {
    name: float(mass)
    for name, mass in load_plain_yaml(data_root() / "models/ycb_masses.yaml").items()
}
"""Published mass of each object, in kg; see the module's docstring."""

YCB_OBJECTS_WITHOUT_MASS = (
    *(f"063-{letter}_marbles" for letter in "abcdef"),
    *(f"070-{letter}_colored_wood_blocks" for letter in "ab"),
    "071_nine_hole_peg_test",
    *(f"072-{letter}_toy_airplane" for letter in "abcdefghijk"),
    *(f"073-{letter}_lego_duplo" for letter in "abcdefghijklm"),
)
"""Objects without a published mass."""

YCB_NAMES = {name.split("_", 1)[0]: name for name in (*YCB_MASSES, *YCB_OBJECTS_WITHOUT_MASS)}
"""Object name by number, such as `065-a`."""

YCB_VARIANTS = ("google_16k", "google_64k", "google_512k", "", "poisson", "tsdf")
"""Scans of an object, best first; empty if no folder names the scan."""

_VARIANT_SUFFIXES = re.compile(
    r"(_(google_16k|google_64k|google_512k|poisson|tsdf|berkeley_meshes|textured_simple|textured"
    r"|nontextured))+$"
)
"""Suffixes of a name that tell the scan or the kind of mesh."""
_NUMBERED_NAME = re.compile(r"(?:ycb_)?(\d{3})(?:[-_]([a-z]))?_(.+)")
"""YCB number, optional letter, and name."""


@dataclass(frozen=True, kw_only=True)
class YcbObject:
    """An object of the YCB set on this disk.

    Attributes:
        number: such as `003` or `065-a`.
        name: such as `003_cracker_box`.
        mesh: the best mesh file found; YCB meshes are in metres.
        variant: scan of the mesh, such as `google_16k`; empty if its path does not name it.
        mass: published mass [kg]; None if no mass is published for the object of the mesh.
        mass_source: where the mass was published; empty without one.
    """

    number: str
    name: str
    mesh: Path
    variant: str
    mass: float | None
    mass_source: str


def find_ycb(folder: str | Path) -> list[YcbObject]:
    """Finds the objects of the YCB set in a folder and its subfolders.

    Args:
        folder: where the downloads were unpacked.

    Returns:
        One entry per object, by number, with its best mesh, see `YCB_VARIANTS` and
        `_identify_mesh`.

    Raises:
        InvalidInputError: there is no such folder, or no object of the set in it.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InvalidInputError(
            f"{folder} is not a folder; give the one that the YCB downloads were unpacked in"
        )
    found: dict[str, tuple[tuple[int | str, ...], Path]] = {}
    archives = []
    for file in _walk_files(folder):
        if file.name.lower().endswith((".tgz", ".tar.gz", ".zip")):
            archives.append(file)
            continue
        described = _identify_mesh(file)
        if described is not None:
            name, rank = described
            found[name] = min((rank, file), found.get(name, (rank, file)))
    if not found:
        raise InvalidInputError(_nothing_found(folder, archives))
    return [_make_object(name, *found[name]) for name in sorted(found)]


def find_ycb_name(text: str) -> str | None:
    """The object that a file or folder is named after, such as `003_cracker_box_google_16k`."""
    match = _NUMBERED_NAME.fullmatch(_VARIANT_SUFFIXES.sub("", text.lower()))
    if match is None:
        return None
    digits, letter, rest = match.groups()
    name = YCB_NAMES.get(f"{digits}-{letter}" if letter else digits)
    return name if name is not None and name.split("_", 1)[1] == rest else None


def _make_object(name: str, rank: tuple[int | str, ...], mesh: Path) -> YcbObject:
    return YcbObject(
        number=name.split("_", 1)[0],
        name=name,
        mesh=mesh,
        variant=YCB_VARIANTS[int(rank[0])],
        mass=YCB_MASSES.get(name),
        mass_source=YCB_MASS_SOURCE if name in YCB_MASSES else "",
    )


def _walk_files(folder: Path) -> Iterator[Path]:
    without_meshes = {"clouds", "masks", "poses", "urdf"}
    for place, folders, files in os.walk(folder):
        folders[:] = sorted(f for f in folders if f not in without_meshes and f[0] != ".")
        yield from (Path(place, file) for file in sorted(files))


def _identify_mesh(file: Path) -> tuple[str, tuple[int | str, ...]] | None:
    """The object of a mesh file, and a rank (lower is better); None for any other file."""
    stems = ("textured", "", "textured_simple", "nontextured")  # best first; "": the object's name
    suffixes = (".obj", ".ply", ".stl", ".glb", ".gltf")  # best first
    suffix = file.suffix.lower()
    if suffix not in suffixes:
        return None
    stem = file.stem.lower()
    parts = [part.lower() for part in Path(os.path.abspath(file)).parts[:-1]]
    name = find_ycb_name(stem)
    if name is None:
        if stem not in stems:
            return None
        name = next((n for n in map(find_ycb_name, reversed(parts)) if n is not None), None)
        kind = stem
    else:
        kind = next((s for s in stems if s and stem.endswith(f"_{s}")), "")
    if name is None:
        return None
    # the nearest folder that names the variant, up to the object's own folder
    near = [stem.removesuffix(f"_{kind}"), *reversed(parts)][:4]
    variant = next(
        (v for p in near for v in YCB_VARIANTS if v and (p == v or p.endswith(f"_{v}"))), ""
    )
    rank = (YCB_VARIANTS.index(variant), stems.index(kind), suffixes.index(suffix), str(file))
    return name, rank


def _nothing_found(folder: Path, archives: list[Path]) -> str:
    message = (
        f"no YCB objects found in {folder} or its subfolders; expected folders such as"
        " 003_cracker_box/google_16k with a textured.obj, or files such as"
        " 003_cracker_box.obj;"
    )
    if archives:
        more = f" and {len(archives) - 1} more" if len(archives) > 1 else ""
        return f"{message} there are archives ({archives[0].name}{more}): unpack them there"
    return (
        f"{message} nothing is downloaded: get the meshes from"
        " https://www.ycbbenchmarks.com/object-models and unpack them there"
    )
