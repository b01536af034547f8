"""YAML and JSON text, checked against limits before anything is built from it.

YAML is parsed to events, nodes with line numbers, or plain dicts, lists and texts; the last takes a
tenth of the time of nodes. A key that appears twice in a mapping is an error.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from burg_drake.core.errors import DocumentError, quote_value, shorten_text
from burg_drake.core.files import FileLimits, Limits, read_text

YAML_LOADER = yaml.CSafeLoader if hasattr(yaml, "CSafeLoader") else yaml.SafeLoader
"""LibYAML's loader where PyYAML has it."""

YamlEvent = Any
"""Event of PyYAML, whose kinds have different attributes."""

STANDARD_TAGS = frozenset(
    f"tag:yaml.org,2002:{kind}" for kind in ("str", "int", "float", "bool", "null", "map", "seq")
) | {"!"}
"""Tags of YAML's own scalar and collection types."""


def checked_yaml_events(
    text: str, name: str, limits: Limits = FileLimits.document, tags: frozenset[str] = STANDARD_TAGS
) -> Iterator[YamlEvent]:
    """The events of a text, until one exceeds the limits.

    Args:
        text: YAML.
        name: stands for the file in messages.
        limits: limits of depth and values.
        tags: known tags.

    Raises:
        DocumentError: not YAML, too deep, too many values, an unknown tag, or an alias without a
            preceding anchor; the message names file and line.
    """
    values = 0
    anchors: dict[str, tuple[int, int]] = {}  # number and depth of its values
    opened: list[tuple[str | None, int]] = []  # anchor, and number of values before
    reached: list[int] = []  # depth within each open collection
    for event in _parse_events(text, name, limits):
        kind = type(event)
        if kind is yaml.ScalarEvent:
            values += 1
            if event.tag is None and event.anchor is None and values <= limits.values:
                yield event  # almost all events; the rest is slow
                continue
            if event.anchor is not None:
                anchors[event.anchor] = (1, 0)
        elif kind is yaml.SequenceStartEvent or kind is yaml.MappingStartEvent:
            opened.append((event.anchor, values))
            reached.append(len(opened))
            values += 1
        elif kind is yaml.SequenceEndEvent or kind is yaml.MappingEndEvent:
            depth = reached.pop()
            anchor, before = opened.pop()
            if reached:
                reached[-1] = max(reached[-1], depth)
            if anchor is not None:
                anchors[anchor] = (values - before, depth - len(opened))
        elif kind is yaml.AliasEvent:
            if event.anchor not in anchors:
                what = f"alias *{shorten_text(event.anchor)} has no anchor before it"
                raise _event_error(name, event, what)
            behind, depth = anchors[event.anchor]
            values += behind
            if reached:
                reached[-1] = max(reached[-1], len(opened) + depth)
        if reached and reached[-1] > limits.depth:
            raise _event_error(name, event, _depth_message(limits))
        if values > limits.values:
            what = f"more than {limits.values:,} values; an alias counts as all that it refers to"
            raise _event_error(name, event, what)
        if getattr(event, "tag", None) is not None and event.tag not in tags:
            what = f"tag {quote_value(event.tag)} is not supported; leave it out"
            raise _event_error(name, event, what)
        yield event


def _parse_events(text: str, name: str, limits: Limits) -> Iterator[YamlEvent]:
    max_directives = 8  # LibYAML compares each %TAG directive with all before it.
    if text.count("%TAG") > max_directives:
        raise DocumentError(f"{name}: more than {max_directives} %TAG directives; leave them out")
    try:
        yield from yaml.parse(text, Loader=YAML_LOADER)
    except yaml.YAMLError as error:
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        what = f"not valid YAML: {problem}"
        if problem == "exceeded maximum nesting depth":  # LibYAML's limit: 1,000 levels
            what = _depth_message(limits)
        raise DocumentError(f"{name}{_problem_line(error)}: {what}") from error


def _depth_message(limits: Limits) -> str:
    return f"nested more than {limits.depth} levels deep"


def _problem_line(error: yaml.YAMLError) -> str:
    mark = getattr(error, "problem_mark", None)
    return f":{mark.line + 1}" if mark else ""


def _event_error(name: str, event: YamlEvent, what: str) -> DocumentError:
    return DocumentError(f"{name}:{event.start_mark.line + 1}: {what}")


def load_yaml_node(path: str | Path) -> yaml.Node:
    """The root node of a YAML file.

    Raises:
        DocumentError: it cannot be read, is not YAML, is beyond the limits of documents, or is
            empty; the message names file and line.
    """
    return parse_yaml_node(read_text(path), str(path))


def parse_yaml_node(text: str, name: str, empty: str = "the document is empty") -> yaml.Node:
    """As `load_yaml_node`, from text.

    Args:
        text: YAML.
        name: stands for the file in messages.
        empty: what to say of a document without content.
    """
    starts = 0
    for event in checked_yaml_events(text, name):
        starts += isinstance(event, yaml.DocumentStartEvent)
        if starts > 1:
            raise _event_error(name, event, "not valid YAML: a second document begins")
    try:
        node = yaml.compose(text, Loader=YAML_LOADER)
    except yaml.YAMLError as error:  # found only by composing: the same anchor twice
        what = f"not valid YAML: {str(error).splitlines()[0]}"
        raise DocumentError(f"{name}{_problem_line(error)}: {what}") from error
    if node is None:
        raise DocumentError(f"{name}: {empty}")
    return node


Tree = Any
"""A text, a list of trees, or a dict of trees with text keys."""


def load_plain_yaml(path: str | Path) -> Tree:
    """The first document of a YAML file of grasps.

    Raises:
        DocumentError: it cannot be read, is not YAML, is beyond the limits or is empty, or a
            mapping has a key twice; the message names file and line.
    """
    limits = FileLimits.grasp_file
    return parse_plain_yaml(read_text(path, limits), str(path), limits)


def parse_plain_yaml(
    text: str,
    name: str,
    limits: Limits = FileLimits.document,
    tags: frozenset[str] = STANDARD_TAGS,
    empty: str = "the document is empty",
) -> Tree:
    """As `load_plain_yaml`, from text.

    Args:
        text, name, limits, tags: see `checked_yaml_events`.
        empty: what to say of a document without content.
    """
    events = checked_yaml_events(text, name, limits, tags)
    anchors: dict[str, Tree] = {}
    for event in events:
        if isinstance(event, (yaml.ScalarEvent, yaml.SequenceStartEvent, yaml.MappingStartEvent)):
            return _build_tree(event, events, anchors, name)
    raise DocumentError(f"{name}: {empty}")


def _build_tree(
    event: YamlEvent, events: Iterator[YamlEvent], anchors: dict[str, Tree], name: str
) -> Tree:
    """Builds the value that begins with `event`; consumes its events."""
    kind = type(event)
    if kind is yaml.ScalarEvent:
        result: Tree = event.value
    elif kind is yaml.AliasEvent:
        return anchors[event.anchor]
    elif kind is yaml.SequenceStartEvent:
        result = []
        while type(item := next(events)) is not yaml.SequenceEndEvent:
            result.append(_build_tree(item, events, anchors, name))
    else:
        result = {}
        while type(item := next(events)) is not yaml.MappingEndEvent:
            key = _build_tree(item, events, anchors, name)
            if not isinstance(key, str):
                raise _event_error(name, item, "a key is a list or a mapping; expected a name")
            if key in result:
                what = f"{quote_value(key)} appears twice in the same mapping"
                raise _event_error(name, item, what)
            result[key] = _build_tree(next(events), events, anchors, name)
    if event.anchor is not None:
        anchors[event.anchor] = result
    return result


MAX_INTEGER_DIGITS = 100
"""Random generator states have 39 digits, floats 309; Python refuses 4,300."""

_JSON_STRING = re.compile(rb'"[^"\\]*+(?:\\.[^"\\]*+)*+"?', re.DOTALL)
"""Never backtracks, so an unterminated string takes no longer than others."""
_DEPTH_CHANGE = np.zeros(256, dtype=np.int8)  # Change of the nesting depth at each byte.
_DEPTH_CHANGE[list(b"[{")] = 1
_DEPTH_CHANGE[list(b"]}")] = -1


def load_json(path: str | Path, limits: Limits = FileLimits.document) -> Any:
    """The value of a JSON file.

    Raises:
        DocumentError: it cannot be read, is not JSON, is beyond the limits, or a mapping has a key
            twice; the message names the file, and the line if known.
    """
    return parse_json(read_text(path, limits), str(path), limits)


def parse_json(text: str, name: str, limits: Limits = FileLimits.document) -> Any:
    """As `load_json`, from text; `name` stands for the file in messages."""
    _check_size_and_depth(text, name, limits)

    def whole(digits: str) -> int:
        if len(digits) > MAX_INTEGER_DIGITS:
            line = text.count("\n", 0, text.find(digits)) + 1
            raise DocumentError(
                f"{name}:{line}: {quote_value(digits)} has more digits than the"
                f" {MAX_INTEGER_DIGITS} that a whole number may have"
            )
        return int(digits)

    def mapping(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        result = dict(pairs)
        if len(result) < len(pairs):
            twin = next(key for key, count in Counter(key for key, _ in pairs).items() if count > 1)
            raise DocumentError(f"{name}: {quote_value(twin)} appears twice in the same mapping")
        return result

    try:
        return json.loads(text, parse_int=whole, object_pairs_hook=mapping)
    except json.JSONDecodeError as error:
        raise DocumentError(f"{name}:{error.lineno}: not valid JSON: {error.msg}") from error


def _check_size_and_depth(text: str, name: str, limits: Limits) -> None:
    """Checks the number of values and the nesting depth before parsing."""
    opened = text.count("[") + text.count("{")
    if opened + text.count(",") > limits.values:
        raise DocumentError(f"{name}: more than {limits.values:,} values; is it the right file?")
    if opened <= limits.depth:
        return
    structure = np.frombuffer(_JSON_STRING.sub(b"", text.encode()), dtype=np.uint8)
    steps = _DEPTH_CHANGE[structure]
    depth = np.cumsum(steps[steps != 0], dtype=np.int64)
    if depth.max(initial=0) > limits.depth:
        raise DocumentError(f"{name}: {_depth_message(limits)}")
