"""The recipe of a library, `objects.yaml`: meshes, and the properties that meshes do not have."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal, cast

import yaml

from burg_drake.core import (
    InvalidInputError,
    Ranges,
    Reader,
    Rgba,
    Vector3,
    load_yaml_node,
    require_name,
)
from burg_drake.objects import UNITS, ContactKind, Decomposition, Inertia, Openings
from burg_drake.pipeline.object_source import (
    OBJECT_NAME_PATTERN,
    ObjectSource,
    check_numbers,
    object_name,
)

Unit = Literal["mm", "cm", "m", "in"]


@dataclass(frozen=True, kw_only=True)
class Cutting:
    """Parameters of the convex decomposition; each has its default if left out.

    Attributes:
        threshold: concavity at which CoACD stops cutting, for an object scaled to unit size.
        join: volume that joining two pieces may add, as a share of the volume of all pieces.
        max_vertices: largest number of vertices of a piece.
        tolerance: distance within which a piece follows its full convex hull, if `max_vertices`
            allows it [m].
        min_thickness: thinner pieces are dropped [m].
        timeout: CPU time for CoACD [s].
        seed: seed of CoACD's search.
    """

    RANGES: ClassVar[Ranges] = Decomposition.RANGES

    threshold: float | None = None
    join: float | None = None
    max_vertices: int | None = None
    tolerance: float | None = None
    min_thickness: float | None = None
    timeout: float | None = None
    seed: int | None = None

    def __post_init__(self) -> None:
        self.parameters()  # checks the ranges

    def parameters(self) -> Decomposition:
        """The parameters, with defaults for those left out."""
        return Decomposition(**_set_fields(self))


@dataclass(frozen=True, kw_only=True)
class Defaults:
    """Values for all objects that have none of their own.

    Attributes:
        unit: unit of the mesh file.
        scale: factor from the mesh file's unit to metres, in place of `unit`.
        density: density of the material, for objects without `mass` [kg/m^3].
        friction: friction coefficient between the object and the gripper's pads.
        wall_thickness: thickness of the wall of a hollow object, or of an open surface [m].
        openings: what to do with a surface that is not closed: make it a wall, or close it.
        contact: what touches other things in simulation: the surface, convex pieces, or a
            primitive.
        decomposition: parameters of the convex decomposition.
        rgba: colour in place of the mesh file's: red, green, blue and opacity, 0 to 1 each.
    """

    unit: Unit | None = None
    scale: float | None = None
    density: float | None = None
    friction: float | None = None
    wall_thickness: float | None = None
    openings: Openings | None = None
    contact: ContactKind | None = None
    decomposition: Cutting | None = None
    rgba: Rgba | None = None

    def __post_init__(self) -> None:
        if self.unit is not None and self.scale is not None:
            raise InvalidInputError("give unit or scale, not both")
        check_numbers(self)


@dataclass(frozen=True, kw_only=True)
class RecipeObject(Defaults):
    """One object of the library.

    Attributes:
        mesh: mesh file, relative to this file.
        pieces: files of convex pieces, in the frame and unit of the mesh, relative to this file;
            made by convex decomposition if empty.
        mass: mass [kg].
        center_of_mass: centre of mass in the object's frame [m], in place of the computed one.
        inertia: Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of mass, in the axes of the object's
            frame [kg m^2], in place of the computed ones.
        description: text for people.
    """

    mesh: str
    pieces: tuple[str, ...] = ()
    mass: float | None = None
    center_of_mass: Vector3 | None = None
    inertia: Inertia | None = None
    description: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.mesh:
            raise InvalidInputError("mesh is empty; give a mesh file")
        if self.mass is not None and self.density is not None:
            raise InvalidInputError("give mass or density, not both")
        if self.inertia is not None and min(self.inertia[:3]) <= 0.0:
            raise InvalidInputError(
                f"inertia is {list(self.inertia)}; its moments Ixx, Iyy and Izz must be above 0"
            )


@dataclass(frozen=True, kw_only=True)
class RecipeDocument:
    """What to build an object library of, and what the meshes do not tell (`objects.yaml`).

    Attributes:
        name: name of the library; that of its folder if left out.
        defaults: values for all objects that have none of their own.
        objects: the objects by name. Names have a-z, 0-9 and `_`.
    """

    version: int = 1
    name: str | None = None
    defaults: Defaults = field(default_factory=Defaults)
    objects: dict[str, RecipeObject] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.name is not None:
            require_name(self.name, "name")
        if not self.objects:
            raise InvalidInputError("objects is empty; add lines such as 'mug: {mesh: mug.obj}'")


@dataclass(frozen=True)
class Recipe:
    """A recipe on disk.

    Attributes:
        document: contents of the file.
        root: folder that its paths start from.
    """

    document: RecipeDocument
    root: Path

    @property
    def name(self) -> str | None:
        """The library's name, if the recipe gives one."""
        return self.document.name

    def sources(self) -> list[ObjectSource]:
        """Object sources in the document's order."""
        defaults = self.document.defaults
        return [
            _make_source(name, _with_defaults(item, defaults), self.root)
            for name, item in self.document.objects.items()
        ]


def load_recipe(path: str | Path) -> Recipe:
    """Reads a recipe.

    Raises:
        DocumentError: it cannot be read, or a key or value does not fit; the message names file,
            line and key.
    """
    path = Path(path)
    node = load_yaml_node(path)
    reader = _RecipeReader(str(path))
    if isinstance(node, yaml.MappingNode):
        reader.check_version(node, RecipeDocument)
    return Recipe(cast(RecipeDocument, reader.read(node, RecipeDocument, "")), path.parent)


class _RecipeReader(Reader):
    """Document reader that also checks the names of the objects."""

    def read_dict(self, node: yaml.Node, kind: Any, where: str) -> dict[str, Any]:
        for name, (key, _) in self.read_entries(node, where).items():
            if not OBJECT_NAME_PATTERN.fullmatch(name):
                raise self.error_at(key, where, _invalid_name_message(name))
        return super().read_dict(node, kind, where)


def _invalid_name_message(name: str) -> str:
    try:
        hint = f", such as {object_name(name)!r}"
    except InvalidInputError:
        hint = ""
    return f"{name!r} is not a valid object name; use a-z, 0-9 and underscores{hint}"


def _set_fields(values: Any) -> dict[str, Any]:
    """The fields of a dataclass that are not None."""
    pairs = ((f.name, getattr(values, f.name)) for f in dataclasses.fields(values))
    return {name: value for name, value in pairs if value is not None}


def _with_defaults(item: RecipeObject, defaults: Defaults) -> RecipeObject:
    """The object, with defaults for the fields that it leaves out."""
    own = _set_fields(item)
    missing = {name: value for name, value in _set_fields(defaults).items() if name not in own}
    if "mass" in own:
        missing.pop("density", None)
    if "unit" in own or "scale" in own:
        missing.pop("unit", None)
        missing.pop("scale", None)
    if item.decomposition is not None and defaults.decomposition is not None:
        both = _set_fields(defaults.decomposition) | _set_fields(item.decomposition)
        missing["decomposition"] = Cutting(**both)
    return dataclasses.replace(item, **missing)


def _make_source(name: str, item: RecipeObject, root: Path) -> ObjectSource:
    fields = _set_fields(item)
    scale = UNITS[fields.pop("unit", "m")]
    fields |= {
        "mesh": root / item.mesh,
        "scale": fields.get("scale", scale),
        "pieces": tuple(root / file for file in item.pieces) or None,
        "decomposition": (item.decomposition or Cutting()).parameters(),
    }
    return ObjectSource(name=name, **fields)
