"""The choice of what of an object touches others in simulation.

Measured by `benchmarks/contact.py` on the same grasps (eight household objects; CPU time against
that of the rigid pieces; verdicts against a rigid mesh of full resolution at `reference`):

* a primitive, where one fits, costs the same (a cylinder 0.85, a box 1.04, a sphere 1.26 times)
  with the same verdicts, and is exact where objects meet objects: a marble stays on a box;
* compliant pieces cost 1.3 times as much and get a few marginal verdicts more wrong;
* a rigid mesh of some 2000 faces costs 1.6 times as much for no better verdicts, and two rigid
  objects meet by point contact of their convex hulls, so that a mug is solid to a marble;
* a compliant mesh of tetrahedra of the mug took 48 s to make and 12 times as long to simulate.

Gripper pads, though, feel the pieces' seams and bulges, which are none of the object's. Hence by
itself an object is a primitive where one fits; otherwise pads meet its closed, decimated surface,
and all else its pieces. Where it has no such surface, pads meet the pieces as well, and the entry
says why.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import trimesh

from burg_drake.core import MeshError
from burg_drake.objects.collision.contact_surface import contact_surface, excess
from burg_drake.objects.collision.fit import surface_distance, union_mesh
from burg_drake.objects.collision.primitive import fit_primitive, nearest_primitive
from burg_drake.objects.library import (
    ContactGeometry,
    ContactKind,
    Fit,
    ObjectLibrary,
    write_piece,
)
from burg_drake.objects.meshes import decimated

CONTACT_FILE = "contact.obj"
"""The mesh of kinds `surface` and `mesh`, in the object's folder."""

MESH_FACES = 2000
"""Faces of the mesh of kind `mesh`, where so few stay within `solids.DECIMATION`."""


MEND = "make the mesh watertight and smooth it"
"""What gives most objects a surface that pads can touch."""


def contact_geometry(
    kind: ContactKind | None,
    surface: trimesh.Trimesh,
    closed: bool,
    pieces: Sequence[trimesh.Trimesh],
    folder: Path,
) -> tuple[ContactGeometry, tuple[str, ...]]:
    """What of an object touches others.

    Args:
        kind: as the user wants it; None: a primitive where one fits, else the surface where it is
            closed and can be decimated, else the pieces.
        surface: of the object [m].
        closed: whether it is watertight, so that its volume can be trusted.
        pieces: its convex pieces, at least one for a surface.
        folder: the object's; the mesh of kinds `surface` and `mesh` is written into it.

    Returns:
        The contact geometry, whose mesh is relative to `folder`, and the files written.

    Raises:
        MeshError: the object is not near any primitive, not closed, or cannot be decimated, and
            `kind` needs it.
    """
    if kind == "mesh":
        return _mesh(surface, closed, folder), (CONTACT_FILE,)
    if kind == "surface":
        try:
            return _surface(surface, closed, pieces, folder), (CONTACT_FILE,)
        except MeshError as error:
            raise MeshError(f"contact 'surface': {error}; {MEND}, or choose 'pieces'") from error
    if kind in ("pieces", "compliant_pieces"):
        return ContactGeometry(kind=kind), ()
    volume = float(surface.volume) if closed else float(union_mesh(pieces).volume)
    found = fit_primitive(surface, volume)
    if found is not None:
        primitive, fit = found
        return ContactGeometry(kind="primitive", primitive=primitive, fit=fit), ()
    if kind == "primitive":
        raise MeshError(_refusal(surface, volume))
    try:
        return _surface(surface, closed, pieces, folder), (CONTACT_FILE,)
    except MeshError as error:
        return ContactGeometry(reason=str(error)), ()


def pieces_instead(contact: ContactGeometry, pieces: int) -> str:
    """What to say where pads touch pieces that were not asked for; empty elsewhere.

    Args:
        contact: of the object.
        pieces: how many it has.
    """
    if not contact.reason:
        return ""
    return (
        f"finger pads touch {_pieces(pieces)}, because {contact.reason}; {MEND}, or"
        " accept that by 'contact: pieces' in an objects.yaml"
    )


def touched_by_pads(library: ObjectLibrary, name: str) -> str:
    """What of an object gripper pads touch, such as `a cylinder, at most 0.2 mm from the mesh`.

    Raises:
        UnknownNameError: no such object, or the file of its surface is missing.
        MeshError: that file is damaged.
    """
    entry = library.entry(name)
    contact = entry.contact
    if contact.primitive is not None:
        what = f"a {contact.primitive.shape}"
    elif contact.mesh:
        what = f"a surface with {len(library.mesh(contact.mesh).faces)} faces"
    else:
        return _pieces(len(entry.pieces))
    return (
        what
        if contact.fit is None
        else (f"{what}, at most {1e3 * contact.fit.hausdorff:.2g} mm from the mesh")
    )


def _pieces(count: int) -> str:
    return f"{count} convex piece{'' if count == 1 else 's'}"


def _surface(
    surface: trimesh.Trimesh, closed: bool, pieces: Sequence[trimesh.Trimesh], folder: Path
) -> ContactGeometry:
    mesh, fit = contact_surface(surface, closed)
    write_piece(mesh, folder / CONTACT_FILE)
    return ContactGeometry(kind="surface", mesh=CONTACT_FILE, fit=fit, excess=excess(mesh, pieces))


def _mesh(surface: trimesh.Trimesh, closed: bool, folder: Path) -> ContactGeometry:
    if not closed:
        raise MeshError(
            "contact 'mesh' needs a closed surface; repair the mesh, or choose 'pieces'"
        )
    mesh, _ = decimated(surface, MESH_FACES)
    write_piece(mesh, folder / CONTACT_FILE)
    fit = Fit(
        volume_ratio=float(mesh.volume / surface.volume), hausdorff=surface_distance(surface, mesh)
    )
    return ContactGeometry(kind="mesh", mesh=CONTACT_FILE, fit=fit)


def _refusal(surface: trimesh.Trimesh, volume: float) -> str:
    nearest = nearest_primitive(surface, volume)
    text = "contact 'primitive': no box, cylinder or sphere comes close to its volume"
    if nearest is not None:
        primitive, fit = nearest
        text = (
            f"contact 'primitive': the nearest, a {primitive.shape}, is"
            f" {1e3 * fit.hausdorff:.1f} mm off"
        )
    return f"{text}; choose 'pieces', or leave contact out"
