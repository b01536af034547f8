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


@dataclass(frozen=True, kw_only=True)
class LibraryIssue:
    """Something about a library that its user should know.

    Attributes:
        object: name of the object; empty where it is about the library's folder.
        kind: `missing` or `changed` files, `stale` against its source or this release, `broken`
            for Drake: errors. `implausible_properties` values, `unsure` ones that were assumed: warnings.
        message: one clear line.
    """

    object: str
    kind: LibraryIssueKind
    message: str

    @property
    def is_error(self) -> bool:
        """The object cannot be trusted as it is."""
        return self.kind in ("missing", "changed", "stale", "broken")


def check_library(library: ObjectLibrary) -> tuple[LibraryIssue, ...]:
    """Checks all objects of a library; nothing is changed.

    Args:
        library: the library.

    Returns:
        What was found, object by object, errors first; nothing if all is well.
    """
    issues: list[LibraryIssue] = []
    for name, entry in library.objects.items():
        found = [*_file_issues(library, name, entry), *_value_issues(name, entry)]
        issues += sorted(found, key=lambda issue: not issue.is_error)
    for folder in sorted(p for p in library.root.iterdir() if p.is_dir()):
        if folder.name not in library.objects and is_object_folder(folder):
            text = f"{folder} is an object that is not in library.yaml; add it again"
            issues.append(LibraryIssue(object="", kind="missing", message=text))
    return tuple(issues)


def _file_issues(library: ObjectLibrary, name: str, entry: ObjectEntry) -> Iterator[LibraryIssue]:
    home = library.root / Path(entry.sdf).parent
    record = read_record(home)
    missing = [p for p in entry.files if not (library.root / p).is_file()]
    if missing:
        more = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
        yield _make_issue(
            name, "missing", f"{library.root / missing[0]} is missing{more}; build it again"
        )
    if record is None:
        text = f"{home} was built by another release of burg_drake; build it again"
        yield _make_issue(name, "stale", text)
    else:
        yield from _record_issues(library, name, record, home)
    source = library.root / entry.source.path
    traced = bool(entry.source.path) and source.is_file()
    if traced and record is not None and _mesh_hash_or_empty(source) != record.keys.mesh:
        yield _make_issue(
            name,
            "stale",
            f"{source.resolve()} has changed since the object was built; build it again",
        )
    if traced:
        for sentence in missing_textures(source):
            yield _make_issue(name, "unsure", sentence)
    if not missing:
        drake_problem = drake_error(library.root / entry.sdf)
        if drake_problem:
            yield _make_issue(
                name, "broken", f"Drake cannot load {library.root / entry.sdf}: {drake_problem}"
            )


def _mesh_hash_or_empty(source: Path) -> str:
    """Of a mesh; empty where it can no longer be read."""
    try:
        return mesh_hash(source)
    except MeshError:
        return ""


def _record_issues(
    library: ObjectLibrary, name: str, record: BuildRecord, home: Path
) -> Iterator[LibraryIssue]:
    entry, found = library.entry(name), file_hashes(home)
    listed = {library.root / p for p in entry.files}
    lost = sorted(f for f in record.files if f not in found and home / f not in listed)
    if lost:
        yield _make_issue(name, "missing", f"{home / lost[0]} is missing; build it again")
    changed = sorted(f for f, sha in record.files.items() if found.get(f, sha) != sha)
    if changed:
        more = f" (and {len(changed) - 1} more)" if len(changed) > 1 else ""
        text = f"{home / changed[0]} was changed after it was built{more}; build it again"
        yield _make_issue(name, "changed", text)
    if record.keys.build != entry.build:
        text = f"{home} and library.yaml come from different builds; build it again"
        yield _make_issue(name, "stale", text)
    elif record.entry != entry_hash(entry):
        text = (
            "library.yaml was edited: its values differ from what was built; to change"
            " values, build again"
        )
        yield _make_issue(name, "changed", text)


def _value_issues(name: str, entry: ObjectEntry) -> Iterator[LibraryIssue]:
    usual_friction = (0.05, 1.5)  # Dry household materials, without ice and soft rubber.
    properties = entry.mass_properties
    for sentence in implausible_properties(properties, entry.lower, entry.upper):
        yield _make_issue(name, "implausible", sentence)
    if properties.source == "density":
        density = properties.mass / properties.volume
        text = (
            f"mass {properties.mass:.3g} kg was computed from a density of {density:.0f}"
            " kg/m^3, as none was given"
        )
        yield _make_issue(name, "unsure", text)
    low, high = usual_friction
    if not low <= entry.friction <= high:
        text = f"friction {entry.friction:g} is unusual: household materials have {low} to {high}"
        yield _make_issue(name, "implausible", text)
    yield from _fit_issues(name, entry)
    if entry.contact.reason:
        yield _make_issue(
            name, "unsure", contact_fallback_message(entry.contact, len(entry.pieces))
        )
    yield from _pose_issues(name, entry)


def _fit_issues(name: str, entry: ObjectEntry) -> Iterator[LibraryIssue]:
    if entry.fit is None:
        text = "the surface is not closed; volume and inertia are those of the convex pieces"
        yield _make_issue(name, "unsure", text)
        return
    diagonal = float(np.linalg.norm(np.subtract(entry.upper, entry.lower)))
    text = deviation_warning(
        entry.fit, diagonal, entry.decomposition.threshold if entry.decomposition else None
    )
    if text:
        yield _make_issue(name, "implausible", text)


def _pose_issues(name: str, entry: ObjectEntry) -> Iterator[LibraryIssue]:
    total = sum(pose.probability for pose in entry.stable_poses)
    if abs(total - 1.0) > 1e-3:
        text = f"probabilities of the stable poses sum to {total:.3f} instead of 1"
        yield _make_issue(name, "implausible", text)
    if not entry.is_fixed and any(pose.residual is None for pose in entry.stable_poses):
        text = "its stable poses were not confirmed in simulation"
        yield _make_issue(name, "unsure", text)


def _make_issue(name: str, kind: LibraryIssueKind, message: str) -> LibraryIssue:
    return LibraryIssue(object=name, kind=kind, message=message)


def drake_error(sdf: Path) -> str:
    """What Drake's parser says against a model: its error or first warning; empty if nothing."""
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
