"""Large YAML files as plain dicts, lists and texts, in a tenth of the time that nodes take.

Values stay the text that is written; a key that appears twice in a mapping is an error.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from burg_drake.core.errors import DocumentError
from burg_drake.core.yaml_nodes import read_text

_LOADER = yaml.CSafeLoader if hasattr(yaml, "CSafeLoader") else yaml.SafeLoader

Tree = Any
"""A text, a list of trees, or a dict of trees by text."""
Event = Any
"""Of PyYAML, whose kinds of event have different attributes."""


def load_texts(path: str | Path) -> Tree:
    """The first document of a YAML file.

    Raises:
        DocumentError: it cannot be read, is not YAML or is empty, or a mapping has a key twice; the
            message names file and line.
    """
    events = _events(path)
    anchors: dict[str, Tree] = {}
    for event in events:
        if isinstance(event, (yaml.ScalarEvent, yaml.SequenceStartEvent, yaml.MappingStartEvent)):
            return _tree(event, events, anchors, str(path))
    raise DocumentError(f"{path}: the document is empty")


def _events(path: str | Path) -> Iterator[Event]:
    try:
        yield from yaml.parse(read_text(path), Loader=_LOADER)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f":{mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise DocumentError(f"{path}{line}: not valid YAML: {problem}") from error


def _tree(event: Event, events: Iterator[Event], anchors: dict[str, Tree], name: str) -> Tree:
    """The value that begins with `event`; takes the events that belong to it."""
    kind = type(event)
    if kind is yaml.ScalarEvent:
        result: Tree = event.value
    elif kind is yaml.AliasEvent:
        if event.anchor not in anchors:
            line = event.start_mark.line + 1
            raise DocumentError(f"{name}:{line}: alias *{event.anchor} has no anchor before it")
        return anchors[event.anchor]
    elif kind is yaml.SequenceStartEvent:
        result = []
        while type(item := next(events)) is not yaml.SequenceEndEvent:
            result.append(_tree(item, events, anchors, name))
    else:
        result = {}
        while type(item := next(events)) is not yaml.MappingEndEvent:
            key = _tree(item, events, anchors, name)
            line = item.start_mark.line + 1
            if not isinstance(key, str):
                raise DocumentError(f"{name}:{line}: a key is a structure; expected a name")
            if key in result:
                raise DocumentError(f"{name}:{line}: {key!r} appears twice in the same mapping")
            result[key] = _tree(next(events), events, anchors, name)
    if event.anchor is not None:
        anchors[event.anchor] = result
    return result
