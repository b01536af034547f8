"""`burg-drake library`: build, import, list, check and show object libraries."""

from __future__ import annotations

import argparse
import contextlib
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from burg_drake import core, pipeline
from burg_drake.apps import options
from burg_drake.apps.commands.library_sources import (
    mesh_sources,
    named_values,
    with_common_values,
    with_frictions,
)
from burg_drake.apps.terminal import print_remark, show_progress
from burg_drake.system_libraries import describe_missing, missing_import_libraries

if TYPE_CHECKING:
    from burg_drake.objects import ObjectEntry, ObjectLibrary


def run_library_list(arguments: argparse.Namespace) -> int:
    """Prints a library as a table."""
    from burg_drake.objects import load_library

    library = load_library(arguments.library)
    print_library(library)
    print(f"{core.count_with_noun(len(library.objects), 'object')} in {library.root}")
    return 0


def run_library_check(arguments: argparse.Namespace) -> int:
    """Prints errors and warnings of a library; returns 1 if there are errors."""
    from burg_drake.objects import load_library

    library = load_library(arguments.library)
    issues = pipeline.check_library(library)
    print_contact_geometry(library, library.objects)
    for issue in issues:
        where = f"{issue.object}: " if issue.object else ""
        print(f"{'error' if issue.is_error else 'warning'}: {where}{issue.kind}: {issue.message}")
    errors = sum(issue.is_error for issue in issues)
    counts = {"object": len(library.objects), "error": errors, "warning": len(issues) - errors}
    words = [core.count_with_noun(n, what) for what, n in counts.items()]
    print(f"{library.root}: {', '.join(words)}")
    return 1 if errors else 0


def run_library_show(arguments: argparse.Namespace) -> int:
    """Shows a library in Meshcat, or writes pages of it."""
    from burg_drake.apps.terminal import open_view, present_view
    from burg_drake.objects import load_library
    from burg_drake.visualization import show_library, write_contact_sheet

    library = load_library(arguments.library)
    for name in arguments.only or ():
        library.entry(name)
    if arguments.sheet is not None:
        remarks: dict[str, list[str]] = defaultdict(list)
        for issue in pipeline.check_library(library):
            remarks[issue.object].append(issue.message)
        write_contact_sheet(library, arguments.sheet, arguments.only, remarks=remarks)
        print(f"wrote {arguments.sheet}")
        if arguments.html is None:
            return 0
    meshcat = open_view(arguments)
    legend = show_library(library, meshcat, arguments.only)
    count = len(arguments.only or library.objects)
    present_view(
        meshcat,
        arguments,
        title=library.name,
        caption=[core.count_with_noun(count, "object")],
        legend=legend,
    )
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


def print_contact_geometry(library: ObjectLibrary, names: Iterable[str]) -> None:
    """Prints the geometry of objects that gripper pads touch. Leaves out objects with a
    problem, which check and build report."""
    from burg_drake.objects import describe_pad_contact

    for name in names:
        if not library.entry(name).contact.reason:
            with contextlib.suppress(core.BurgError):
                print(f"{name}: gripper pads touch {describe_pad_contact(library, name)}")


def library_table(objects: Mapping[str, ObjectEntry]) -> core.TextTable:
    """Table of objects by name."""
    table = core.TextTable().names("object")
    table.numbers("mass [g]", "size [mm]", "mu", "pieces", "poses")
    for name, entry in objects.items():
        size = [1e3 * (b - a) for a, b in zip(entry.lower, entry.upper, strict=True)]
        mass = core.format_number(1e3 * entry.mass, 1)
        marks = {"density": f"~{mass}", "fixed": "fixed"}
        table.row(
            name,
            marks.get(entry.mass_properties.source, mass),
            " x ".join(core.format_number(s, 0) for s in size),
            core.format_number(entry.friction),
            core.format_count(len(entry.pieces)),
            core.format_count(len(entry.stable_poses)),
        )
    return table


def run_library_build(arguments: argparse.Namespace) -> int:
    """Builds a library; returns 1 if some objects could not be built, raises if none could."""
    sources, name = mesh_sources(arguments)
    return _build_library(sources, arguments.output, arguments.name or name, arguments)


def run_library_add(arguments: argparse.Namespace) -> int:
    """Adds an object to an existing library."""
    from burg_drake.objects import LIBRARY_FILE, load_library

    folder = Path(arguments.library)
    if not (folder / LIBRARY_FILE).is_file():
        raise core.InvalidInputError(
            f"{folder} holds no {LIBRARY_FILE}; burg-drake library build MESH -o {folder} makes one"
        )
    load_library(folder)
    source = pipeline.ObjectSource.from_file(
        arguments.mesh,
        mass=arguments.mass,
        density=arguments.density,
        friction=arguments.friction,
        description=arguments.description or "",
    )
    if arguments.name:
        source = replace(source, name=pipeline.object_name(arguments.name))
    return _build_library(with_common_values([source], arguments), folder, None, arguments)


def run_library_import_burg(arguments: argparse.Namespace) -> int:
    """Builds the objects of a BURG-Toolkit library, and compares their stable poses with the
    recorded ones."""
    from burg_drake.formats import read_burg_library
    from burg_drake.objects import load_library

    toolkit = read_burg_library(arguments.file)
    names = pipeline.burg_names(toolkit)
    values = named_values(arguments, set(names.values()))
    sources = pipeline.burg_sources(
        toolkit,
        values.masses,
        density=arguments.density,
        friction=values.common_friction,
        skip=arguments.skip,
    )
    for note in (*toolkit.notes, pipeline.fixed_note(toolkit, sources)):
        if note:
            print(note)
    sources = with_frictions(sources, values)
    library_name = arguments.name or (core.make_name(toolkit.name) if toolkit.name else None)
    code = _build_library(sources, arguments.output, library_name, arguments)
    library = load_library(arguments.output)
    for item in toolkit.objects:
        name = names[item.identifier]
        if item.stable_poses and name in library.objects and not library.entry(name).is_fixed:
            recorded = [pose.X_SO for pose in item.stable_poses]
            comparison = pipeline.compare_poses(recorded, library, name)
            print(f"{name}: {comparison.sentence(Path(arguments.file).name)}")
    return code


def run_library_import_ycb(arguments: argparse.Namespace) -> int:
    """Builds the objects of a YCB download."""
    from burg_drake.formats import find_ycb

    objects = find_ycb(arguments.folder)
    values = named_values(arguments, {pipeline.object_name(item.name) for item in objects})
    sources = pipeline.ycb_sources(
        objects, values.masses, density=arguments.density, friction=values.common_friction
    )
    return _build_library(
        with_frictions(sources, values), arguments.output, arguments.name, arguments
    )


def _build_library(
    sources: Sequence[pipeline.ObjectSource],
    output: str | Path,
    name: str | None,
    arguments: argparse.Namespace,
) -> int:
    if missing := missing_import_libraries():
        raise core.InvalidInputError(describe_missing(missing))
    with show_progress("building", "objects", len(sources), quiet=arguments.quiet) as pace:

        def progress(name: str, state: str, done: int, total: int) -> None:
            """Counts an object; cached ones come first and take no time."""
            count = pace.skip if state == "cached" else pace.step
            count(1, note=f"{name} {state}")

        by_name = {source.name: source for source in sources}

        def on_failure(name: str, message: str, error: BaseException) -> None:
            """Prints the error at once, as the other objects may take long; for a single object
            the error ends the command."""
            if len(sources) > 1:
                units = error.units if isinstance(error, core.MeshError) else ()
                hint = f"; for this mesh alone --unit {name}={units[0]}" if units else ""
                print_remark(f"error: {_failure_message(by_name[name], message)}{hint}")

        report = pipeline.build_library(
            sources,
            output,
            name=name,
            confirm=not arguments.no_confirm,
            workers=arguments.workers or core.default_workers(),
            progress=progress,
            on_failure=on_failure,
        )
    done = {*report.built, *report.cached}
    if report.failed and not done:
        _print_build_summary(report)
        if len(sources) == 1:
            raise core.InvalidInputError(
                _failure_message(sources[0], report.failed[sources[0].name])
            )
        raise core.InvalidInputError(f"none of the {len(sources)} objects could be built")
    print_library(report.library, only=done)
    _print_build_notes(report)
    _print_build_summary(report)
    return 1 if report.failed else 0


def _print_build_notes(report: pipeline.BuildReport) -> None:
    for name in report.built:
        print_contact_geometry(report.library, [name])
        repairs = report.library.objects[name].source.repairs
        notes = [note for note in report.notes.get(name, ()) if note not in repairs]
        for note in dict.fromkeys([*(f"mesh: {repair}" for repair in repairs), *notes]):
            print(f"{name}: {note}")


def _print_build_summary(report: pipeline.BuildReport) -> None:
    failed = f" ({core.list_names(list(report.failed))})" if report.failed else ""
    print(
        f"{report.library.root}: {len(report.built)} built, {len(report.cached)} up to date,"
        f" {len(report.failed)} failed{failed}"
    )


def _failure_message(source: pipeline.ObjectSource, message: str) -> str:
    """A message that names the object or its mesh file."""
    is_named = message.startswith(f"{source.name}: ") or str(source.mesh) in message
    return message if is_named else f"{source.name}: {message}"


LIBRARY_FORMATS_HELP = """\
objects.yaml takes all settings of an object:
  version: 1
  defaults: {unit: mm, friction: 0.4}
  objects:
    mug: {mesh: scans/mug.obj, mass: 0.118}
    tin: {mesh: scans/tin.stl, mass: 0.05, wall_thickness: 0.0003}
    rack: {mesh: scans/rack.stl, mass: 0.4, decomposition: {threshold: 0.02}}
    chair: {mesh: chair.obj, mass: 0.9, pieces: [seat.obj, back.obj]}

A smaller decomposition.threshold (0.01 to 1) makes finer convex pieces. Without it, 0.05 is used,\
 then 0.02 and 0.01 if the pieces are too coarse. `pieces` names convex pieces of your own.

Meshes may have 512 MB and 2,000,000 triangles, or 1,000,000 if they are not closed; textures\
 8192 x 8192 pixels."""
"""Help text about objects.yaml and the limits of meshes."""


def add_library_build_options(build: options.Parser) -> None:
    """Adds the options of `burg-drake library build`."""
    build.epilog = options.examples_text(
        "burg-drake library build scans/*.obj -o my_library",
        "burg-drake library build mug.stl -o my_library --unit mm --mass mug=0.118",
        "burg-drake library build scans/ -o my_library --masses masses.yaml --friction 0.4",
        "burg-drake library build objects.yaml -o my_library",
        "",
        LIBRARY_FORMATS_HELP,
    )
    build.add_argument(
        "meshes",
        metavar="MESH",
        nargs="+",
        help="mesh files (.obj, .ply, .stl, .off, .glb, .gltf), folders of them, or an"
        " objects.yaml",
    )
    _add_output(build)
    _add_values_by_object(build)
    _add_build_options(build)


def add_library_add_options(add: options.Parser) -> None:
    """Adds the options of `burg-drake library add`."""
    from burg_drake.objects import DEFAULT_FRICTION

    add.epilog = options.examples_text(
        "burg-drake library add my_library mug.obj --mass 0.118 --friction 0.4",
        "burg-drake library add my_library scan_7.ply --name towel --mass 0.2"
        " --wall-thickness 0.005",
    )
    add.add_argument("library", metavar="LIBRARY", help="folder of the library")
    add.add_argument("mesh", metavar="MESH", help="mesh file")
    add.add_argument("--name", help="name of the object (default: that of the mesh file)")
    add.add_argument("--mass", metavar="KG", type=options.positive, help="mass in kg")
    add.add_argument(
        "--friction",
        metavar="MU",
        type=options.coefficient,
        help=f"friction coefficient (default: {DEFAULT_FRICTION:g})",
    )
    add.add_argument("--description", metavar="TEXT", help="a note for people")
    _add_build_options(add)


def add_library_import_burg_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake library import-burg`."""
    parser.epilog = options.examples_text(
        "burg-drake library import-burg object_library.yaml -o my_library",
        "burg-drake library import-burg object_library.yaml -o my_library --mass table=4",
    )
    parser.add_argument(
        "file", metavar="FILE", help="object_library.yaml of BURG-Toolkit, version 1.0"
    )
    parser.add_argument(
        "--skip",
        metavar="NAME",
        action="append",
        default=[],
        help="leave out this object; repeatable",
    )
    _add_shared_import_options(parser, " (default: such objects stay fixed, as background)")


def add_library_import_ycb_options(ycb: options.Parser) -> None:
    """Adds the options of `burg-drake library import-ycb`."""
    ycb.epilog = options.examples_text("burg-drake library import-ycb ~/data/ycb -o ycb_library")
    ycb.add_argument("folder", metavar="DIR", help="folder with the downloaded objects")
    _add_shared_import_options(ycb)


def _add_shared_import_options(parser: options.Parser, help_suffix: str = "") -> None:
    _add_output(parser)
    _add_values_by_object(parser)
    _add_density(parser, help_suffix)
    _add_build_run_options(parser)


def _add_library_argument(parser: options.Parser) -> None:
    parser.add_argument(
        "library", metavar="LIBRARY", help="folder of a library, or the built-in household"
    )


def add_library_list_options(listing: options.Parser) -> None:
    """Adds the options of `burg-drake library list`."""
    listing.epilog = options.examples_text(
        "burg-drake library list household", "burg-drake library list my_library"
    )
    _add_library_argument(listing)


def add_library_check_options(check: options.Parser) -> None:
    """Adds the options of `burg-drake library check`."""
    check.epilog = options.examples_text("burg-drake library check my_library")
    _add_library_argument(check)


def add_library_show_options(show: options.Parser) -> None:
    """Adds the options of `burg-drake library show`."""
    show.epilog = options.examples_text(
        "burg-drake library show household",
        "burg-drake library show my_library --only mug,bowl",
        "burg-drake library show my_library --html gallery.html --sheet sheet.html",
    )
    _add_library_argument(show)
    show.add_argument(
        "--only", metavar="A,B", type=options.names, action="extend", help="only these objects"
    )
    show.add_argument(
        "--sheet",
        metavar="FILE",
        help="also write a page with a picture and key figures of each object",
    )
    options.add_view_options(show)


def _add_output(parser: options.Parser) -> None:
    options.add_output(parser, "DIR", "folder of the library")
    parser.add_argument("--name", help="name of the library (default: that of its folder)")


def _add_values_by_object(parser: options.Parser) -> None:
    from burg_drake.objects import DEFAULT_FRICTION

    parser.add_argument(
        "--mass",
        metavar="NAME=KG",
        type=options.named_positive,
        action="append",
        default=[],
        help="mass of an object in kg; repeatable",
    )
    parser.add_argument(
        "--masses",
        metavar="FILE",
        type=options.input_file,
        help="YAML file of 'NAME: KG' lines, '-' for standard input; --mass wins",
    )
    parser.add_argument(
        "--friction",
        metavar="[NAME=]MU",
        type=options.friction,
        action="append",
        default=[],
        help=f"friction coefficient of one object or of all (default: {DEFAULT_FRICTION:g})",
    )


def _add_density(parser: options.Parser, help_suffix: str = "") -> None:
    parser.add_argument(
        "--density",
        metavar="KG/M3",
        type=options.positive,
        help=f"density of objects without a mass{help_suffix}",
    )


def _add_build_options(parser: options.Parser) -> None:
    from burg_drake.objects import CONTACT_KINDS, UNITS, Openings

    _add_density(parser)
    scale = parser.add_mutually_exclusive_group()
    scale.add_argument(
        "--unit",
        metavar="[NAME=]UNIT",
        type=options.unit,
        action="append",
        default=[],
        help=f"unit of one mesh or of all: {', '.join(UNITS)} (default: m)",
    )
    scale.add_argument(
        "--scale",
        type=options.positive,
        help="factor from the meshes' unit to metres, such as 0.0005",
    )
    parser.add_argument(
        "--wall-thickness",
        metavar="M",
        type=options.positive,
        help="treat surfaces as walls of this thickness in metres",
    )
    parser.add_argument(
        "--openings",
        choices=get_args(Openings),
        help="large openings in a mesh: treat the surface as a thin wall (default), or close them",
    )
    parser.add_argument(
        "--contact", choices=CONTACT_KINDS, help="collision geometry (default: chosen by the shape)"
    )
    _add_build_run_options(parser)


def _add_build_run_options(parser: options.Parser) -> None:
    parser.add_argument(
        "--no-confirm", action="store_true", help="skip the simulation that confirms stable poses"
    )
    options.add_workers(parser)
    options.add_quiet(parser)
