"""`burg-drake library`: the verbs that build, check and show object libraries."""

from __future__ import annotations

from typing import Any, get_args

from burg_drake.apps.library.building import run_add, run_build, run_import_burg, run_import_ycb
from burg_drake.apps.library.viewing import run_check, run_list, run_show
from burg_drake.apps.options import (
    Parser,
    add_group,
    add_quiet,
    add_verb,
    add_view,
    add_workers,
    coefficient,
    friction,
    input_file,
    named_positive,
    names,
    positive,
    unit,
)

FORMATS_TEXT = """\
objects.yaml takes all settings of an object:
  version: 1
  defaults: {unit: mm, friction: 0.4}
  objects:
    mug: {mesh: scans/mug.obj, mass: 0.118}
    tin: {mesh: scans/tin.stl, mass: 0.05, wall_thickness: 0.0003}
    rack: {mesh: scans/rack.stl, mass: 0.4, decomposition: {threshold: 0.02}}
    chair: {mesh: chair.obj, mass: 0.9, pieces: [seat.obj, back.obj]}

A smaller decomposition.threshold (0.01 to 1) makes finer convex pieces; where none is given and\
 the pieces of 0.05 are coarse, 0.02 and 0.01 are tried. `pieces` names convex pieces of your own.

Meshes may have 512 MB and 2,000,000 triangles, with openings 1,000,000; textures 8192 x 8192\
 pixels."""


def add_to(verbs: Any) -> None:
    """Adds the verbs."""
    group = add_group(verbs, "library", "make objects from meshes; check and show them")
    _add_build(group)
    _add_add(group)
    _add_imports(group)
    _add_views(group)


def _add_build(group: Any) -> None:
    add_verb(
        group,
        "build",
        run_build,
        "make objects for simulation from meshes",
        "burg-drake library build scans/*.obj -o my_library",
        "burg-drake library build mug.stl -o my_library --unit mm --mass mug=0.118",
        "burg-drake library build scans/ -o my_library --masses masses.yaml --friction 0.4",
        "burg-drake library build objects.yaml -o my_library",
        options=_add_build_options,
    )


def _add_build_options(build: Parser) -> None:
    build.epilog = f"{build.epilog}\n\n{FORMATS_TEXT}"
    build.add_argument(
        "meshes",
        metavar="MESH",
        nargs="+",
        help="mesh files (.obj, .ply, .stl, .off, .glb, .gltf), folders of them, or an"
        " objects.yaml",
    )
    _add_output(build)
    _add_named_values(build)
    _add_common_values(build)


def _add_add(group: Any) -> None:
    add_verb(
        group,
        "add",
        run_add,
        "add one object, or build it again",
        "burg-drake library add my_library mug.obj --mass 0.118 --friction 0.4",
        "burg-drake library add my_library scan_7.ply --name towel --mass 0.2"
        " --wall-thickness 0.005",
        options=_add_add_options,
    )


def _add_add_options(add: Parser) -> None:
    from burg_drake.objects.library import DEFAULT_FRICTION

    add.add_argument("library", metavar="LIBRARY", help="folder of the library")
    add.add_argument("mesh", metavar="MESH", help="mesh file")
    add.add_argument("--name", help="name of the object (default: that of the mesh file)")
    add.add_argument("--mass", metavar="KG", type=positive, help="mass in kg")
    add.add_argument(
        "--friction",
        metavar="MU",
        type=coefficient,
        help=f"friction coefficient (default: {DEFAULT_FRICTION:g})",
    )
    add.add_argument("--description", metavar="TEXT", help="a note for people")
    _add_common_values(add)


def _add_imports(group: Any) -> None:
    add_verb(
        group,
        "import-burg",
        run_import_burg,
        "build a library from BURG-Toolkit's",
        "burg-drake library import-burg object_library.yaml -o my_library",
        "burg-drake library import-burg object_library.yaml -o my_library --mass table=4",
        options=_add_burg_options,
    )
    add_verb(
        group,
        "import-ycb",
        run_import_ycb,
        "build a library from a download of the YCB objects",
        "burg-drake library import-ycb ~/data/ycb -o ycb_library",
        options=_add_ycb_options,
    )


def _add_burg_options(burg: Parser) -> None:
    burg.add_argument(
        "file", metavar="FILE", help="object_library.yaml of BURG-Toolkit, version 1.0"
    )
    burg.add_argument(
        "--skip",
        metavar="NAME",
        action="append",
        default=[],
        help="leave out this object; repeatable",
    )
    _add_import_options(burg, " (default: such objects stay fixed, as background)")


def _add_ycb_options(ycb: Parser) -> None:
    ycb.add_argument("folder", metavar="DIR", help="folder with the downloaded objects")
    _add_import_options(ycb)


def _add_import_options(parser: Parser, without: str = "") -> None:
    _add_output(parser)
    _add_named_values(parser)
    _add_density(parser, without)
    _add_effort(parser)


def _add_views(group: Any) -> None:
    listing = add_verb(
        group,
        "list",
        run_list,
        "list the objects of a library",
        "burg-drake library list household",
        "burg-drake library list my_library",
    )
    check = add_verb(
        group,
        "check",
        run_check,
        "look for mistakes in a library",
        "burg-drake library check my_library",
    )
    show = add_verb(
        group,
        "show",
        run_show,
        "show objects in 3D: pieces, contact surfaces, stable poses",
        "burg-drake library show household",
        "burg-drake library show my_library --only mug,bowl",
        "burg-drake library show my_library --html gallery.html --sheet sheet.html",
    )
    for verb in (listing, check, show):
        verb.add_argument(
            "library", metavar="LIBRARY", help="folder of a library, or the built-in household"
        )
    show.add_argument(
        "--only",
        metavar="A,B",
        type=names,
        action="extend",
        help="only these objects",
    )
    show.add_argument(
        "--sheet",
        metavar="FILE",
        help="also write a page with a picture and key figures of each object",
    )
    add_view(show)


def _add_output(parser: Parser) -> None:
    parser.add_argument(
        "-o", "--output", metavar="DIR", required=True, help="folder of the library"
    )
    parser.add_argument("--name", help="name of the library (default: that of its folder)")


def _add_named_values(parser: Parser) -> None:
    from burg_drake.objects.library import DEFAULT_FRICTION

    parser.add_argument(
        "--mass",
        metavar="NAME=KG",
        type=named_positive,
        action="append",
        default=[],
        help="mass of an object in kg; repeatable",
    )
    parser.add_argument(
        "--masses",
        metavar="FILE",
        type=input_file,
        help="YAML file of 'NAME: KG' lines, '-' for standard input; --mass wins",
    )
    parser.add_argument(
        "--friction",
        metavar="[NAME=]MU",
        type=friction,
        action="append",
        default=[],
        help=f"friction coefficient of one object or of all (default: {DEFAULT_FRICTION:g})",
    )


def _add_density(parser: Parser, without: str = "") -> None:
    parser.add_argument(
        "--density",
        metavar="KG/M3",
        type=positive,
        help=f"density of objects without a mass{without}",
    )


def _add_common_values(parser: Parser) -> None:
    from burg_drake.objects.library import CONTACT_KINDS
    from burg_drake.objects.meshes import UNITS, Openings

    _add_density(parser)
    scale = parser.add_mutually_exclusive_group()
    scale.add_argument(
        "--unit",
        metavar="[NAME=]UNIT",
        type=unit,
        action="append",
        default=[],
        help=f"unit of one mesh or of all: {', '.join(UNITS)} (default: m)",
    )
    scale.add_argument(
        "--scale", type=positive, help="factor from the meshes' unit to metres, such as 0.0005"
    )
    parser.add_argument(
        "--wall-thickness",
        metavar="M",
        type=positive,
        help=("treat surfaces as walls of this thickness in metres"),
    )
    parser.add_argument(
        "--openings",
        choices=get_args(Openings),
        help="large openings in a mesh: make the surface a wall (default), or close them",
    )
    parser.add_argument(
        "--contact",
        choices=CONTACT_KINDS,
        help="collision geometry (default: chosen by the shape)",
    )
    _add_effort(parser)


def _add_effort(parser: Parser) -> None:
    parser.add_argument(
        "--no-confirm", action="store_true", help="skip the simulation that confirms stable poses"
    )
    add_workers(parser)
    add_quiet(parser)
