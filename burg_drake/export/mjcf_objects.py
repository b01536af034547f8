"""Objects and boxes as bodies of an MJCF model, with their meshes, materials and textures."""

from __future__ import annotations

import io
import shutil
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from burg_drake.core import Array, atomic_write, quaternion_from_rotation
from burg_drake.export.layout import PlacedObject
from burg_drake.export.object_parts import (
    VisualPart,
    collision_meshes,
    surface_hulls,
    visual_parts,
)
from burg_drake.objects import ObjectEntry, ObjectLibrary


def add_body(world: Element, name: str, X_WB: Array) -> Element:
    """Adds a body at a pose (4, 4)."""
    return SubElement(world, "body", {"name": name, **pose_attributes(X_WB)})


def add_object(world: Element, name: str, placed: PlacedObject, *, free: bool) -> Element:
    """Adds the body of an object, without geoms.

    Args:
        world: element to add the body to.
        name: name of body and joint.
        placed: the object.
        free: whether it can move.
    """
    body = add_body(world, name, placed.X_WO)
    if free:
        properties = placed.entry.mass_properties
        SubElement(body, "freejoint", {"name": name})
        inertial = inertia_attributes(
            properties.mass, properties.center_of_mass, properties.inertia
        )
        SubElement(body, "inertial", inertial)
    return body


def collision_shapes(placed: PlacedObject, assets: MjcfAssets) -> list[dict[str, str]]:
    """Attributes of an object's collision geoms: its primitive, or its pieces."""
    entry = placed.entry
    primitive = entry.contact.primitive
    if entry.contact.kind == "primitive" and primitive is not None:
        if primitive.shape == "box":
            shape = box_attributes(primitive.size)
        else:
            shape = round_shape_attributes(primitive.shape, primitive.size)
        return [{**shape, **pose_attributes(primitive.X_OP.matrix())}]
    pieces = assets.pieces(placed.object, entry)
    return [{"type": "mesh", "mesh": mesh} for mesh in pieces]


class MjcfAssets:
    """Writes the mesh files of objects and declares them as assets, each object once.

    Names of assets are unique: `OBJECT:visual_0`, `OBJECT:piece_000`.
    """

    def __init__(self, asset: Element, library: ObjectLibrary, folder: Path | None) -> None:
        """
        Args:
            asset: element that the assets are declared in.
            library: library with the objects.
            folder: folder of the MJCF file; if None, as for grasp trials, nothing is written, there
                are no visuals, and pieces follow the surface of objects whose surface touches.
        """
        self._asset = asset
        self._library = library
        self._folder = folder
        self._visuals: dict[str, list[str]] = {}
        self._pieces: dict[str, list[str]] = {}

    def visuals(self, name: str, entry: ObjectEntry) -> list[str]:
        """Names of an object's visual meshes; their materials have the same names."""
        if name not in self._visuals:
            parts = visual_parts(self._library, entry)
            self._visuals[name] = [self._add_visual(name, i, part) for i, part in enumerate(parts)]
        return self._visuals[name]

    def pieces(self, name: str, entry: ObjectEntry) -> list[str]:
        """Names of the meshes of an object's convex pieces."""
        if name not in self._pieces:
            touches = entry.contact.kind in ("surface", "mesh") and bool(entry.pieces)
            sources: list[dict[str, str]]
            if self._folder is None and touches:
                hulls = surface_hulls(self._library, name)
                sources = [{"vertex": format_numbers(hull)} for hull in hulls]
            else:
                files = collision_meshes(entry)
                sources = [{"file": self._piece_file(name, i, f)} for i, f in enumerate(files)]
            self._pieces[name] = [f"{name}:piece_{i:03d}" for i in range(len(sources))]
            for mesh, source in zip(self._pieces[name], sources, strict=True):
                SubElement(self._asset, "mesh", {"name": mesh, **source, "inertia": "convex"})
        return self._pieces[name]

    def _add_visual(self, name: str, i: int, part: VisualPart) -> str:
        assert self._folder is not None
        mesh, file = f"{name}:visual_{i}", f"objects/{name}/visual_{i}.obj"
        atomic_write(self._folder / file, obj_text(part))
        # Visual meshes may be open, so that only their surface is used, not their volume.
        SubElement(self._asset, "mesh", {"name": mesh, "file": file, "inertia": "shell"})
        appearance = {"rgba": " ".join(f"{v:g}" for v in part.rgba)}
        if part.image is not None:
            texture = f"objects/{name}/visual_{i}.png"
            data = io.BytesIO()
            part.image.convert("RGB").save(data, format="PNG")
            atomic_write(self._folder / texture, data.getvalue())
            SubElement(self._asset, "texture", {"name": mesh, "type": "2d", "file": texture})
            appearance = {"texture": mesh}
        SubElement(self._asset, "material", {"name": mesh, "specular": "0.1", **appearance})
        return mesh

    def _piece_file(self, name: str, i: int, piece: str) -> str:
        """File of a piece as the model names it; copied to the folder, if there is one."""
        if self._folder is None:
            return str(self._library.path(piece).resolve())
        file = f"objects/{name}/pieces/{i:03d}.obj"
        target = self._folder / file
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(self._library.path(piece), target)
        return file


def obj_text(part: VisualPart) -> str:
    """A part as OBJ, with normals, and with texture coordinates if it has them."""
    rows = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in part.vertices]
    rows += [f"vn {x:.5g} {y:.5g} {z:.5g}" for x, y, z in part.normals]
    if part.uv is not None:
        rows += [f"vt {u:.7g} {v:.7g}" for u, v in part.uv]
    corner = "{0}//{0}" if part.uv is None else "{0}/{0}/{0}"
    rows += ["f " + " ".join(corner.format(n) for n in face) for face in np.asarray(part.faces) + 1]
    return "\n".join(rows) + "\n"


def format_numbers(values: object) -> str:
    """Numbers as an attribute."""
    return " ".join(repr(v) for v in np.ravel(np.asarray(values, dtype=float)).tolist())


def pose_attributes(X_AB: Array) -> dict[str, str]:
    """Attributes of a pose (4, 4)."""
    quaternion = quaternion_from_rotation(X_AB[:3, :3])
    return {"pos": format_numbers(X_AB[:3, 3]), "quat": format_numbers(quaternion)}


def inertia_attributes(mass: float, p_BCm: object, moments: object) -> dict[str, str]:
    """Attributes of an `inertial`: mass [kg], centre of mass [m], and xx, yy, zz, xy, xz, yz of the
    inertia about it [kg m^2]."""
    return {
        "pos": format_numbers(p_BCm),
        "mass": repr(mass),
        "fullinertia": format_numbers(moments),
    }


def box_attributes(size: object) -> dict[str, str]:
    """Attributes of a box by its extents [m]."""
    return {"type": "box", "size": format_numbers(np.asarray(size, dtype=float) / 2)}


def round_shape_attributes(kind: str, size: tuple[float, ...]) -> dict[str, str]:
    """Attributes of a `sphere` by its radius, of a `cylinder` by radius and length [m]."""
    half = (size[0], size[1] / 2) if kind == "cylinder" else size
    return {"type": kind, "size": format_numbers(half)}
