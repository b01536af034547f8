"""Runs the verbs of `burg-drake library` that look: list, check, show."""

from __future__ import annotations

import argparse
import contextlib
from collections import defaultdict
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from burg_drake.core import BurgError
from burg_drake.core.terminal import TextTable, format_count, format_number

if TYPE_CHECKING:
    from burg_drake.objects.library import ObjectEntry, ObjectLibrary


def run_list(arguments: argparse.Namespace) -> int:
    """Prints a library as a table."""
    from burg_drake.objects.library import load_library

    library = load_library(arguments.library)
    print_library(library)
    count = len(library.objects)
    print(f"{count} object{'' if count == 1 else 's'} in {library.root}")
    return 0


def run_check(arguments: argparse.Namespace) -> int:
    """Prints what is wrong with a library; 1 if there are errors."""
    from burg_drake.objects.library import load_library
    from burg_drake.pipeline import check_library

    library = load_library(arguments.library)
    issues = check_library(library)
    print_contact(library, library.objects)
    for issue in issues:
        where = f"{issue.object}: " if issue.object else ""
        print(f"{'error' if issue.is_error else 'warning'}: {where}{issue.kind}: {issue.message}")
    errors = sum(issue.is_error for issue in issues)
    counts = {"object": len(library.objects), "error": errors, "warning": len(issues) - errors}
    words = [f"{n} {what}{'' if n == 1 else 's'}" for what, n in counts.items()]
    print(f"{library.root}: {', '.join(words)}")
    return 1 if errors else 0


def run_show(arguments: argparse.Namespace) -> int:
    """Shows a library in Meshcat, or writes pages of it."""
    from burg_drake.apps.terminal import open_view, present
    from burg_drake.objects.library import load_library
    from burg_drake.pipeline import check_library
    from burg_drake.visualization.gallery import show_library
    from burg_drake.visualization.pictures import write_contact_sheet

    library = load_library(arguments.library)
    for name in arguments.only or ():
        library.entry(name)
    if arguments.sheet is not None:
        remarks: dict[str, list[str]] = defaultdict(list)
        for issue in check_library(library):
            remarks[issue.object].append(issue.message)
        write_contact_sheet(library, arguments.sheet, arguments.only, remarks=remarks)
        print(f"wrote {arguments.sheet}")
        if arguments.html is None:
            return 0
    meshcat = open_view(arguments)
    legend = show_library(library, meshcat, arguments.only)
    count = len(arguments.only or library.objects)
    present(meshcat, arguments, title=library.name, caption=[f"{count} objects"], legend=legend)
    return 0


def print_library(library: ObjectLibrary, only: Iterable[str] | None = None) -> None:
    """Prints objects as a table."""
    chosen = set(library.objects if only is None else only)
    shown = {name: entry for name, entry in library.objects.items() if name in chosen}
    library_table(shown).show()
    print("mu: friction coefficient; pieces: convex pieces for collisions")
    print("poses: stable poses, in which the object can rest on a table")
    if any(entry.mass_properties.source == "density" for entry in shown.values()):
        print("~: mass from volume and density; give the true one with --mass NAME=KG")


def print_contact(library: ObjectLibrary, names: Iterable[str]) -> None:
    """Prints what gripper pads touch of objects: not of those of which a check or build says more,
    that they touch pieces for a reason, or that a file is missing or damaged."""
    from burg_drake.objects.collision import touched_by_pads

    for name in names:
        if not library.entry(name).contact.reason:
            with contextlib.suppress(BurgError):
                print(f"{name}: gripper pads touch {touched_by_pads(library, name)}")


def library_table(objects: Mapping[str, ObjectEntry]) -> TextTable:
    """Objects by name."""
    table = TextTable().names("object")
    table.numbers("mass [g]", "size [mm]", "mu", "pieces", "poses")
    for name, entry in objects.items():
        size = [1e3 * (b - a) for a, b in zip(entry.lower, entry.upper, strict=True)]
        mass = format_number(1e3 * entry.mass, 1)
        marks = {"density": f"~{mass}", "fixed": "fixed"}
        table.row(
            name,
            marks.get(entry.mass_properties.source, mass),
            " x ".join(format_number(s, 0) for s in size),
            format_number(entry.friction),
            format_count(len(entry.pieces)),
            format_count(len(entry.stable_poses)),
        )
    return table
