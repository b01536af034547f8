"""An object's own SDF, with its meshes beside it: what SDFormat worlds and directives are made of.

It is the library's model as it is, so that Drake simulates an export with the contact geometry and
the hydroelastic properties that trials have. Only friction moves, to where all readers of SDFormat
look for it; Drake takes it from there, too.
"""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from burg_drake.core import DocumentError, InvalidInputError, UnknownNameError
from burg_drake.core.files import DOCUMENT, read_bytes
from burg_drake.core.paths import Packages, resolve
from burg_drake.export.mesh_copy import MeshCopies
from burg_drake.objects.library import ObjectEntry, ObjectLibrary

DRAKE = "http://drake.mit.edu"
SAME_MASS = 1e-6
"""Share by which masses may differ."""
SDF_VERSION = "1.9"
"""Of Gazebo Garden and later; the first that has poses with quaternions."""


def object_model(
    library: ObjectLibrary, name: str, entry: ObjectEntry, folder: Path, packages: Packages
) -> Element:
    """The model of an object, self-contained.

    Args:
        library: has the object.
        name: of the object.
        entry: of the object.
        folder: gets copies of its meshes.
        packages: where packages that it names are looked for.

    Returns:
        The element `model`, whose URIs are relative to `folder`.

    Raises:
        InvalidInputError: the SDF includes other models or has another mass than the library says;
            or a mesh names files elsewhere.
        UnknownNameError: a file is missing.
    """
    path = library.path(entry.sdf)
    model = _read(path).find("model")
    if model is None or next(model.iter("include"), None) is not None:
        what = "has no model" if model is None else "includes other models"
        raise InvalidInputError(f"{path} {what}, and cannot be exported; write one whole model")
    _require_mass(model, entry, path)
    copies = MeshCopies(folder)
    for uri in model.iter("uri"):
        uri.text = copies.add(_file((uri.text or "").strip(), path, packages))
    for collision in model.iter("collision"):
        _share_friction(collision)
    model.set("name", name)
    return model


def sdf_document(*children: Element) -> str:
    """The text of an SDF file."""
    ElementTree.register_namespace("drake", DRAKE)
    root = Element("sdf", {"version": SDF_VERSION})
    root.extend(children)
    ElementTree.indent(root)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def add_friction(collision: Element, static: str, dynamic: str) -> None:
    """Gives a collision element Coulomb coefficients that Gazebo and Drake know."""
    surface = SubElement(collision, "surface")
    ode = SubElement(SubElement(surface, "friction"), "ode")
    SubElement(ode, "mu").text, SubElement(ode, "mu2").text = static, dynamic


def _file(uri: str, model: Path, packages: Packages) -> Path:
    """The file that a model names."""
    try:
        return resolve(uri, base=model.parent, packages=packages)
    except UnknownNameError as error:
        raise UnknownNameError(f"{model}: {error}; build the library again") from error


def _require_mass(model: Element, entry: ObjectEntry, path: Path) -> None:
    """Refuses a model that weighs something else than the library says, as Drake would have it."""
    text = (model.findtext("link/inertial/mass") or "nan").strip()
    try:
        mass = float(text)
    except ValueError:
        mass = math.nan
    if not math.isclose(mass, entry.mass, rel_tol=SAME_MASS):
        raise InvalidInputError(
            f"{path} has a mass of {text} kg, but library.yaml says {entry.mass:g} kg;"
            " build the library again"
        )


def _share_friction(collision: Element) -> None:
    """Moves friction from Drake's properties to those of SDFormat, unless it has its own there."""
    properties = collision.find(f"{{{DRAKE}}}proximity_properties")
    if properties is None or collision.find("surface") is not None:
        return
    found = [properties.find(f"{{{DRAKE}}}mu_{kind}") for kind in ("static", "dynamic")]
    texts = [str(e.text).strip() for e in found if e is not None]
    if texts:
        for element in found:
            if element is not None:
                properties.remove(element)
        add_friction(collision, texts[0], texts[-1])


def _read(path: Path) -> Element:
    try:
        return ElementTree.fromstring(read_bytes(path, DOCUMENT.size))
    except ElementTree.ParseError as error:
        raise DocumentError(f"{path} is not an SDF: {error}; build the library again") from error
