"""What the ways to represent an object in contact cost, and how right they are, on the same grasps.

    python benchmarks/contact.py [LIBRARY] [--objects NAME ...] [--trials N] [--tets NAME ...]

Each object rests alone on the table, in the most probable pose in which the hand finds enough clear
grasps. The same grasps are executed with each representation of its contact geometry. The truth
is the object's surface in full resolution as a rigid mesh, stepped at `reference`. One row an
object and representation; then the totals, with the CPU time as ratio to that of the pieces.

`--tets` adds a compliant mesh of tetrahedra of the objects named, if pytetwild is installed
(MPL-2.0; not a dependency of burg_drake).
"""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import trimesh

import burg_drake as burg
from burg_drake.core import Array, MeshError, Outcome, Pose, make_pose, rng_from
from burg_drake.objects import (
    DEFAULT_CONTACT,
    ContactGeometry,
    ObjectLibrary,
    contact_geometry,
    load_library,
    model_sdf,
    write_piece,
)
from burg_drake.scene import Instance, Scene, SceneDocument
from burg_drake.simulation import TrialResult
from burg_drake.station import ENGINES

OBJECTS = ("box", "can", "marble", "mug", "bowl", "banana", "bottle", "screwdriver")
KINDS = ("truth", "surface", "pieces", "compliant_pieces", "mesh", "primitive", "tets")
CONE = np.deg2rad(60.0)
TET_EDGE = 0.02
"""Length of the tetrahedra's edges as a share of the object's diagonal."""


@dataclass
class Row:
    """One representation of one object.

    Attributes:
        geometries: collision geometries, and their faces or tetrahedra in files.
        clear: share of the grasps that the screen lets pass.
        seconds: CPU time of each executed trial.
        results: of each executed trial.
    """

    geometries: str
    clear: float = np.nan
    seconds: list[float] = field(default_factory=list)
    results: list[TrialResult] = field(default_factory=list)


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("library", nargs="?", default="household")
    parser.add_argument("--objects", nargs="+", help="of the library; by default those compared")
    parser.add_argument("--grasps", type=int, default=300, help="sampled for each object")
    parser.add_argument("--trials", type=int, default=12, help="executed for each representation")
    parser.add_argument("--tets", nargs="*", default=(), help="objects to cut into tetrahedra")
    arguments = parser.parse_args()
    library = load_library(arguments.library)
    names = arguments.objects or [n for n in OBJECTS if n in library.objects] or library.objects
    print(f"{'object':18} {'contact':16} {'of':>14} {'clear':>6} {'CPU s':>6} {'ratio':>5}"
          f" {'right':>6} {'lifted':>6} {'slip off by':>11}")  # fmt: skip
    table: dict[str, dict[str, Row]] = {}
    with tempfile.TemporaryDirectory() as scratch:
        for name in names:
            kinds = [k for k in KINDS if k != "tets" or name in arguments.tets]
            table[name] = compare(library, name, kinds, Path(scratch), arguments)
            for kind, row in table[name].items():
                print_row(name, kind, row, table[name])
    for kind in KINDS[1:]:
        print_total(kind, [rows for rows in table.values() if kind in rows])


def compare(
    library: ObjectLibrary,
    name: str,
    kinds: list[str],
    scratch: Path,
    arguments: argparse.Namespace,
) -> dict[str, Row]:
    """All representations of one object."""
    rows: dict[str, Row] = {}
    scenes: dict[str, Scene] = {}
    for kind in kinds:
        made = represented(library, name, kind, scratch / f"{name}_{kind}")
        if made is not None:
            scenes[kind], rows[kind] = Scene(placed(library, name, 0), *made[:2]), Row(made[2])
    X_OG = np.zeros((0, 4, 4))
    for pose in range(len(library.entry(name).stable_poses)):
        document = placed(library, name, pose)
        scenes = {k: dataclasses.replace(s, document=document) for k, s in scenes.items()}
        sampled = grasps_of(library, name, pose, arguments.grasps)
        clear = clear_grasps(scenes["pieces"], name, sampled)
        if clear.sum() > len(X_OG):
            X_OG, best, everything = sampled[clear], document, sampled
        if len(X_OG) >= arguments.trials:
            break
    if not len(X_OG):
        print(f"{name}: no clear grasp")
        return {}
    trials = {}
    for kind, row in rows.items():
        scene = dataclasses.replace(scenes[kind], document=best)
        row.clear = float(clear_grasps(scene, name, everything).mean())
        engine = ENGINES["reference" if kind == "truth" else "standard"]
        trials[kind] = burg.HandTrial(scene, burg.load_station("panda_tabletop"), engine=engine)
    for X in X_OG[: arguments.trials]:  # in turn, so that a busy machine slows all of them
        for kind, trial in trials.items():
            start = time.process_time()
            result = trial.run(name, X)
            rows[kind].seconds.append(time.process_time() - start)
            rows[kind].results.append(result)
    return rows


def represented(
    library: ObjectLibrary, name: str, kind: str, folder: Path
) -> tuple[ObjectLibrary, Path, str] | None:
    """A library of the object alone with this representation; None where it has none."""
    entry, home = library.entry(name), folder / name
    surface = library.surface(name)
    (home / "pieces").mkdir(parents=True)
    for path in (entry.mesh, *entry.pieces):
        (folder / path).write_bytes(library.path(path).read_bytes())
    count = f"{len(entry.pieces)} pieces"
    contact = ContactGeometry(kind="mesh", mesh="contact.obj")
    if kind == "truth":
        write_piece(surface, home / "contact.obj")
        count = f"{len(surface.faces)} faces"
    elif kind == "tets":
        tets = tetrahedra(surface, home / "contact.vtk")
        if not tets:
            return None
        contact, count = dataclasses.replace(contact, mesh="contact.vtk"), f"{tets} tets"
    else:
        pieces = [trimesh.load_mesh(library.path(p), process=False) for p in entry.pieces]
        try:
            contact, written = contact_geometry(kind, surface, surface.is_watertight, pieces, home)
        except MeshError:
            return None
        if contact.primitive is not None:
            count = contact.primitive.shape
        if written:
            faces = (home / written[0]).read_text().count("\nf ")
            count = f"{faces} faces"
    names = [Path(p).relative_to(name).as_posix() for p in entry.pieces]
    text = model_sdf(name, entry.mass_properties, entry.friction, "mesh.obj", names, contact)
    if kind == "tets":
        soft = f"<drake:hydroelastic_modulus>{DEFAULT_CONTACT.modulus}</drake:hydroelastic_modulus>"
        text = text.replace("<drake:rigid_h", f"{soft}<drake:compliant_h")
    (folder / entry.sdf).write_text(text)
    if contact.mesh:
        contact = dataclasses.replace(contact, mesh=f"{name}/{contact.mesh}")
    objects = {name: dataclasses.replace(entry, contact=contact)}
    document = dataclasses.replace(library.document, objects=objects)
    return ObjectLibrary(document, folder), folder / "scene.yaml", count


def tetrahedra(surface, path: Path) -> int:  # type: ignore[no-untyped-def]
    """Writes tetrahedra that fill a surface (.vtk); returns their number, 0 without pytetwild."""
    try:
        import pytetwild
    except ImportError as error:
        print(f"no tetrahedra: {error}")
        return 0
    start = time.process_time()
    points, tets = pytetwild.tetrahedralize(
        np.asarray(surface.vertices), np.asarray(surface.faces), edge_length_fac=TET_EDGE
    )[:2]
    corners = points[tets]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1])
    tets[volume < 0.0] = tets[volume < 0.0][:, [0, 1, 3, 2]]
    print(f"{len(tets)} tetrahedra in {time.process_time() - start:.1f} s CPU")
    lines = ["# vtk DataFile Version 3.0", "tetrahedra", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    lines += [f"POINTS {len(points)} double", *(" ".join(map(repr, p)) for p in points.tolist())]
    lines += [f"CELLS {len(tets)} {5 * len(tets)}"]
    lines += ["4 " + " ".join(map(str, t)) for t in tets.tolist()]
    lines += [f"CELL_TYPES {len(tets)}", *("10" for _ in tets)]
    path.write_text("\n".join(lines) + "\n")
    return len(tets)


def placed(library: ObjectLibrary, name: str, pose: int) -> SceneDocument:
    """The object in the middle of the board, in a stable pose."""
    X_SO = make_pose(p_AB=(0.3, 0.2, 0.0)) @ library.entry(name).X_SO(pose)
    instance = Instance(object=name, X_SO=Pose.from_matrix(X_SO, quaternion=True))
    return SceneDocument(name="contact", library="", instances=(instance,))


def grasps_of(library: ObjectLibrary, name: str, pose: int, count: int) -> Array:
    """Antipodal grasps (N, 4, 4) from above."""
    entry = library.entry(name)
    down = tuple((-entry.X_SO(pose)[2, :3]).tolist())
    return burg.grasps.sample_antipodal(
        library.surface(name),
        count,
        rng_from("contact", name, pose),
        burg.grasps.AntipodalSettings(
            friction=entry.friction, approach_cones=(burg.grasps.ApproachCone(down, CONE),)
        ),
    ).X_OG


def clear_grasps(scene: Scene, name: str, X_OG: Array) -> Array:
    """(N,) whether the open hand is clear."""
    trial = burg.HandTrial(scene, burg.load_station("panda_tabletop"))
    X_WO = trial.diagram.X_WO(name)
    return np.array([trial.clearance.check(name, X_WO @ X).outcome is None for X in X_OG], bool)


def print_row(name: str, kind: str, row: Row, rows: dict[str, Row]) -> None:
    """One representation of one object."""
    print(
        f"{name:18} {kind:16} {row.geometries:>14} {row.clear:6.1%} {np.median(row.seconds):6.3f}"
        f" {np.median(row.seconds) / np.median(rows['pieces'].seconds):5.2f}"
        f" {sum(agreements(row, rows['truth'])):3}/{len(row.results):<2}"
        f" {sum(lifted(row)):3}/{len(row.results):<2} {slip_error(row, rows['truth']):8.2f} mm",
        flush=True,
    )


def print_total(kind: str, tables: list[dict[str, Row]]) -> None:
    """A representation over all objects that have it."""
    if not tables:
        return
    ratios = [np.median(t[kind].seconds) / np.median(t["pieces"].seconds) for t in tables]
    right = [a for t in tables for a in agreements(t[kind], t["truth"])]
    pieces = [a for t in tables for a in agreements(t["pieces"], t["truth"])]
    errors = [slip_error(t[kind], t["truth"]) for t in tables]
    print(
        f"{kind}: {len(tables)} objects, {np.exp(np.mean(np.log(ratios))):.2f} times the CPU time"
        f" of the pieces, {np.mean(right):.1%} of {len(right)} verdicts right (pieces there:"
        f" {np.mean(pieces):.1%}), slip off by {np.nanmedian(errors):.2f} mm"
    )


def lifted(row: Row) -> list[bool]:
    """Verdicts."""
    return [r.outcome is Outcome.LIFTED for r in row.results]


def agreements(row: Row, truth: Row) -> list[bool]:
    """Whether each verdict is that of the truth."""
    return [a == b for a, b in zip(lifted(row), lifted(truth), strict=True)]


def slip_error(row: Row, truth: Row) -> float:
    """Median difference in slip of what both lift [mm]."""
    pairs = zip(row.results, truth.results, strict=True)
    both = [
        abs(a.margins.slip - b.margins.slip)
        for a, b in pairs
        if a.outcome is Outcome.LIFTED and b.outcome is Outcome.LIFTED
    ]
    return float(np.median(both) * 1e3) if both else np.nan


if __name__ == "__main__":
    main()
