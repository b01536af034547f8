"""Meshes, masses, friction and units of objects, from options of `burg-drake library` and files."""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from burg_drake import core, pipeline

if TYPE_CHECKING:
    import yaml


_T = TypeVar("_T")


def mesh_sources(arguments: argparse.Namespace) -> tuple[list[pipeline.ObjectSource], str | None]:
    """The objects to build by the arguments of `library build`, and the name in a recipe, if
    any."""
    sources: list[pipeline.ObjectSource] = []
    name: str | None = None
    for argument in arguments.meshes:
        if Path(argument).suffix.lower() in (".yaml", ".yml"):
            recipe = pipeline.load_recipe(argument)
            name = recipe.name or name
            sources += recipe.sources()
        else:
            sources += [
                pipeline.ObjectSource.from_file(mesh) for mesh in _mesh_files(Path(argument))
            ]
    sources = _with_unique_names(sources)
    values = named_values(arguments, {source.name for source in sources})
    changed = with_common_values(sources, arguments)
    return [_with_values(source, values, arguments.density) for source in changed], name


def _with_unique_names(sources: Sequence[pipeline.ObjectSource]) -> list[pipeline.ObjectSource]:
    """Sources with unique names: equal names are extended by the suffix of the file."""
    shared = {name for name, count in Counter(s.name for s in sources).items() if count > 1}
    return [
        replace(s, name=pipeline.object_name(f"{s.name}_{Path(str(s.mesh)).suffix}"))
        if s.name in shared
        else s
        for s in sources
    ]


def with_common_values(
    sources: Sequence[pipeline.ObjectSource], arguments: argparse.Namespace
) -> list[pipeline.ObjectSource]:
    """Sources with the values that the arguments give for all objects."""
    from burg_drake.objects import unit_scale

    units = _values_by_name(arguments.unit, {s.name for s in sources}, "unit")
    common = dict(arguments.unit).get("")
    values = {
        "scale": unit_scale(common) if common else arguments.scale,
        "wall_thickness": arguments.wall_thickness,
        "openings": arguments.openings,
        "contact": arguments.contact,
    }
    given = {name: value for name, value in values.items() if value is not None}
    own = {name: {"scale": unit_scale(unit)} for name, unit in units.items()}
    return [replace(source, **given | own.get(source.name, {})) for source in sources]


@dataclass(frozen=True)
class NamedValues:
    """Values that the arguments give for single objects.

    Attributes:
        masses: masses by object name [kg].
        frictions: frictions by object name.
        common_friction: friction of all other objects; None if not given.
    """

    masses: dict[str, float]
    frictions: dict[str, float]
    common_friction: float | None


def named_values(arguments: argparse.Namespace, names: set[str]) -> NamedValues:
    """Masses and friction that the arguments give.

    Args:
        arguments: parsed arguments with `mass`, `masses` and `friction`.
        names: names of all objects.

    Raises:
        UnknownNameError: a value is for an unknown object.
        DocumentError: the file of masses is invalid.
    """
    masses = {} if arguments.masses is None else _read_masses(Path(arguments.masses), names)
    masses.update(_values_by_name(arguments.mass, names, "mass"))
    frictions = _values_by_name(arguments.friction, names, "friction")
    return NamedValues(masses, frictions, dict(arguments.friction).get(""))


def with_frictions(
    sources: Sequence[pipeline.ObjectSource], values: NamedValues
) -> list[pipeline.ObjectSource]:
    """Sources with the friction coefficients that are given by name."""
    return [
        replace(source, friction=values.frictions.get(source.name, source.friction))
        for source in sources
    ]


def _with_values(
    source: pipeline.ObjectSource, values: NamedValues, density: float | None
) -> pipeline.ObjectSource:
    """A source with the values from the arguments; a mass takes precedence over a density."""
    mass = values.masses.get(source.name, source.mass)
    common = source.friction if values.common_friction is None else values.common_friction
    return replace(
        source,
        mass=mass,
        density=source.density if density is None or mass is not None else density,
        friction=values.frictions.get(source.name, common),
    )


def _mesh_files(path: Path) -> list[Path]:
    """The file itself, or all meshes in a folder."""
    from burg_drake.objects import MESH_FORMATS

    if not path.is_dir():
        return [path]
    found = sorted(p for p in path.iterdir() if p.suffix.lower() in MESH_FORMATS)
    if not found:
        raise core.InvalidInputError(f"folder {path} holds no mesh ({', '.join(MESH_FORMATS)})")
    return found


def _values_by_name(pairs: Iterable[tuple[str, _T]], names: set[str], what: str) -> dict[str, _T]:
    """Values by object name, without the value for all objects, which has no name; the stem of the
    mesh file is accepted as a name."""
    values: dict[str, _T] = {}
    for given, value in pairs:
        if not given:
            continue
        name = pipeline.object_name(given)
        if name not in names:
            raise core.UnknownNameError(
                f"--{what} {given}: no such mesh; {core.suggest_names(name, names)}"
            )
        values[name] = value
    return values


def _read_masses(path: Path, names: set[str]) -> dict[str, float]:
    """Masses [kg] by object name, of a YAML file with a line `NAME: KG` for each object."""
    import yaml

    expected = "expected lines 'NAME: KG', such as 'mug: 0.118'"
    node = core.parse_yaml_node(core.read_text(path), str(path), expected)
    if not isinstance(node, yaml.MappingNode):
        raise core.DocumentError(f"{path}:{node.start_mark.line + 1}: {expected}")
    masses: dict[str, float] = {}
    for key, value in node.value:
        where = f"{path}:{key.start_mark.line + 1}"
        if not isinstance(key, yaml.ScalarNode):
            raise core.DocumentError(f"{where}: expected a line 'NAME: KG', such as 'mug: 0.118'")
        name = pipeline.object_name(key.value)
        if name not in names:
            raise core.DocumentError(
                f"{where}: {key.value}: no such mesh; {core.suggest_names(name, names)}"
            )
        if name in masses:
            raise core.DocumentError(f"{where}: {key.value}: its mass is given twice")
        masses[name] = _read_mass(value, f"{where}: {key.value}")
    return masses


def _read_mass(node: yaml.Node, where: str) -> float:
    text = node.value if isinstance(node.value, str) else "a structure"
    try:
        mass = float(text)
    except ValueError:
        mass = math.nan
    if not 0.0 < mass < math.inf:
        raise core.DocumentError(f"{where}: mass is {text or 'missing'}; give kilograms above 0")
    return mass
