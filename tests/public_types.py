"""The project's types in the signatures of public names, for tests that hold faces to them."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
import sys
import textwrap
import typing
from collections.abc import Iterator
from functools import cache, cached_property
from typing import Any

PACKAGE = "burg_drake"


def project_types(value: Any) -> Iterator[tuple[str, Any]]:
    """What a public function or class says of its parameters, results, attributes and properties;
    of a class, what it inherits from others of the project, and what operators call, as well.

    Yields:
        Where it is said, such as `HandTrial.run`, and a class of the project.
    """
    if not inspect.isclass(value):
        if inspect.isfunction(value):
            for found in classes_of(value):
                yield value.__name__, found
        return
    for name, member in members_of(value).items():
        called = function_of(member)
        if called is not None and called.__module__.startswith(PACKAGE):
            for found in classes_of(called):
                yield f"{value.__name__}.{name}", found
    for name, hint in hints_of(value).items():
        if not name.startswith("_"):
            for found in inside(hint):
                yield f"{value.__name__}.{name}", found
    for name, found in documented_attributes(value):
        yield f"{value.__name__}.{name}", found


def members_of(value: type) -> dict[str, Any]:
    """What a user meets of a class: public members and those that Python calls, but for the
    methods that are made for dataclasses and what these call themselves."""
    made = dataclasses.is_dataclass(value)
    found: dict[str, Any] = {}
    for one in reversed(value.__mro__):
        if one.__module__.startswith(PACKAGE):
            found |= vars(one)
    return {
        name: member
        for name, member in found.items()
        if (not name.startswith("_") or re.fullmatch("__.+__", name))
        and not (made and name in ("__init__", "__post_init__"))
    }


def documented_attributes(value: type) -> Iterator[tuple[str, type]]:
    """Attributes that a docstring tells of and `__init__` makes: `self.x = X(...)`, `X.of(...)`, or
    `self.x: X`."""
    for one in value.__mro__:
        if not one.__module__.startswith(PACKAGE) or "__init__" not in vars(one):
            continue
        if dataclasses.is_dataclass(one):
            continue
        told = attributes_told(one.__doc__ or "")
        names = vars(sys.modules[one.__module__]) | checked_only(one.__module__)
        for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(one.__init__)))):
            if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
                continue
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            if not re.fullmatch(r"self\.\w+", ast.unparse(target)) or target.attr not in told:
                continue
            said = node.annotation if isinstance(node, ast.AnnAssign) else node.value
            for part in ast.walk(said):
                found = names.get(part.id) if isinstance(part, ast.Name) else None
                if isinstance(node, ast.Assign) and not made_by(said, part):
                    continue
                for each in inside(found):
                    yield target.attr, each


def made_by(value: ast.expr, part: ast.AST) -> bool:
    """Whether a value is a call of a class, or of something that a class has."""
    if not isinstance(value, ast.Call):
        return False
    called = value.func
    return called is part or (isinstance(called, ast.Attribute) and called.value is part)


def attributes_told(text: str) -> set[str]:
    """Names under `Attributes:` in a docstring."""
    text = f"{inspect.cleandoc(text)}\n"
    section = re.search(r"^Attributes:\n((?: +.*\n|\n)*)", text, re.M)
    heads = re.findall(r"^ {4}(\w[\w, ]*):", section[1] if section else "", re.M)
    return {name.strip() for head in heads for name in head.split(",")}


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
    hint = typing.get_origin(hint) or hint
    if inspect.isclass(hint) and hint.__module__.startswith(PACKAGE):
        yield hint
