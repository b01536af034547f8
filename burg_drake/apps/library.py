"""`burg-drake library`: build object libraries from meshes, and list what is in them."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.arguments import (
    add_group,
    add_verb,
    friction,
    named_positive,
    positive,
    positive_int,
)
from burg_drake.core.errors import DocumentError, InvalidInputError, UnknownNameError, nearest

if TYPE_CHECKING:
    import yaml

    from burg_drake.objects.library import ObjectLibrary
    from burg_drake.pipeline.build import BuildReport
    from burg_drake.pipeline.source import ObjectSource


MASSES_FORMAT = """\
format of masses.yaml: 'NAME: KG' lines, NAME a mesh file without its suffix
  mug: 0.118
  cracker_box: 0.411"""


def add_to(verbs: Any) -> None:
    """Adds the verbs."""
    group = add_group(verbs, "library", "build object libraries from meshes")
    _add_build(group)
    show = add_verb(
        group,
        "list",
        run_list,
        "list the objects of a library",
        "burg-drake library list household",
        "burg-drake library list my_library",
    )
    show.add_argument(
        "library", metavar="LIBRARY", help="folder of a library, or name of a built-in one"
    )


def _add_build(group: Any) -> None:
    build = add_verb(
        group,
        "build",
        run_build,
        "make simulation-ready objects from meshes; what has not changed is not built again",
        "burg-drake library build scans/*.obj -o my_library",
        "burg-drake library build mug.stl -o my_library --scale 0.001 --mass mug=0.118",
        "burg-drake library build scans/ -o my_library --masses masses.yaml --friction 0.4",
    )
    build.epilog = f"{build.epilog}\n\n{MASSES_FORMAT}"
    build.add_argument(
        "meshes", metavar="MESH", nargs="+", help="mesh files (obj, ply, stl, glb, gltf) or folders"
    )
    build.add_argument("-o", "--output", metavar="DIR", required=True, help="folder of the library")
    build.add_argument("--name", help="the library's name (default: that of its folder)")
    build.add_argument(
        "--mass",
        metavar="NAME=KG",
        type=named_positive,
        action="append",
        default=[],
        help="mass of an object; may be given several times",
    )
    build.add_argument(
        "--masses", metavar="FILE", help="YAML file of 'NAME: KG' lines; --mass goes first"
    )
    build.add_argument(
        "--density", metavar="KG/M3", type=positive, help="for objects without a mass"
    )
    build.add_argument(
        "--friction",
        metavar="[NAME=]MU",
        type=friction,
        action="append",
        default=[],
        help="coefficient of one object or of all (default: 0.24)",
    )
    build.add_argument(
        "--scale",
        type=positive,
        default=1.0,
        help="factor from the meshes' unit to metres: 0.001 for millimetres",
    )
    build.add_argument(
        "--workers", type=positive_int, metavar="N", help="processes (default: one a processor)"
    )


def run_build(arguments: argparse.Namespace) -> int:
    """Builds a library; 1 if some objects could not be built, an error if none could."""
    from burg_drake.apps.progress import object_progress
    from burg_drake.evaluation.executors import default_workers
    from burg_drake.pipeline.build import build_library

    sources = _sources(arguments)
    with object_progress(len(sources)) as progress:
        report = build_library(
            sources,
            arguments.output,
            name=arguments.name,
            workers=arguments.workers or default_workers(),
            progress=progress,
        )
    done = {*report.built, *report.cached}
    if report.failed and not done:
        first = next(iter(report.failed.values()))
        more = len(report.failed) - 1
        raise InvalidInputError(first + (f" (and {more} more that failed)" if more else ""))
    print_library(report.library, only=done)
    _print_report(report)
    return 1 if report.failed else 0


def run_list(arguments: argparse.Namespace) -> int:
    """Prints a library as a table."""
    from burg_drake.objects.library import load_library

    library = load_library(arguments.library)
    print_library(library)
    count = len(library.objects)
    print(f"{count} object{'' if count == 1 else 's'} in {library.root}")
    return 0


def print_library(library: ObjectLibrary, only: Iterable[str] | None = None) -> None:
    """Prints objects as a table."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    shown = library.objects if only is None else [n for n in library.objects if n in set(only)]
    table = Table(box=box.SIMPLE_HEAD, title_justify="left")
    table.add_column("object", no_wrap=True)
    for column in ("mass [g]", "size [mm]", "mu", "pieces", "poses"):
        table.add_column(column, justify="right", no_wrap=True)
    for name in shown:
        entry = library.objects[name]
        size = [1e3 * (b - a) for a, b in zip(entry.lower, entry.upper, strict=True)]
        mass = f"{1e3 * entry.mass:.1f}"
        table.add_row(
            name,
            mass if entry.mass_properties.source == "given" else f"~{mass}",
            " x ".join(f"{s:.0f}" for s in size),
            f"{entry.friction:g}",
            str(len(entry.pieces)),
            str(len(entry.stable_poses)),
        )
    Console().print(table)
    if any(library.objects[n].mass_properties.source == "density" for n in shown):
        print("~ mass from volume and density; give the true one with --mass NAME=KG")


def _print_report(report: BuildReport) -> None:
    for name in report.built:
        repairs = report.library.objects[name].source.repairs
        for note in dict.fromkeys([*repairs, *report.notes.get(name, ())]):
            print(f"{name}: {note}")
    for name, message in report.failed.items():
        text = message if name in message else f"{name}: {message}"
        print(f"burg-drake: error: {text}", file=sys.stderr)
    print(
        f"{report.library.root}: {len(report.built)} built, {len(report.cached)} up to date,"
        f" {len(report.failed)} failed"
    )


def _sources(arguments: argparse.Namespace) -> list[ObjectSource]:
    from burg_drake.pipeline.source import ObjectSource, object_name

    meshes = _mesh_files(arguments.meshes)
    names = {object_name(mesh.stem) for mesh in meshes}
    masses = {} if arguments.masses is None else _read_masses(Path(arguments.masses), names)
    masses.update(_by_name(arguments.mass, names, "mass"))
    frictions = _by_name([f for f in arguments.friction if f[0]], names, "friction")
    common = next((mu for name, mu in reversed(arguments.friction) if not name), None)
    return [
        ObjectSource.from_file(
            mesh,
            mass=masses.get(object_name(mesh.stem)),
            density=arguments.density,
            friction=frictions.get(object_name(mesh.stem), common),
            scale=arguments.scale,
        )
        for mesh in meshes
    ]


def _mesh_files(arguments: Iterable[str]) -> list[Path]:
    """Files as they are given; of folders all meshes in them."""
    from burg_drake.objects.meshes import FORMATS

    files: list[Path] = []
    for argument in arguments:
        path = Path(argument)
        if not path.is_dir():
            files.append(path)
            continue
        found = sorted(p for p in path.iterdir() if p.suffix.lower() in FORMATS)
        if not found:
            raise InvalidInputError(f"folder {path} holds no mesh ({', '.join(FORMATS)})")
        files += found
    return files


def _by_name(pairs: Iterable[tuple[str, float]], names: set[str], what: str) -> dict[str, float]:
    """Values by object name; the name of the mesh file's stem is as good."""
    from burg_drake.pipeline.source import object_name

    values: dict[str, float] = {}
    for given, value in pairs:
        name = object_name(given)
        if name not in names:
            raise UnknownNameError(f"--{what} {given}: no such mesh; {nearest(name, names)}")
        values[name] = value
    return values


def _read_masses(path: Path, names: set[str]) -> dict[str, float]:
    """Masses [kg] by object name, of a YAML file with a line `NAME: KG` for each object."""
    import yaml

    from burg_drake.pipeline.source import object_name

    try:
        node = yaml.compose(path.read_text(encoding="utf-8"), Loader=yaml.SafeLoader)
    except OSError as error:
        raise DocumentError(f"cannot read {path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise DocumentError(f"cannot read {path}: it is not a text file") from error
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f":{mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise DocumentError(f"{path}{line}: not valid YAML: {problem}") from error
    if not isinstance(node, yaml.MappingNode):
        line = f":{node.start_mark.line + 1}" if node else ""
        raise DocumentError(f"{path}{line}: expected lines 'NAME: KG', such as 'mug: 0.118'")
    masses: dict[str, float] = {}
    for key, value in node.value:
        where = f"{path}:{key.start_mark.line + 1}"
        if not isinstance(key, yaml.ScalarNode):
            raise DocumentError(f"{where}: expected a line 'NAME: KG', such as 'mug: 0.118'")
        name = object_name(key.value)
        if name not in names:
            raise DocumentError(f"{where}: {key.value}: no such mesh; {nearest(name, names)}")
        if name in masses:
            raise DocumentError(f"{where}: {key.value}: its mass is given twice")
        masses[name] = _kilograms(value, f"{where}: {key.value}")
    return masses


def _kilograms(node: yaml.Node, where: str) -> float:
    text = node.value if isinstance(node.value, str) else "a structure"
    try:
        mass = float(text)
    except ValueError:
        mass = math.nan
    if not 0.0 < mass < math.inf:
        raise DocumentError(f"{where}: mass is {text or 'missing'}; give kilograms above 0")
    return mass
