"""Runs the verbs of `burg-drake library` that build: build, add, import-burg, import-ycb."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake.apps.library.object_values import (
    named_values,
    sources_of,
    with_common_values,
    with_frictions,
)
from burg_drake.core import InvalidInputError, MeshError, listing
from burg_drake.system_libraries import describe_missing, missing_import_libraries

if TYPE_CHECKING:
    from burg_drake.pipeline import BuildReport, ObjectSource


def run_build(arguments: argparse.Namespace) -> int:
    """Builds a library; 1 if some objects could not be built, an error if none could."""
    sources, name = sources_of(arguments)
    return _build(sources, arguments.output, arguments.name or name, arguments)


def run_add(arguments: argparse.Namespace) -> int:
    """Adds an object to a library that exists."""
    from burg_drake.objects.library import LIBRARY_FILE, load_library
    from burg_drake.pipeline import ObjectSource, object_name

    folder = Path(arguments.library)
    if not (folder / LIBRARY_FILE).is_file():
        raise InvalidInputError(
            f"{folder} holds no {LIBRARY_FILE}; burg-drake library build MESH -o {folder} makes one"
        )
    load_library(folder)
    source = ObjectSource.from_file(
        arguments.mesh,
        mass=arguments.mass,
        density=arguments.density,
        friction=arguments.friction,
        description=arguments.description or "",
    )
    if arguments.name:
        source = replace(source, name=object_name(arguments.name))
    return _build(with_common_values([source], arguments), folder, None, arguments)


def run_import_burg(arguments: argparse.Namespace) -> int:
    """Builds what a library of BURG-Toolkit lists, and tells how the stable poses agree."""
    from burg_drake.core.paths import name_from
    from burg_drake.formats.collections import read_burg_library
    from burg_drake.objects.library import load_library
    from burg_drake.pipeline import (
        burg_names,
        burg_sources,
        compare_poses,
        fixed_note,
    )

    burg = read_burg_library(arguments.file)
    names = burg_names(burg)
    values = named_values(arguments, set(names.values()))
    sources = burg_sources(
        burg,
        values.masses,
        density=arguments.density,
        friction=values.common_friction,
        skip=arguments.skip,
    )
    for note in (*burg.notes, fixed_note(burg, sources)):
        if note:
            print(note)
    sources = with_frictions(sources, values)
    name = arguments.name or (name_from(burg.name) if burg.name else None)
    code = _build(sources, arguments.output, name, arguments)
    library = load_library(arguments.output)
    for item in burg.objects:
        name = names[item.identifier]
        if item.stable_poses and name in library.objects and not library.entry(name).is_fixed:
            recorded = [pose.X_SO for pose in item.stable_poses]
            comparison = compare_poses(recorded, library, name)
            print(f"{name}: {comparison.sentence(Path(arguments.file).name)}")
    return code


def run_import_ycb(arguments: argparse.Namespace) -> int:
    """Builds the objects of a YCB download."""
    from burg_drake.formats.collections import find_ycb
    from burg_drake.pipeline import object_name, ycb_sources

    objects = find_ycb(arguments.folder)
    values = named_values(arguments, {object_name(item.name) for item in objects})
    sources = ycb_sources(
        objects, values.masses, density=arguments.density, friction=values.common_friction
    )
    return _build(with_frictions(sources, values), arguments.output, arguments.name, arguments)


def _build(
    sources: Sequence[ObjectSource],
    output: str | Path,
    name: str | None,
    arguments: argparse.Namespace,
) -> int:
    from burg_drake.apps.library.viewing import print_library
    from burg_drake.core.terminal import Progress, ProgressMeter, Reporter
    from burg_drake.core.workers import default_workers
    from burg_drake.pipeline import build_library

    if missing := missing_import_libraries():
        raise InvalidInputError(describe_missing(missing))
    with Reporter(not arguments.quiet) as reporter:
        pace = ProgressMeter(
            reporter.show, Progress("building", total=len(sources), unit="objects")
        )

        def progress(name: str, state: str, done: int, total: int) -> None:
            """Objects that are up to date come first, and cost nothing."""
            count = pace.skip if state == "cached" else pace.step
            count(1, note=f"{name} {state}")

        by_name = {source.name: source for source in sources}

        def on_failure(name: str, message: str, error: BaseException) -> None:
            """Told at once, as the others may take long; an only object's ends the command."""
            if len(sources) > 1:
                text = _failure(by_name[name], message) + _unit_option(name, error)
                print(f"burg-drake: error: {text}", file=sys.stderr)

        report = build_library(
            sources,
            output,
            name=name,
            confirm=not arguments.no_confirm,
            workers=arguments.workers or default_workers(),
            progress=progress,
            on_failure=on_failure,
        )
    done = {*report.built, *report.cached}
    if report.failed and not done:
        _print_summary(report)
        if len(sources) == 1:
            raise InvalidInputError(_failure(sources[0], report.failed[sources[0].name]))
        raise InvalidInputError(f"none of the {len(sources)} objects could be built")
    print_library(report.library, only=done)
    _print_notes(report)
    _print_summary(report)
    return 1 if report.failed else 0


def _print_notes(report: BuildReport) -> None:
    from burg_drake.apps.library.viewing import print_contact

    for name in report.built:
        print_contact(report.library, [name])
        repairs = report.library.objects[name].source.repairs
        notes = [note for note in report.notes.get(name, ()) if note not in repairs]
        for note in dict.fromkeys([*(f"mesh: {repair}" for repair in repairs), *notes]):
            print(f"{name}: {note}")


def _print_summary(report: BuildReport) -> None:
    failed = f" ({listing(list(report.failed))})" if report.failed else ""
    print(
        f"{report.library.root}: {len(report.built)} built, {len(report.cached)} up to date,"
        f" {len(report.failed)} failed{failed}"
    )


def _failure(source: ObjectSource, message: str) -> str:
    """A message that names the object or its mesh file."""
    is_named = message.startswith(f"{source.name}: ") or str(source.mesh) in message
    return message if is_named else f"{source.name}: {message}"


def _unit_option(name: str, error: BaseException) -> str:
    """How the unit that an error proposes is given for one of several meshes."""
    units = error.units if isinstance(error, MeshError) else ()
    return f"; for this mesh alone --unit {name}={units[0]}" if units else ""
