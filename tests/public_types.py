"""The project's types in the signatures of public names, for tests that hold faces to them."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import sys
import typing
from collections.abc import Iterator
from functools import cache, cached_property
from typing import Any

PACKAGE = "burg_drake"


def project_types(value: Any) -> Iterator[tuple[str, type]]:
    """What a public function or class says of its parameters, results, fields and properties.

    Yields:
        Where it is said, such as `HandTrial.run`, and a class of the project.
    """
    if not inspect.isclass(value):
        if inspect.isfunction(value):
            for found in classes_of(value):
                yield value.__name__, found
        return
    for name, member in vars(value).items():
        if name.startswith("_") and name != "__init__":
            continue
        if name == "__init__" and dataclasses.is_dataclass(value):
            continue
        called = function_of(member)
        if called is not None and called.__module__.startswith(PACKAGE):
            for found in classes_of(called):
                yield f"{value.__name__}.{name}", found
    if dataclasses.is_dataclass(value) or issubclass(value, tuple):
        hints = hints_of(value)
        public = [name for name in hints if not name.startswith("_")]
        for name in public:
            for found in inside(hints[name]):
                yield f"{value.__name__}.{name}", found


def function_of(member: Any) -> Any:
    """The function of a member of a class, whichever way it is bound."""
    if isinstance(member, property):
        return member.fget
    if isinstance(member, cached_property):
        return member.func
    if isinstance(member, classmethod | staticmethod):
        return member.__func__
    return member if inspect.isfunction(member) else None


def classes_of(function: Any) -> Iterator[type]:
    """The project's classes in the signature of a function."""
    function = inspect.unwrap(function)
    for hint in hints_of(function).values():
        yield from inside(hint)


def hints_of(value: Any) -> dict[str, Any]:
    """Annotations as types, those that are only imported for type checkers as well."""
    return typing.get_type_hints(value, localns=checked_only(value.__module__))


@cache
def checked_only(module: str) -> dict[str, Any]:
    """What a module imports under `TYPE_CHECKING`."""
    names: dict[str, Any] = {}
    for node in ast.parse(inspect.getsource(sys.modules[module])).body:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            for line in node.body:
                exec(compile(ast.Module([line], []), module, "exec"), names)
    return names


def inside(hint: Any) -> Iterator[type]:
    """The project's classes in a type, at any depth."""
    for part in typing.get_args(hint):
        for one in part if isinstance(part, list) else [part]:
            yield from inside(one)
    if inspect.isclass(hint) and hint.__module__.startswith(PACKAGE):
        yield hint
