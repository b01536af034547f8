"""Checks an object library for missing, stale or implausible files and values."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from burg_drake.core import BurgError, MeshError
from burg_drake.objects import (
    ObjectEntry,
    ObjectLibrary,
    contact_fallback_message,
    deviation_warning,
    implausible_properties,
    mesh_hash,
    missing_textures,
)
from burg_drake.pipeline.build_record import (
    BuildRecord,
    entry_hash,
    file_hashes,
    is_object_folder,
    read_record,
)

LibraryIssueKind = Literal["missing", "changed", "stale", "broken", "implausible", "unsure"]
FoundIssues = Iterator[tuple[LibraryIssueKind, str]]
"""Kind and message of each issue of an object."""


@dataclass(frozen=True, kw_only=True)
class LibraryIssue:
    """An error or warning about a library.

    Attributes:
        object: name of the object; empty for an issue of the library's folder.
        kind: `missing` or `changed` files, `stale` against its source or this release, `broken`
            for Drake: errors. `implausible` values, `unsure` ones that were assumed: warnings.
        message: one clear line.
    """

    object: str
    kind: LibraryIssueKind
    message: str

    @property
    def is_error(self) -> bool:
        """Whether the object cannot be used as it is."""
        return self.kind in ("missing", "changed", "stale", "broken")


def check_library(library: ObjectLibrary) -> tuple[LibraryIssue, ...]:
    """Checks all objects of a library without changing anything.

    Args:
        library: the library.

    Returns:
        Issues by object, errors first; empty if there are none.
    """
    issues: list[LibraryIssue] = []
    for name, entry in library.objects.items():
        found = [
            LibraryIssue(object=name, kind=kind, message=message)
            for kind, message in (*_file_issues(library, name, entry), *_value_issues(entry))
        ]
        issues += sorted(found, key=lambda issue: not issue.is_error)
    for folder in sorted(p for p in library.root.iterdir() if p.is_dir()):
        if folder.name not in library.objects and is_object_folder(folder):
            text = f"{folder} is an object that is not in library.yaml; add it again"
            issues.append(LibraryIssue(object="", kind="missing", message=text))
    return tuple(issues)


def _file_issues(library: ObjectLibrary, name: str, entry: ObjectEntry) -> FoundIssues:
    home = library.root / Path(entry.sdf).parent
    record = read_record(home)
    missing = [p for p in entry.files if not (library.root / p).is_file()]
    if missing:
        more = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
        yield "missing", f"{library.root / missing[0]} is missing{more}; build it again"
    if record is None:
        yield "stale", f"{home} was built by another release of burg_drake; build it again"
    else:
        yield from _record_issues(library, name, record, home)
    source = library.root / entry.source.path
    traced = bool(entry.source.path) and source.is_file()
    if traced and record is not None and _mesh_hash_or_empty(source) != record.keys.mesh:
        yield "stale", f"{source.resolve()} has changed since the object was built; build it again"
    if traced:
        for sentence in missing_textures(source):
            yield "unsure", sentence
    sdf = library.root / entry.sdf
    if not missing and (problem := drake_error(sdf)):
        yield "broken", f"Drake cannot load {sdf}: {problem}"


def _mesh_hash_or_empty(source: Path) -> str:
    """Hash of a mesh; empty if it can no longer be read."""
    try:
        return mesh_hash(source)
    except MeshError:
        return ""


def _record_issues(
    library: ObjectLibrary, name: str, record: BuildRecord, home: Path
) -> FoundIssues:
    entry, found = library.entry(name), file_hashes(home)
    listed = {library.root / p for p in entry.files}
    lost = sorted(f for f in record.files if f not in found and home / f not in listed)
    if lost:
        yield "missing", f"{home / lost[0]} is missing; build it again"
    changed = sorted(f for f, sha in record.files.items() if found.get(f, sha) != sha)
    if changed:
        more = f" (and {len(changed) - 1} more)" if len(changed) > 1 else ""
        yield "changed", f"{home / changed[0]} was changed after it was built{more}; build it again"
    if record.keys.build != entry.build:
        yield "stale", f"{home} and library.yaml come from different builds; build it again"
    elif record.entry != entry_hash(entry):
        text = "library.yaml was edited: its values differ from what was built"
        yield "changed", f"{text}; to change values, build again"


def _value_issues(entry: ObjectEntry) -> FoundIssues:
    properties = entry.mass_properties
    for sentence in implausible_properties(properties, entry.lower, entry.upper):
        yield "implausible", sentence
    if properties.source == "density":
        density = properties.mass / properties.volume
        text = f"mass {properties.mass:.3g} kg was computed from a density of {density:.0f} kg/m^3"
        yield "unsure", f"{text}, as none was given"
    low, high = 0.05, 1.5  # of dry household materials, without ice and soft rubber
    if not low <= entry.friction <= high:
        text = f"friction {entry.friction:g} is unusual: household materials have {low} to {high}"
        yield "implausible", text
    if entry.fit is None:
        yield (
            "unsure",
            "the surface is not closed; volume and inertia are those of the convex pieces",
        )
    else:
        diagonal = float(np.linalg.norm(np.subtract(entry.upper, entry.lower)))
        threshold = entry.decomposition.threshold if entry.decomposition else None
        if text := deviation_warning(entry.fit, diagonal, threshold):
            yield "implausible", text
    if entry.contact.reason:
        yield "unsure", contact_fallback_message(entry.contact, len(entry.pieces))
    total = sum(pose.probability for pose in entry.stable_poses)
    if abs(total - 1.0) > 1e-3:
        yield "implausible", f"probabilities of the stable poses sum to {total:.3f} instead of 1"
    if not entry.is_fixed and any(pose.residual is None for pose in entry.stable_poses):
        yield "unsure", "its stable poses were not confirmed in simulation"


def drake_error(sdf: Path) -> str:
    """Error or first warning of Drake's parser about a model; empty if there is none."""
    from pydrake.geometry import SceneGraph
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    from burg_drake.station import add_models, buffer_drake_log  # imports Drake

    plant, graph = MultibodyPlant(0.001), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(graph)
    with buffer_drake_log() as remarks:
        try:
            add_models(Parser(plant), sdf)
            plant.Finalize()
        except (RuntimeError, ValueError, SystemExit, BurgError) as error:
            return " ".join(str(error).split())
    warnings = [record.getMessage() for record in remarks if record.levelno >= logging.WARNING]
    return " ".join(warnings[0].split()) if warnings else ""
