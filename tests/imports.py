"""Who imports whom in a package, and what its faces show: read from files, without importing."""

from __future__ import annotations

import ast
import gc
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import burg_drake


@dataclass(frozen=True)
class Import:
    """One name that a module imports.

    Attributes:
        module: that imports.
        source: module or package that it names.
        name: what it imports from there; empty of a plain `import source`.
        line: where.
    """

    module: str
    source: str
    name: str
    line: int

    def __str__(self) -> str:
        return f"{self.module}:{self.line} imports {self.name} from {self.source}"


@dataclass(frozen=True)
class Package:
    """The modules of a package.

    Attributes:
        folder: of the package, whose name is the package's.
    """

    folder: Path

    @property
    def name(self) -> str:
        """Of the package."""
        return self.folder.name

    @cached_property
    def files(self) -> dict[str, Path]:
        """All modules and packages by their dotted names."""
        found = {}
        for path in sorted(self.folder.rglob("*.py")):
            parts = path.relative_to(self.folder.parent).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
        return found

    @cached_property
    def packages(self) -> dict[str, Path]:
        """Those that are packages."""
        return {name: path for name, path in self.files.items() if path.name == "__init__.py"}

    @cached_property
    def modules(self) -> dict[str, Path]:
        """Those that are no packages."""
        return {name: path for name, path in self.files.items() if path.name != "__init__.py"}

    @cached_property
    def trees(self) -> dict[str, ast.Module]:
        """What is written in them. To look for garbage among all that, again and again, takes three
        times as long as to read it."""
        gc.disable()
        try:
            return {name: ast.parse(path.read_text("utf-8")) for name, path in self.files.items()}
        finally:
            gc.freeze()
            gc.enable()

    @cached_property
    def statements(self) -> dict[str, list[ast.Import | ast.ImportFrom]]:
        """Their imports, those within functions, too."""
        return {
            name: [x for x in all_statements(tree) if _is_import(x)]
            for name, tree in self.trees.items()
        }

    @cached_property
    def faces(self) -> dict[str, dict[str, tuple[str, str]]]:
        """By package: names of its stub, each with the module that has it and its name there."""
        found: dict[str, dict[str, tuple[str, str]]] = {}
        for package in self.packages:
            stub = self.files[package].with_suffix(".pyi")
            found[package] = {}
            for node in ast.walk(ast.parse(stub.read_text("utf-8"))) if stub.exists() else ():
                if isinstance(node, ast.ImportFrom) and node.level == 1:
                    source = f"{package}.{node.module}" if node.module else package
                    for alias in node.names:
                        found[package][alias.asname or alias.name] = source, alias.name
        return found

    @cached_property
    def imports(self) -> list[Import]:
        """All imports of the package's own names, those within functions, too; and the names that
        are used of a package with a face that is imported as a whole."""
        named = [
            found
            for module in self.files
            for found in self._imports(module, self.statements[module])
        ]
        return [*named, *(used for found in named for used in self._attributes(found))]

    @cached_property
    def graph(self) -> dict[str, dict[str, Import]]:
        """By module: the modules that it imports from, through faces, with one import of each."""
        graph: dict[str, dict[str, Import]] = defaultdict(dict)
        for found in self.imports:
            home = self.home(found.source, found.name)
            if home != found.module and found.module in self.modules and home in self.modules:
                graph[found.module].setdefault(home, found)
        return graph

    def home(self, source: str, name: str) -> str:
        """The module that a name comes from which is imported from `source`."""
        shown = self.faces.get(source, {}).get(name)
        if shown is not None and shown != (source, name):
            return self.home(*shown)
        return f"{source}.{name}" if f"{source}.{name}" in self.files else source

    def circles(self) -> list[list[str]]:
        """Groups of modules each of which needs the others, directly or by way of others."""
        order: list[str] = []
        seen: set[str] = set()
        for module in self.modules:
            order += _reached(module, lambda m: self.graph.get(m, {}), seen)
        backwards: dict[str, list[str]] = defaultdict(list)
        for module, sources in self.graph.items():
            for source in sources:
                backwards[source].append(module)
        seen = set()
        groups = [_reached(module, lambda m: backwards[m], seen) for module in reversed(order)]
        return [sorted(group) for group in groups if len(group) > 1]

    def imports_of(self, folder: Path) -> list[Import]:
        """Imports of the package's names by the files in another folder, such as tests."""
        return [
            found
            for path in sorted(folder.rglob("*.py"))
            for found in self._imports(
                ".".join(path.relative_to(folder.parent).with_suffix("").parts),
                [x for x in all_statements(ast.parse(path.read_text("utf-8"))) if _is_import(x)],
            )
        ]

    def _imports(self, module: str, statements: Iterable[ast.AST]) -> Iterator[Import]:
        inside = f"{self.name}."
        for node in statements:
            if isinstance(node, ast.Import):
                for alias in node.names:
                    if f"{alias.name}.".startswith(inside):
                        yield Import(module, alias.name, "", node.lineno)
            elif isinstance(node, ast.ImportFrom):
                if module.startswith(inside) and node.level:
                    raise ValueError(f"{module}:{node.lineno}: relative import")
                if node.level == 0 and f"{node.module}.".startswith(inside):
                    for alias in node.names:
                        yield Import(module, str(node.module), alias.name, node.lineno)

    def _attributes(self, found: Import) -> Iterator[Import]:
        """Names that a module uses of what it imports, if that is a package with a face."""
        package = f"{found.source}.{found.name}"
        if self.faces.get(package):
            for node in ast.walk(self.trees[found.module]):
                if isinstance(node, ast.Attribute) and ast.unparse(node.value) == found.name:
                    yield Import(found.module, package, node.attr, node.lineno)


def all_statements(node: ast.AST) -> Iterator[ast.AST]:
    """What is in a module or a statement, without what statements are made of: in a tenth of the
    time of `ast.walk`."""
    for field in ("body", "orelse", "finalbody", "handlers", "cases"):
        children = getattr(node, field, ())
        for child in children if isinstance(children, list) else ():
            yield child
            yield from all_statements(child)


def _is_import(node: ast.AST) -> bool:
    return isinstance(node, (ast.Import, ast.ImportFrom))


def _reached(start: str, following, seen: set[str]) -> list[str]:
    """What can be reached of what was not seen before, the farthest first."""
    if start in seen:
        return []
    seen.add(start)
    found, path = [], [(start, iter(following(start)))]
    while path:
        step = next((m for m in path[-1][1] if m not in seen), None)
        if step is None:
            found.append(path.pop()[0])
        else:
            seen.add(step)
            path.append((step, iter(following(step))))
    return found


HOUSE = Package(Path(burg_drake.__file__).parent)
"""Read once for all tests of a process."""
