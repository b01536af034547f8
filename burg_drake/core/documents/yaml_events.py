"""YAML text as a stream of events, checked before anything is built of it.

LibYAML and PyYAML compose nodes by recursion, which ends the process where a document is nested too
deeply, and follow aliases as often as they are used. Events come one at a time.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import yaml

from burg_drake.core.errors import DocumentError, quoted, shown
from burg_drake.core.files import DOCUMENT, Limits

LOADER = yaml.CSafeLoader if hasattr(yaml, "CSafeLoader") else yaml.SafeLoader

YamlEvent = Any
"""Of PyYAML, whose kinds of event have different attributes."""

_KINDS = ("str", "int", "float", "bool", "null", "map", "seq")
TAGS = frozenset({"!", *(f"tag:yaml.org,2002:{kind}" for kind in _KINDS)})
"""Tags that say no more than the values themselves."""
DIRECTIVES = 8
"""Of tags, at most: LibYAML compares each to all before it."""
TOO_DEEP = "exceeded maximum nesting depth"
"""What LibYAML says from 0.2.6 on where it reads ahead into more than its own 1,000 levels."""


def checked_events(
    text: str, name: str, limits: Limits = DOCUMENT, tags: frozenset[str] = TAGS
) -> Iterator[YamlEvent]:
    """The events of a text, until one exceeds the limits.

    Args:
        text: YAML.
        name: stands for the file in messages.
        limits: of depth and values.
        tags: that are known.

    Raises:
        DocumentError: not YAML, too deep, too many values, a tag that is not known, or an alias
            without an anchor before it; the message names file and line.
    """
    values = 0
    anchors: dict[str, tuple[int, int]] = {}  # values behind it, and how deep they are
    opened: list[tuple[str | None, int]] = []  # anchor, and values before
    reached: list[int] = []  # depth within each that is open
    for event in _parsed(text, name, limits):
        kind = type(event)
        if kind is yaml.ScalarEvent:
            values += 1
            if event.tag is None and event.anchor is None and values <= limits.values:
                yield event  # almost all: what follows costs time
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
                what = f"alias *{shown(event.anchor)} has no anchor before it"
                raise _failure(name, event, what)
            behind, depth = anchors[event.anchor]
            values += behind
            if reached:
                reached[-1] = max(reached[-1], len(opened) + depth)
        if reached and reached[-1] > limits.depth:
            raise _failure(name, event, _too_deep(limits))
        if values > limits.values:
            what = f"more than {limits.values:,} values; an alias counts as all that it refers to"
            raise _failure(name, event, what)
        if getattr(event, "tag", None) is not None and event.tag not in tags:
            raise _failure(name, event, f"tag {quoted(event.tag)} is not supported; leave it out")
        yield event


def _parsed(text: str, name: str, limits: Limits) -> Iterator[YamlEvent]:
    if text.count("%TAG") > DIRECTIVES:
        raise DocumentError(f"{name}: more than {DIRECTIVES} %TAG directives; leave them out")
    try:
        yield from yaml.parse(text, Loader=LOADER)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f":{mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        if problem == TOO_DEEP:
            raise DocumentError(f"{name}{line}: {_too_deep(limits)}") from error
        raise DocumentError(f"{name}{line}: not valid YAML: {problem}") from error


def _too_deep(limits: Limits) -> str:
    return f"nested more than {limits.depth} levels deep"


def _failure(name: str, event: YamlEvent, what: str) -> DocumentError:
    return DocumentError(f"{name}:{event.start_mark.line + 1}: {what}")
