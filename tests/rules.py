"""Rules of a package that is built of rooms; each gives what breaks it, in words."""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator

from tests.imports import Import, Package

MOST_PARAMETERS = 9
"""Of a function; what takes more takes a settings object."""
CAMEL_CASE = re.compile(r"[A-Z][a-z]\w*")
VARIABLES = ("TypeVar(", "ParamSpec(", "TypeVarTuple(")
EXTRAS = {
    "pandas": (),
    "pyarrow": (),
    "h5py": (),
    "mujoco": ("simulation.batch",),
    "mujoco_warp": ("simulation.batch",),
    "warp": ("simulation.batch",),
    "distributed": ("evaluation.cluster",),
    "pxr": ("export",),
    "viser": ("ui",),
    "websockets": ("ui",),
    "msgpack": (),
    "msgspec": ("ui",),
}
"""Packages that need not be there, and where modules may import them at their top."""


def unplaced(house: Package, rooms: list[str]) -> list[str]:
    """Packages directly in the house that are not in the list of rooms, and rooms without one."""
    found = {_room(house, package) for package in house.packages if package != house.name}
    return sorted(found ^ set(rooms))


def upward(house: Package, rooms: list[str]) -> list[str]:
    """Imports from a room that comes later in the list."""
    return [
        str(step)
        for module, sources in house.graph.items()
        for source, step in sources.items()
        if (a := _room(house, module)) in rooms
        and (b := _room(house, source)) in rooms
        and rooms.index(b) > rooms.index(a)
    ]


def beside_faces(house: Package, imports: Iterable[Import] | None = None) -> list[str]:
    """Imports from a module of another room, or of a name that the room's face does not show.

    Modules may be imported as a whole, for tests that replace something in them.
    """
    found = []
    for step in house.imports if imports is None else imports:
        room = f"{house.name}.{_room(house, step.source)}"
        if room not in house.packages or f"{step.module}.".startswith(f"{room}."):
            continue
        shown = step.source == room and step.name in house.faces[room]
        whole = f"{step.source}.{step.name}".rstrip(".") in house.files
        if not shown and (imports is None or not whole):
            found.append(str(step))
    return found


def wrong_faces(house: Package) -> list[str]:
    """Names of faces that are not where the stub says, or that a module of the package has, too."""
    found = []
    for package, names in house.faces.items():
        for name, (source, there) in names.items():
            if source != package and there not in _bound(house, source):
                found.append(f"{package} shows {name}, which {source} does not have")
            if source != package and f"{package}.{name}" in house.modules:
                found.append(f"{package} shows {name}, which is the name of a module")
    return found


def unasked(house: Package, outside: Iterable[Import] = ()) -> list[str]:
    """Names of faces that nothing outside of the room imports; public names are for users."""
    top = house.faces[house.name]
    public = {house.name, *(f"{house.name}.{n}" for n, (at, _) in top.items() if at == house.name)}
    taken = {
        (x.source, x.name)
        for x in (*house.imports, *outside)
        if not x.module.startswith(f"{x.source}.")
    }
    taken |= {place for names in house.faces.values() for place in names.values()}
    return [
        f"{package} shows {name}, which nobody imports"
        for package, names in house.faces.items()
        for name in names
        if (package, name) not in taken
        and not (package in public and name in _listed(house.trees[package], name))
    ]


def defined_twice(house: Package) -> list[str]:
    """Names of classes and types that are defined in several places. Private ones may be, and so
    may type variables, which stand for nothing of their own."""
    places = defaultdict(list)
    variables = set()
    for module, tree in house.trees.items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                places[node.name].append(module)
            elif (alias := _alias(node)) is not None:
                name, value = alias
                places[name].append(module)
                if value.startswith(VARIABLES):
                    variables.add((name, module))
    return [
        f"{name}: {', '.join(where)}"
        for name, where in places.items()
        if len(where) > 1
        and not name.startswith("_")
        and not all((name, module) in variables for module in where)
    ]


def many_parameters(house: Package) -> list[str]:
    """Functions with too many parameters, `self` and `cls` aside; not kernels, which get all
    arrays one by one."""
    found = []
    for module, tree in house.trees.items():
        for node in ast.walk(tree):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                listed = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
                count = len(listed) - (listed[:1] != [] and listed[0].arg in ("self", "cls"))
                kernel = any("kernel" in ast.unparse(one) for one in node.decorator_list)
                if count > MOST_PARAMETERS and not kernel:
                    found.append(f"{module}:{node.lineno} {node.name} has {count} parameters")
    return found


def eager(house: Package) -> list[str]:
    """Faces that import something, and optional packages at the top of modules elsewhere."""
    found = []
    for module in house.files:
        for package in sorted({name.partition(".")[0] for name in _at_top(house, module)}):
            if module in house.packages:
                if package not in ("lazy_loader", "__future__"):
                    found.append(f"the face {module} imports {package}")
                continue
            inside = tuple(f"{house.name}.{place}." for place in EXTRAS.get(package, ()))
            if package in EXTRAS and not module.startswith(inside):
                found.append(f"{module} imports {package} at its top")
    return found


def imports_drake(house: Package, rooms: list[str]) -> list[str]:
    """Modules of these rooms that import pydrake, be it within functions."""
    inside = tuple(f"{house.name}.{room}." for room in rooms)
    return [
        f"{module}:{node.lineno} imports pydrake"
        for module in house.modules
        if module.startswith(inside)
        for node in house.statements[module]
        if any(name.partition(".")[0] == "pydrake" for name in _names(node))
    ]


def loaded_with(house: Package, start: str) -> set[str]:
    """Packages from elsewhere that are loaded with a module."""
    seen, waiting, found = set(), [start], set()
    while waiting:
        module = waiting.pop()
        if module in seen or module not in house.files:
            continue
        seen.add(module)
        for name in _at_top(house, module):
            if not f"{name}.".startswith(f"{house.name}."):
                found.add(name.partition(".")[0])
        for node in _top_nodes(house.trees[module].body):
            if isinstance(node, ast.ImportFrom):
                waiting += [house.home(str(node.module), alias.name) for alias in node.names]
            else:
                waiting += [alias.name for alias in node.names]
    return found - sys.stdlib_module_names


def _room(house: Package, module: str) -> str:
    """The room that a module lies in; of a module directly in the house, its name."""
    return module[len(house.name) + 1 :].partition(".")[0]


def _listed(tree: ast.Module, name: str) -> list[str]:
    """`__all__` of a public face; where it has no such list, all names are public."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return [ast.literal_eval(element) for element in node.value.elts]
    return [name]


def _bound(house: Package, module: str) -> set[str]:
    """Names at the top of a module; those of its face, of a package."""
    found = set(house.faces.get(module, ()))
    for node in house.trees[module].body if module in house.trees else ():
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            found.add(node.name)
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            found |= {x.id for x in ast.walk(node) if isinstance(x, ast.Name)}
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            found |= {alias.asname or alias.name for alias in node.names}
    return found


def _alias(node: ast.stmt) -> tuple[str, str] | None:
    """Name and text of what names a type. Names of types are in CamelCase, `Rgb`, `Rgb8`."""
    if type(node).__name__ == "TypeAlias":
        return node.name.id, ast.unparse(node.value)
    if isinstance(node, ast.Assign):
        target, declared = node.targets[0], False
    elif isinstance(node, ast.AnnAssign) and node.value is not None:
        target, declared = node.target, ast.unparse(node.annotation).endswith("TypeAlias")
        if not declared:
            return None
    else:
        return None
    if not isinstance(target, ast.Name) or not (declared or CAMEL_CASE.fullmatch(target.id)):
        return None
    return target.id, ast.unparse(node.value)


def _names(node: ast.AST) -> list[str]:
    if isinstance(node, ast.ImportFrom):
        return [str(node.module)]
    return [alias.name for alias in node.names] if isinstance(node, ast.Import) else []


def _at_top(house: Package, module: str) -> list[str]:
    """What a module imports when it is loaded."""
    return [name for node in _top_nodes(house.trees[module].body) for name in _names(node)]


def _top_nodes(body: list[ast.stmt]) -> Iterator[ast.Import | ast.ImportFrom]:
    for node in body:
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            yield node
        elif isinstance(node, ast.Try):
            yield from _top_nodes(node.body)
        elif isinstance(node, ast.If) and "TYPE_CHECKING" not in ast.unparse(node.test):
            yield from _top_nodes(node.body + node.orelse)
