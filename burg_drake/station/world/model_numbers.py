"""Refuses numbers of a model's SDF or URDF with which no simulation makes sense.

Drake takes many of them on trust: with a mass of NaN every trial ends with NaN, for a negative one
it warns and takes a mass of its own, and others end the process. So the text is checked before
Drake reads it.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from pydrake.multibody.tree import RotationalInertia

from burg_drake.core import InvalidInputError, quoted
from burg_drake.core.files import DOCUMENT, read_bytes

FINITE = "finite"
NOT_ZERO = "finite and not 0"
NOT_NEGATIVE = "finite and at least 0"
POSITIVE = "finite and above 0"
LIMIT = "a number, or inf where there is no limit"
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
RULES = {
    **dict.fromkeys(("pose", "xyz", "rpy", "multiplier"), FINITE),
    **dict.fromkeys(MOMENTS, FINITE),
    **dict.fromkeys(("scale", "gear_ratio"), NOT_ZERO),
    **dict.fromkeys(("mass", "damping", "stiffness", "friction", "mu", "mu2"), NOT_NEGATIVE),
    **dict.fromkeys(("mu_static", "mu_dynamic", "hunt_crossley_dissipation"), NOT_NEGATIVE),
    **dict.fromkeys(("relaxation_time", "hydroelastic_margin", "rotor_inertia"), NOT_NEGATIVE),
    "acceleration": NOT_NEGATIVE,
    **dict.fromkeys(("hydroelastic_modulus", "mesh_resolution_hint", "density"), POSITIVE),
    **dict.fromkeys(("point_contact_stiffness", "size", "radius", "length", "radii"), POSITIVE),
    **dict.fromkeys(("lower", "upper", "effort", "velocity"), LIMIT),
}
"""What numbers have to be, by the name of their element (SDF) or attribute (URDF) without the
prefix `drake:`."""
URDF_RULES = RULES | dict.fromkeys(("effort", "velocity"), NOT_NEGATIVE)
"""In SDF negative ones stand for no limit."""
UNREAD = ("gazebo", "light", "plugin", "ros2_control", "sensor")
"""Elements that are for other programs."""
PLACES = ("link", "joint", "frame", "collision", "visual", "transmission")
"""Elements that a message names."""
MAX_DEPTH = 200
"""Nested elements; models have some ten, and Drake's parser refuses more than 500."""
_SOUND: set[tuple[Path, bytes]] = set()
"""Paths and hashes of models that were checked: stations are built again and again."""


@dataclass
class _Element:
    name: str
    attributes: dict[str, str]
    line: int
    children: list[_Element] = field(default_factory=list)
    text: str = ""

    def values(self) -> Iterator[tuple[str, str]]:
        """Names and texts; the attribute `value` goes by the name of the element."""
        if self.text.strip() and not self.children:
            yield self.name, self.text.strip()
        for key, text in self.attributes.items():
            yield self.name if key == "value" else key.removeprefix("drake:"), text

    def figures(self) -> dict[str, str]:
        """The values of the element and of those in it, by name."""
        return dict(value for element in (self, *self.children) for value in element.values())

    def walk(self, *outer: _Element) -> Iterator[tuple[_Element, tuple[_Element, ...]]]:
        """What is in the element, then the element, each with what it is in, outermost first."""
        for child in self.children:
            if child.name not in UNREAD:
                yield from child.walk(*outer, self)
        yield self, outer


def require_sound_numbers(path: Path) -> None:
    """Refuses a model with a mass, inertia, limit, contact parameter, size or pose that is not a
    number, or that no body has. What is not valid XML is left to Drake's own message.

    Args:
        path: SDF or URDF file.

    Raises:
        InvalidInputError: it cannot be read, or has such a number; the message names file, line,
            link or joint, and the value.
    """
    text = read_bytes(path, DOCUMENT.size)
    checked = (path, hashlib.sha256(text).digest())
    if checked not in _SOUND:
        _check(text, path)
        _SOUND.add(checked)


def _check(text: bytes, path: Path) -> None:
    root = _parsed(text, path)
    if root is None:
        return
    rules = URDF_RULES if root.name == "robot" else RULES
    massless = _massless_links(root)
    for element, outer in root.walk():
        named = [e for e in (*outer, element) if e.name in PLACES]
        try:
            for key, value in element.values():
                if key in rules:
                    _require(key, value, rules[key])
            if element.name == "axis":
                _require_direction(element.figures())
            if element.name == "limit":
                _require_order(element.figures())
            if element.name == "inertial" and named:
                _require_inertia(element, massless=named[-1].attributes.get("name") in massless)
        except ValueError as error:
            where = ", ".join(f"{e.name} {quoted(e.attributes.get('name', ''))}" for e in named)
            raise InvalidInputError(
                f"{path}:{element.line}: {where}{': ' if where else ''}{error}"
            ) from error


def _parsed(text: bytes, path: Path) -> _Element | None:
    """The root of a model; None if it is not XML.

    Raises:
        InvalidInputError: it is nested deeper than `MAX_DEPTH`.
    """
    parser = expat.ParserCreate()
    parser.buffer_text = True
    opened = [_Element("", {}, 0)]

    def start(name: str, attributes: dict[str, str]) -> None:
        if len(opened) > MAX_DEPTH:
            raise InvalidInputError(
                f"{path}:{parser.CurrentLineNumber}: more than {MAX_DEPTH} nested elements"
            )
        element = _Element(name.removeprefix("drake:"), attributes, parser.CurrentLineNumber)
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


def _massless_links(root: _Element) -> set[str]:
    """Names of links that need no mass, as they may be mere frames: those at fixed joints, and,
    where there are joints, those that are no joint's child, which the station welds."""
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


def _require(key: str, text: str, rule: str) -> None:
    for word in text.split():
        try:
            value = float(word)
        except ValueError:
            raise ValueError(f"{key} is {quoted(text)}; it must be {rule}") from None
        finite = math.isfinite(value)
        sound = {
            FINITE: finite,
            NOT_ZERO: finite and value != 0.0,
            NOT_NEGATIVE: finite and value >= 0.0,
            POSITIVE: finite and value > 0.0,
            LIMIT: not math.isnan(value),
        }
        if not sound[rule]:
            raise ValueError(f"{key} is {text}; it must be {rule}")


def _require_direction(axis: dict[str, str]) -> None:
    direction = axis.get("xyz", "1 0 0")
    if not any(map(float, direction.split())):
        raise ValueError(f"axis is {direction}; it must be a direction that is not zero")


def _require_order(limit: dict[str, str]) -> None:
    lower, upper = float(limit.get("lower", "-inf")), float(limit.get("upper", "inf"))
    if "upper" in limit and lower > upper:
        raise ValueError(f"lower is {lower:g}, which is above upper, {upper:g}; exchange them")


def _require_inertia(inertial: _Element, massless: bool) -> None:
    """Checks that a link has a mass, and moments of inertia that some distribution of it has.

    Args:
        inertial: of the link.
        massless: whether mass and moments may be 0.
    """
    if inertial.attributes.get("auto") == "true":  # of SDF: by density
        return
    figures = {k: v for e in inertial.children for k, v in e.figures().items()}
    mass = float(figures.get("mass", "1"))
    unstated = dict(zip(MOMENTS, (1.0, 1.0, 1.0, 0.0, 0.0, 0.0), strict=True))
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
