"""Meshes, masses, friction and units of objects, from options of `burg-drake library` and files."""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from burg_drake.core import DocumentError, InvalidInputError, UnknownNameError, suggest_names

if TYPE_CHECKING:
    import yaml

    from burg_drake.pipeline import ObjectSource

_T = TypeVar("_T")


def mesh_sources(arguments: argparse.Namespace) -> tuple[list[ObjectSource], str | None]:
    """What the arguments of `library build` ask for, and the library's name if a recipe has one."""
    from burg_drake.pipeline import ObjectSource, load_recipe

    sources: list[ObjectSource] = []
    name: str | None = None
    for argument in arguments.meshes:
        if Path(argument).suffix.lower() in (".yaml", ".yml"):
            recipe = load_recipe(argument)
            name = recipe.name or name
            sources += recipe.sources()
        else:
            sources += [ObjectSource.from_file(mesh) for mesh in _mesh_files([argument])]
    sources = _with_unique_names(sources)
    values = named_values(arguments, {source.name for source in sources})
    changed = with_common_values(sources, arguments)
    return [_with_values(source, values, arguments.density) for source in changed], name


def _with_unique_names(sources: Sequence[ObjectSource]) -> list[ObjectSource]:
    """Sources of which those that share a name also go by their file's suffix."""
    from burg_drake.pipeline import object_name

    shared = {name for name, count in Counter(s.name for s in sources).items() if count > 1}
    return [
        replace(s, name=object_name(f"{s.name}_{Path(str(s.mesh)).suffix}"))
        if s.name in shared
        else s
        for s in sources
    ]


def with_common_values(
    sources: Sequence[ObjectSource], arguments: argparse.Namespace
) -> list[ObjectSource]:
    """Sources with what the arguments say of all objects."""
    from burg_drake.objects import unit_scale

    units = _values_by_name([u for u in arguments.unit if u[0]], {s.name for s in sources}, "unit")
    common = next((unit for name, unit in reversed(arguments.unit) if not name), None)
    values = {
        "scale": unit_scale(common) if common else arguments.scale,
        "wall_thickness": arguments.wall_thickness,
        "openings": arguments.openings,
        "contact": arguments.contact,
    }
    given = {name: value for name, value in values.items() if value is not None}
    changed = [replace(source, **given) for source in sources]
    return [
        replace(source, scale=unit_scale(units[source.name])) if source.name in units else source
        for source in changed
    ]


@dataclass(frozen=True)
class NamedValues:
    """What the arguments say of single objects.

    Attributes:
        masses: by object name [kg].
        frictions: by object name.
        common_friction: of all others, if given.
    """

    masses: dict[str, float]
    frictions: dict[str, float]
    common_friction: float | None


def named_values(arguments: argparse.Namespace, names: set[str]) -> NamedValues:
    """Masses and friction that the arguments give.

    Args:
        arguments: with `mass`, `masses` and `friction`.
        names: of all objects.

    Raises:
        UnknownNameError: a value for another object.
        DocumentError: the file of masses cannot be used.
    """
    masses = {} if arguments.masses is None else _read_masses(Path(arguments.masses), names)
    masses.update(_values_by_name(arguments.mass, names, "mass"))
    frictions = _values_by_name([f for f in arguments.friction if f[0]], names, "friction")
    common = next((mu for name, mu in reversed(arguments.friction) if not name), None)
    return NamedValues(masses, frictions, common)


def with_frictions(sources: Sequence[ObjectSource], values: NamedValues) -> list[ObjectSource]:
    """Sources with the friction that is given for them by name."""
    return [
        replace(source, friction=values.frictions.get(source.name, source.friction))
        for source in sources
    ]


def _with_values(source: ObjectSource, values: NamedValues, density: float | None) -> ObjectSource:
    """A source with what the arguments say of it; a mass goes before any density."""
    mass = values.masses.get(source.name, source.mass)
    common = source.friction if values.common_friction is None else values.common_friction
    return replace(
        source,
        mass=mass,
        density=source.density if density is None or mass is not None else density,
        friction=values.frictions.get(source.name, common),
    )


def _mesh_files(arguments: Iterable[str]) -> list[Path]:
    """Files as they are given; of folders all meshes in them."""
    from burg_drake.objects import MESH_FORMATS

    files: list[Path] = []
    for argument in arguments:
        path = Path(argument)
        if not path.is_dir():
            files.append(path)
            continue
        found = sorted(p for p in path.iterdir() if p.suffix.lower() in MESH_FORMATS)
        if not found:
            raise InvalidInputError(f"folder {path} holds no mesh ({', '.join(MESH_FORMATS)})")
        files += found
    return files


def _values_by_name(pairs: Iterable[tuple[str, _T]], names: set[str], what: str) -> dict[str, _T]:
    """Values by object name; the name of the mesh file's stem is as good."""
    from burg_drake.pipeline import object_name

    values: dict[str, _T] = {}
    for given, value in pairs:
        name = object_name(given)
        if name not in names:
            raise UnknownNameError(f"--{what} {given}: no such mesh; {suggest_names(name, names)}")
        values[name] = value
    return values


def _read_masses(path: Path, names: set[str]) -> dict[str, float]:
    """Masses [kg] by object name, of a YAML file with a line `NAME: KG` for each object."""
    import yaml

    from burg_drake.core import parse_yaml_node, read_text
    from burg_drake.pipeline import object_name

    expected = "expected lines 'NAME: KG', such as 'mug: 0.118'"
    node = parse_yaml_node(read_text(path), str(path), expected)
    if not isinstance(node, yaml.MappingNode):
        raise DocumentError(f"{path}:{node.start_mark.line + 1}: {expected}")
    masses: dict[str, float] = {}
    for key, value in node.value:
        where = f"{path}:{key.start_mark.line + 1}"
        if not isinstance(key, yaml.ScalarNode):
            raise DocumentError(f"{where}: expected a line 'NAME: KG', such as 'mug: 0.118'")
        name = object_name(key.value)
        if name not in names:
            raise DocumentError(f"{where}: {key.value}: no such mesh; {suggest_names(name, names)}")
        if name in masses:
            raise DocumentError(f"{where}: {key.value}: its mass is given twice")
        masses[name] = _read_mass(value, f"{where}: {key.value}")
    return masses


def _read_mass(node: yaml.Node, where: str) -> float:
    text = node.value if isinstance(node.value, str) else "a structure"
    try:
        mass = float(text)
    except ValueError:
        mass = math.nan
    if not 0.0 < mass < math.inf:
        raise DocumentError(f"{where}: mass is {text or 'missing'}; give kilograms above 0")
    return mass
