"""Writes a scene as an SDFormat world, or as Drake's model directives.

Objects keep the model of the library, so that Drake simulates an export with the contact geometry
and the hydroelastic properties of grasp trials. Only friction moves, to the element where all
readers of SDFormat, Drake among them, look for it.
"""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from burg_drake.core import (
    Array,
    DocumentError,
    FileLimits,
    InvalidInputError,
    Packages,
    UnknownNameError,
    atomic_write,
    quaternion_from_rotation,
    read_bytes,
    resolve_reference,
)
from burg_drake.export.layout import Layout, legal_model_name, model_names, renaming_notes
from burg_drake.objects import LINK_NAME, ObjectEntry, ObjectLibrary, package_manifest, package_name
from burg_drake.station import FixedBox, SurroundingsProperties


def write_sdf(layout: Layout, folder: Path) -> tuple[str, ...]:
    """Writes `world.sdf` and the meshes that it names by relative paths.

    Args:
        layout: scene and station to write.
        folder: empty folder.

    Returns:
        Differences from the scene, one sentence each.

    Raises:
        InvalidInputError, UnknownNameError: see `object_sdf_model`; or a place cannot be written
            to.
    """
    names = model_names(layout)
    world = Element("world", {"name": legal_model_name(layout.name)})
    models = {}
    for name, entry in layout.entries.items():
        home = folder / "objects" / name
        models[name] = object_sdf_model(layout.library, name, entry, home, layout.packages)
    for placed in layout.objects:
        model = deepcopy(models[placed.object])
        model.set("name", names[placed.name])
        for uri in model.iter("uri"):
            uri.text = f"objects/{placed.object}/{uri.text}"
        world.append(_set_model_pose(model, placed.X_WO, placed.fixed))
    for name, box in layout.boxes.items():
        world.append(_set_model_pose(box_sdf_model(names[name], box), box.X_WB, fixed=True))
    atomic_write(folder / "world.sdf", sdf_document(world))
    return renaming_notes(names)


def _set_model_pose(model: Element, X_WB: Array, fixed: bool) -> Element:
    """Places the link of a model in the world."""
    for old in (*model.findall("pose"), *model.findall("static")):
        model.remove(old)
    model.set("placement_frame", LINK_NAME)
    x, y, z = X_WB[:3, 3].tolist()
    qw, qx, qy, qz = quaternion_from_rotation(X_WB[:3, :3]).tolist()
    pose = Element("pose", {"rotation_format": "quat_xyzw"})
    pose.text = " ".join(map(repr, (x, y, z, qx, qy, qz, qw)))
    model.insert(0, pose)
    if fixed:
        SubElement(model, "static").text = "true"
    return model


def write_directives(layout: Layout, folder: Path) -> tuple[str, ...]:
    """Writes `scene.dmd.yaml`, a `package.xml`, and the models that the directives add.

    Args:
        layout: scene and station to write.
        folder: empty folder.

    Returns:
        Differences from the scene, one sentence each.

    Raises:
        InvalidInputError, UnknownNameError: see `object_sdf_model`; or a place cannot be written
            to.
    """
    package = f"{package_name(layout.name)}_scene"  # a library may have the same name
    for name, entry in layout.entries.items():
        home = folder / "objects" / name
        model = object_sdf_model(layout.library, name, entry, home, layout.packages)
        atomic_write(home / f"{name}.sdf", sdf_document(model))
    names = model_names(layout)
    directives: list[dict[str, Any]] = []
    for placed in layout.objects:
        file = f"objects/{placed.object}/{placed.object}.sdf"
        add = _model_directive(names[placed.name], f"package://{package}/{file}")
        if placed.fixed:
            directives += [add, _weld_directive(names[placed.name], placed.X_WO)]
        else:
            free = {"base_frame": "world", **_pose_mapping(placed.X_WO)}
            add["add_model"]["default_free_body_pose"] = {LINK_NAME: free}
            directives.append(add)
    for name, box in layout.boxes.items():
        text = sdf_document(box_sdf_model(names[name], box))
        atomic_write(folder / "station" / f"{name}.sdf", text)
        file = f"package://{package}/station/{name}.sdf"
        directives += [_model_directive(names[name], file), _weld_directive(names[name], box.X_WB)]
    atomic_write(folder / "package.xml", package_manifest(package, "Scene"))
    document = {"directives": directives}
    text = yaml.dump(document, Dumper=_DirectivesDumper, sort_keys=False, default_flow_style=None)
    atomic_write(folder / "scene.dmd.yaml", text)
    return renaming_notes(names)


class _AngleAxis(dict[str, Any]):
    """A rotation in Drake's schema, exact for any rotation."""


class _DirectivesDumper(yaml.SafeDumper):
    """YAML dumper that writes rotations with their tag, and repeats values instead of using
    anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _represent_angle_axis(dumper: _DirectivesDumper, value: _AngleAxis) -> yaml.Node:
    return dumper.represent_mapping("!AngleAxis", value.items(), flow_style=True)


_DirectivesDumper.add_representer(_AngleAxis, _represent_angle_axis)


def _model_directive(name: str, file: str) -> dict[str, Any]:
    return {"add_model": {"name": name, "file": file}}


def _weld_directive(name: str, X_WB: Array) -> dict[str, Any]:
    weld = {"parent": "world", "child": f"{name}::{LINK_NAME}", "X_PC": _pose_mapping(X_WB)}
    return {"add_weld": weld}


def _pose_mapping(X_WB: Array) -> dict[str, Any]:
    """A pose in Drake's schema, which does not support quaternions."""
    turn = Rotation.from_matrix(X_WB[:3, :3]).as_rotvec()
    angle = float(np.linalg.norm(turn))
    axis = (turn / angle if angle else np.array([0.0, 0.0, 1.0])).tolist()
    rotation = _AngleAxis(angle_deg=float(np.rad2deg(angle)), axis=axis)
    return {"translation": X_WB[:3, 3].tolist(), "rotation": rotation}


DRAKE_NAMESPACE = "http://drake.mit.edu"  # XML namespace of Drake's SDFormat extensions.


def object_sdf_model(
    library: ObjectLibrary, name: str, entry: ObjectEntry, folder: Path, packages: Packages
) -> Element:
    """Makes the self-contained model of an object.

    Args:
        library: library of the object.
        name: name of the object.
        entry: library entry of the object.
        folder: folder for copies of its meshes.
        packages: packages that the model may name.

    Returns:
        The element `model`, whose URIs are relative to `folder`.

    Raises:
        InvalidInputError: the SDF includes other models or its mass differs from the library's; or
            a mesh names files outside its folder.
        UnknownNameError: a file is missing.
    """
    path = library.path(entry.sdf)
    model = _read_sdf(path).find("model")
    if model is None or next(model.iter("include"), None) is not None:
        what = "has no model" if model is None else "includes other models"
        raise InvalidInputError(f"{path} {what}, and cannot be exported; write one whole model")
    _require_mass(model, entry, path)
    copies = MeshCopies(folder)
    for uri in model.iter("uri"):
        uri.text = copies.add(_resolve_uri((uri.text or "").strip(), path, packages))
    for collision in model.iter("collision"):
        _move_friction(collision)
    model.set("name", name)
    return model


def sdf_document(*children: Element) -> str:
    """The text of an SDF file."""
    ElementTree.register_namespace("drake", DRAKE_NAMESPACE)
    # The first version with quaternions in poses; Gazebo Garden and later read it.
    root = Element("sdf", {"version": "1.9"})
    root.extend(children)
    ElementTree.indent(root)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def add_friction(collision: Element, static: str, dynamic: str) -> None:
    """Adds Coulomb friction coefficients for Gazebo and Drake to a collision element."""
    surface = SubElement(collision, "surface")
    ode = SubElement(SubElement(surface, "friction"), "ode")
    SubElement(ode, "mu").text, SubElement(ode, "mu2").text = static, dynamic


def _resolve_uri(uri: str, model: Path, packages: Packages) -> Path:
    """The file that a model names."""
    try:
        return resolve_reference(uri, base=model.parent, packages=packages)
    except UnknownNameError as error:
        raise UnknownNameError(f"{model}: {error}; build the library again") from error


def _require_mass(model: Element, entry: ObjectEntry, path: Path) -> None:
    """Refuses a model whose mass, as in Drake, differs from the library's."""
    text = (model.findtext("link/inertial/mass") or "nan").strip()
    try:
        mass = float(text)
    except ValueError:
        mass = math.nan
    if not math.isclose(mass, entry.mass, rel_tol=1e-6):
        raise InvalidInputError(
            f"{path} has a mass of {text} kg, but library.yaml says {entry.mass:g} kg;"
            " build the library again"
        )


def _move_friction(collision: Element) -> None:
    """Moves friction from Drake's properties to SDFormat's, unless these have friction already."""
    properties = collision.find(f"{{{DRAKE_NAMESPACE}}}proximity_properties")
    if properties is None or collision.find("surface") is not None:
        return
    tags = [f"{{{DRAKE_NAMESPACE}}}mu_{kind}" for kind in ("static", "dynamic")]
    found = [element for tag in tags if (element := properties.find(tag)) is not None]
    if found:
        for element in found:
            properties.remove(element)
        texts = [str(element.text).strip() for element in found]
        add_friction(collision, texts[0], texts[-1])


def _read_sdf(path: Path) -> Element:
    try:
        return ElementTree.fromstring(read_bytes(path, FileLimits.document.size))
    except ElementTree.ParseError as error:
        raise DocumentError(f"{path} is not an SDF: {error}; build the library again") from error


def box_sdf_model(name: str, box: FixedBox) -> Element:
    """The element `model` of a box, the same as `station.surroundings` adds in Drake.

    Args:
        name: name of the model.
        box: the box; its pose is not used, as the caller places the model.
    """
    model = Element("model", {"name": name})
    link = SubElement(model, "link", {"name": LINK_NAME})
    collision = SubElement(link, "collision", {"name": "collision"})
    _add_size(collision, box)
    add_friction(collision, repr(box.friction), repr(box.friction))
    properties = SubElement(collision, f"{{{DRAKE_NAMESPACE}}}proximity_properties")
    SubElement(properties, f"{{{DRAKE_NAMESPACE}}}compliant_hydroelastic")
    for key, value in (
        ("mesh_resolution_hint", max(box.size)),
        ("hydroelastic_modulus", SurroundingsProperties.hydroelastic_modulus),
        ("hunt_crossley_dissipation", SurroundingsProperties.dissipation),
    ):
        SubElement(properties, f"{{{DRAKE_NAMESPACE}}}{key}").text = repr(value)
    visual = SubElement(link, "visual", {"name": "visual"})
    _add_size(visual, box)
    material = SubElement(visual, "material")
    for key in ("ambient", "diffuse"):
        SubElement(material, key).text = " ".join(f"{v:g}" for v in np.array(box.color))
    return model


def _add_size(parent: Element, box: FixedBox) -> None:
    shape = SubElement(SubElement(parent, "geometry"), "box")
    SubElement(shape, "size").text = " ".join(repr(float(v)) for v in box.size)


_MATERIAL_LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t]+(.+?)[ \t\r]*$", re.MULTILINE)
"""Statement of an OBJ file that names its material library."""
_TEXTURE_FILE = re.compile(
    rb"^[ \t]*(?:map_\w+|bump|disp|decal|norm)[ \t]+(.+?)[ \t\r]*$", re.MULTILINE
)
"""Statement of an MTL file that names a texture."""

_GLTF_URI = re.compile(rb'"uri"[ \t\r\n]*:[ \t\r\n]*"([^"]*)"')
"""URI of a buffer or an image in glTF."""


class MeshCopies:
    """Copies of mesh files in one folder, with unique names."""

    def __init__(self, folder: Path) -> None:
        """
        Args:
            folder: folder for the copies; made for the first copy.
        """
        self.folder = folder
        self._copied: dict[Path, str] = {}

    def add(self, source: Path) -> str:
        """Copies a mesh and the files beside it that it names, unless they are there already.

        Args:
            source: obj, gltf, or a file that names no other files.

        Returns:
            Path of the copy, relative to the folder.

        Raises:
            InvalidInputError: the mesh names a file that is missing, or is not in its own folder.
        """
        source = source.resolve()
        if source not in self._copied:
            self._copied[source] = self._place(source)
        return self._copied[source]

    def _place(self, source: Path) -> str:
        """Copies to the folder itself, or to a subfolder if another mesh uses one of the names."""
        named = [source.name, *_referenced_files(source)]
        for name in named:
            if PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
                raise InvalidInputError(
                    f"{source} names {name}, which is not in its folder; export needs it there"
                )
            if not (source.parent / name).is_file():
                raise InvalidInputError(
                    f"{source} names {name}, which is missing; put it there, or build the library"
                    " again"
                )
        place, number = Path(), 1
        while any(self._differs(place / name, source.parent / name) for name in named):
            number += 1
            place = Path(f"{source.stem}_{number}")
        for name in named:
            target = self.folder / place / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source.parent / name, target)
        return (place / source.name).as_posix()

    def _differs(self, relative: Path, source: Path) -> bool:
        """Whether a different file of this name exists."""
        target = self.folder / relative
        return target.exists() and target.read_bytes() != source.read_bytes()


def _referenced_files(mesh: Path) -> Iterator[str]:
    """Files that a mesh file and its material files name, relative to the mesh file."""
    suffix = mesh.suffix.lower()
    if suffix == ".obj":
        for library in _find_names(_MATERIAL_LIBRARY, mesh):
            yield library
            if (mesh.parent / library).is_file():
                for texture in _find_names(_TEXTURE_FILE, mesh.parent / library):
                    yield texture.split()[-1] if texture.startswith("-") else texture
    elif suffix == ".gltf":
        for uri in _GLTF_URI.findall(read_bytes(mesh, FileLimits.image_bytes)):
            if not uri.startswith(b"data:"):
                yield unquote(uri.decode(errors="replace"))


def _find_names(pattern: re.Pattern[bytes], file: Path) -> list[str]:
    """Matches of a pattern in a file, without repetition."""
    found = pattern.findall(read_bytes(file, FileLimits.image_bytes))
    return list(dict.fromkeys(name.decode(errors="replace") for name in found))
