"""SDF and URDF files of models: checked for invalid numbers, and added to a plant."""

from __future__ import annotations

import hashlib
import logging
import math
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from xml.parsers import expat

from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex, RotationalInertia

from burg_drake.core import (
    NO_PACKAGES,
    FileLimits,
    InvalidInputError,
    Packages,
    data_root,
    quote_value,
    read_bytes,
    referenced_files,
    referenced_packages,
)

INERTIA_NAMES = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
"""Moments and products of inertia."""
NUMBER_RULES: dict[str, tuple[Callable[[float], bool], tuple[str, ...]]] = {
    "finite": (math.isfinite, ("pose", "xyz", "rpy", "multiplier", *INERTIA_NAMES)),
    "finite and not 0": (
        lambda value: math.isfinite(value) and value != 0.0,
        ("scale", "gear_ratio"),
    ),
    "finite and at least 0": (
        lambda value: 0.0 <= value < math.inf,
        (
            *("mass", "damping", "stiffness", "friction", "mu", "mu2", "mu_static", "mu_dynamic"),
            *("hunt_crossley_dissipation", "relaxation_time", "hydroelastic_margin"),
            *("rotor_inertia", "acceleration"),
        ),
    ),
    "finite and above 0": (
        lambda value: 0.0 < value < math.inf,
        (
            *("hydroelastic_modulus", "mesh_resolution_hint", "density"),
            *("point_contact_stiffness", "size", "radius", "length", "radii"),
        ),
    ),
    "a number, or inf where there is no limit": (
        lambda value: not math.isnan(value),
        ("lower", "upper", "effort", "velocity"),
    ),
}
"""Checks of numbers, each with the elements and attributes (without `drake:`) that it applies to,
by rule."""
SDF_NUMBER_RULES = {name: rule for rule, (_, names) in NUMBER_RULES.items() for name in names}
URDF_NUMBER_RULES = SDF_NUMBER_RULES | dict.fromkeys(
    ("effort", "velocity"), "finite and at least 0"
)
"""In SDF, negative limits mean no limit."""
_CHECKED_MODELS: set[tuple[Path, bytes]] = set()
"""Paths and hashes of models that were checked."""


@dataclass
class _XmlElement:
    name: str
    attributes: dict[str, str]
    line: int
    children: list[_XmlElement] = field(default_factory=list)
    text: str = ""

    def values(self) -> Iterator[tuple[str, str]]:
        """Names and texts of the values; the attribute `value` has the element's name."""
        if self.text.strip() and not self.children:
            yield self.name, self.text.strip()
        for key, text in self.attributes.items():
            yield self.name if key == "value" else key.removeprefix("drake:"), text

    def figures(self) -> dict[str, str]:
        """Values of the element and its children, by name."""
        return dict(value for element in (self, *self.children) for value in element.values())

    def walk(self, *outer: _XmlElement) -> Iterator[tuple[_XmlElement, tuple[_XmlElement, ...]]]:
        """Yields all descendants, then the element, each with its ancestors, outermost first."""
        # Elements that other programs use.
        foreign_elements = ("gazebo", "light", "plugin", "ros2_control", "sensor")
        for child in self.children:
            if child.name not in foreign_elements:
                yield from child.walk(*outer, self)
        yield self, outer


def require_valid_numbers(path: Path) -> None:
    """Rejects a model with an invalid mass, inertia, limit, contact parameter, size or pose, or
    with a collision mesh in a format that cannot be used. Invalid XML is left to Drake's parser.

    Args:
        path: SDF or URDF file.

    Raises:
        InvalidInputError: it cannot be read, or has such a number; the message names file, line,
            link or joint, and the value.
    """
    text = read_bytes(path, FileLimits.document.size)
    checked = (path, hashlib.sha256(text).digest())
    if checked not in _CHECKED_MODELS:
        _check_numbers(text, path)
        _CHECKED_MODELS.add(checked)


def _check_numbers(text: bytes, path: Path) -> None:
    # Elements that a message names.
    named_elements = ("link", "joint", "frame", "collision", "visual", "transmission")
    root = _parse_model(text, path)
    if root is None:
        return
    rules = URDF_NUMBER_RULES if root.name == "robot" else SDF_NUMBER_RULES
    massless = _massless_links(root)
    for element, outer in root.walk():
        named = [e for e in (*outer, element) if e.name in named_elements]
        try:
            for key, value in element.values():
                if key in rules:
                    _require_rule(key, value, rules[key])
            if element.name == "mesh" and any(e.name == "collision" for e in outer):
                _require_collision_mesh(element)
            if element.name == "axis":
                _require_axis_direction(element.figures())
            if element.name == "limit":
                _require_ordered_limits(element.figures())
            if element.name == "inertial" and named:
                _require_link_inertia(
                    element, massless=named[-1].attributes.get("name") in massless
                )
        except ValueError as error:
            where = ", ".join(
                f"{e.name} {quote_value(e.attributes.get('name', ''))}" for e in named
            )
            raise InvalidInputError(
                f"{path}:{element.line}: {where}{': ' if where else ''}{error}"
            ) from error


def _parse_model(text: bytes, path: Path) -> _XmlElement | None:
    """The root of a model; None if it is not XML.

    Raises:
        InvalidInputError: it is nested deeper than 200 elements.
    """
    max_depth = 200  # Nested elements; Drake's parser refuses more than 500.
    parser = expat.ParserCreate()
    parser.buffer_text = True
    opened = [_XmlElement("", {}, 0)]

    def start(name: str, attributes: dict[str, str]) -> None:
        if len(opened) > max_depth:
            raise InvalidInputError(
                f"{path}:{parser.CurrentLineNumber}: more than {max_depth} nested elements"
            )
        element = _XmlElement(name.removeprefix("drake:"), attributes, parser.CurrentLineNumber)
        opened[-1].children.append(element)
        opened.append(element)

    def characters(text: str) -> None:
        opened[-1].text += text

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: opened.pop()
    parser.CharacterDataHandler = characters
    try:
        parser.Parse(text, True)
    except expat.ExpatError:
        return None
    return opened[0].children[0]


def _massless_links(root: _XmlElement) -> set[str]:
    """Names of links that need no mass, as they may be mere frames: links at fixed joints, and, in
    models with joints, root links, which the station welds."""
    links, fixed, children = set(), set(), set()
    for element, outer in root.walk():
        if element.name == "link":
            links.add(element.attributes.get("name", ""))
        elif element.name in ("parent", "child") and outer and outer[-1].name == "joint":
            link = element.attributes.get("link", element.text.strip())
            if outer[-1].attributes.get("type") == "fixed":
                fixed.add(link)
            if element.name == "child":
                children.add(link.rpartition("::")[2])
    return fixed | (links - children if children else set())


def _require_rule(key: str, text: str, rule: str) -> None:
    for word in text.split():
        try:
            value = float(word)
        except ValueError:
            raise ValueError(f"{key} is {quote_value(text)}; it must be {rule}") from None
        if not NUMBER_RULES[rule][0](value):
            raise ValueError(f"{key} is {text}; it must be {rule}")


def _require_collision_mesh(mesh: _XmlElement) -> None:
    """Requires a mesh format whose convex hull Drake can make."""
    uri = next((child.text.strip() for child in mesh.children if child.name == "uri"), "")
    file = mesh.attributes.get("filename", uri)
    suffix = Path(file).suffix
    if suffix and suffix.lower() not in (".obj", ".gltf", ".vtk"):
        raise ValueError(
            f"{quote_value(file)} cannot be used for collisions; convert the {suffix} mesh to .obj"
            " or .gltf, for example with Blender, and name the new file"
        )


def _require_axis_direction(axis: dict[str, str]) -> None:
    direction = axis.get("xyz", "1 0 0")
    if not any(map(float, direction.split())):
        raise ValueError(f"axis is {direction}; it must be a direction that is not zero")


def _require_ordered_limits(limit: dict[str, str]) -> None:
    lower, upper = float(limit.get("lower", "-inf")), float(limit.get("upper", "inf"))
    if "upper" in limit and lower > upper:
        raise ValueError(f"lower is {lower:g}, which is above upper, {upper:g}; exchange them")


def _require_link_inertia(inertial: _XmlElement, massless: bool) -> None:
    """Requires that a link has a mass, and physically valid moments of inertia.

    Args:
        inertial: the link's element.
        massless: whether mass and moments may be 0.
    """
    if inertial.attributes.get("auto") == "true":  # SDF: computed from density
        return
    figures = {k: v for e in inertial.children for k, v in e.figures().items()}
    mass = float(figures.get("mass", "1"))
    unstated = dict(zip(INERTIA_NAMES, (1.0, 1.0, 1.0, 0.0, 0.0, 0.0), strict=True))
    inertia = RotationalInertia(*(float(figures.get(k, moment)) for k, moment in unstated.items()))
    principal = inertia.CalcPrincipalMomentsOfInertia()
    if massless and mass == principal.max() == 0.0:
        return
    if mass == 0.0:
        raise ValueError(
            "mass is 0; it must be above 0 unless a fixed joint or the station holds the link"
        )
    if not inertia.CouldBePhysicallyValid() or principal.max() == 0.0:
        moments = ", ".join(f"{moment:g}" for moment in principal)
        raise ValueError(
            f"inertia has the principal moments {moments} kg m^2, which no body has: each"
            " must be above 0 and at most the sum of the other two"
        )


RELATIVE_URI = re.compile(r"<uri>\s*((?![A-Za-z]+:)[^<]*?)\s*</uri>")
"""URI that is a file path; relative paths start at the model's folder."""
HYDROELASTIC_TAG = re.compile(r"<drake:(?:rigid|compliant)_hydroelastic\s*/>")
"""Tag of hydroelastic contact."""
COLLISION_ELEMENT = re.compile(r"<collision\b.*?</collision>", re.DOTALL)
"""Element of a collision geometry."""


def add_models(
    parser: Parser,
    path: Path,
    packages: Packages = NO_PACKAGES,
    *,
    edit: Callable[[str], str] | None = None,
) -> list[ModelInstanceIndex]:
    """As `parser.AddModels(path)`, but faster, and with the packages that `core.paths` finds.

    Args:
        parser: afterwards it has the packages that this model names, replacing packages of the same
            names, and no models from the network.
        path: SDF or URDF file.
        packages: the station's package folders.
        edit: edits an SDF's text, such as `without_hydroelastic`.

    Raises:
        InvalidInputError: it cannot be read, is too large, or has an invalid mass, inertia or other
            number.
        UnknownNameError: it names a package that is not found.
        RuntimeError, ValueError: `AddModels` failed.
    """
    set_packages(parser, referenced_packages(path, packages))
    try:
        text = read_bytes(path, FileLimits.document.size).decode()
    except UnicodeDecodeError:
        text = ""
    require_valid_numbers(path)
    if "<include" in text:
        for file in referenced_files(path, packages):
            if file.suffix in (".sdf", ".urdf"):
                require_valid_numbers(file)
    if path.suffix != ".sdf" or not text or "<include" in text:
        return list(parser.AddModels(path))
    if edit is not None:
        text = edit(text)
    folder = Path(escape(str(path.parent.resolve()), quote=False))
    whole = RELATIVE_URI.sub(lambda found: f"<uri>file://{folder / found[1]}</uri>", text)
    try:
        return list(parser.AddModelsFromString(whole, "sdf"))
    except (RuntimeError, ValueError) as error:
        raise type(error)(str(error).replace("<literal-string>.sdf", str(path))) from error


def without_hydroelastic(text: str) -> str:
    """Removes hydroelastic contact from a model (SDF), for point queries: Drake then builds no
    meshes that it would copy into each context, and a collision checker is built in two thirds of
    the time.
    """
    return HYDROELASTIC_TAG.sub("", text)


def without_collisions(text: str) -> str:
    """Removes the collision geometries from a model (SDF)."""
    return COLLISION_ELEMENT.sub("", text)


def set_packages(parser: Parser, folders: Mapping[str, Path]) -> None:
    """Adds packages by their folders, and the installed data, to a parser. Removes Drake's own
    models, which it would fetch from the network."""
    known = parser.package_map()
    for name in {"drake_models", *folders}:
        if known.Contains(name):
            known.Remove(name)
    for name, folder in {**folders, "burg_drake": data_root()}.items():
        known.Add(name, folder)


def require_free_model(plant: MultibodyPlant, model: ModelInstanceIndex, path: Path) -> None:
    """Rejects a model with a joint to the world, as in URDFs with a link `world`.

    Args:
        plant: plant, not finalized.
        model: model from one file.
        path: the file.

    Raises:
        InvalidInputError: it has one; the message names joint and link.
    """
    for joint in map(plant.get_joint, plant.GetJointIndices(model)):
        if joint.parent_body().index() == plant.world_body().index():
            raise InvalidInputError(
                f"{path}: joint {joint.name()!r} fixes {joint.child_body().name()!r} to"
                " the world; remove it, as the station says where the robot stands"
            )


@contextmanager
def buffer_drake_log() -> Iterator[list[logging.LogRecord]]:
    """Buffers Drake's log records, such as warnings about a model.

    Yields:
        The growing list of records; forward them with `logging.getLogger("drake").handle`.
    """
    logger, buffered = logging.getLogger("drake"), list[logging.LogRecord]()

    def hold(record: logging.LogRecord) -> bool:
        buffered.append(record)
        return False

    logger.addFilter(hold)
    try:
        yield buffered
    finally:
        logger.removeFilter(hold)


def file_uri(path: Path) -> str:
    """The URI of a file for Drake, which does not decode `%20`."""
    return f"file://{path.resolve()}"
