"""Rules of a package that is built of rooms; each gives what breaks it, in words."""

from __future__ import annotations

import ast
import re
import sys
from collections import defaultdict
from collections.abc import Iterator

from tests.imports import Package

MOST_PARAMETERS = 9
"""Of a function; what takes more takes a settings object."""
CAMEL_CASE = re.compile(r"[A-Z][a-z]\w*")
VARIABLES = ("TypeVar(", "ParamSpec(", "TypeVarTuple(")
EXTRAS = {
    "pandas": (),
    "pyarrow": (),
    "h5py": (),
    "mujoco": (),
    "distributed": ("evaluation.cluster",),
    "pxr": ("export",),
    "viser": ("ui",),
    "websockets": ("ui",),
    "msgspec": ("ui",),
}
"""Packages that need not be there, and where modules may import them at their top."""


def orders(rooms: dict[str, str], within: dict[str, str]) -> dict[str, list[str]]:
    """By package, relative to the whole: its packages in their order."""
    found = {"": list(rooms)} | {room: subs.split() for room, subs in rooms.items()}
    return found | {package: subs.split() for package, subs in within.items()}


def unplaced(house: Package, order: dict[str, list[str]]) -> list[str]:
    """Packages that have no place in the order; an only one needs none."""
    found = []
    for package, names in _children(house).items():
        placed = order.get(package[len(house.name) + 1 :], [])
        if set(names) != set(placed) and (placed or len(names) > 1):
            found.append(f"{package}: {sorted(set(names) ^ set(placed))}")
    return found


def upward(house: Package, order: dict[str, list[str]]) -> list[str]:
    """Imports of what comes later. Modules that lie directly in a package either import nothing of
    its sub-packages, or are imported by none of them."""
    found = []
    for package in house.packages:
        placed = order.get(package[len(house.name) + 1 :]) or _children(house)[package]
        edges = [
            (_child(package, module), _child(package, source), step)
            for module, sources in house.graph.items()
            for source, step in sources.items()
            if module.startswith(f"{package}.") and source.startswith(f"{package}.")
        ]
        top = {a for a, b, _ in edges if a not in placed and b in placed}
        for a, b, step in edges:
            if (a in placed and b in top) or (
                {a, b} <= set(placed) and placed.index(b) > placed.index(a)
            ):
                found.append(str(step))
    return found


def beside_faces(house: Package) -> list[str]:
    """Imports that go past the face of a package that the importing module does not lie in."""
    found = []
    for step in house.imports:
        package = step.source if step.source in house.packages else step.source.rpartition(".")[0]
        if f"{step.module}.".startswith(f"{package}."):
            continue
        shown = step.name in house.faces[package] or f"{package}.{step.name}" in house.packages
        if package != step.source or not shown:
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


def unasked(house: Package) -> list[str]:
    """Names of faces that nothing outside of the package imports; public faces are for users."""
    top = house.faces[house.name]
    public = {house.name, *(f"{house.name}.{n}" for n, (at, _) in top.items() if at == house.name)}
    taken = {(x.source, x.name) for x in house.imports if not x.module.startswith(f"{x.source}.")}
    taken |= {place for names in house.faces.values() for place in names.values()}
    whole = {f"{x.source}.{x.name}" for x in house.imports}
    return [
        f"{package} shows {name}, which nobody imports"
        for package, names in house.faces.items()
        if package not in public | whole
        for name in names
        if (package, name) not in taken
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
    """Functions with too many parameters, `self` and `cls` aside."""
    found = []
    for module, tree in house.trees.items():
        for node in ast.walk(tree):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                listed = node.args.posonlyargs + node.args.args + node.args.kwonlyargs
                count = len(listed) - (listed[:1] != [] and listed[0].arg in ("self", "cls"))
                if count > MOST_PARAMETERS:
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


def _children(house: Package) -> dict[str, list[str]]:
    """By package: the packages directly in it."""
    found: dict[str, list[str]] = {package: [] for package in house.packages}
    for package in house.packages:
        above, _, name = package.rpartition(".")
        if above:
            found[above].append(name)
    return found


def _child(package: str, module: str) -> str:
    """What of a package a module lies in or is: the name of a sub-package, or its own."""
    first, *rest = module[len(package) + 1 :].split(".")
    return first if rest else f"{first}.py"


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
