"""Large YAML files as plain dicts, lists and texts, in a tenth of the time that nodes take.

Values stay the text that is written; a key that appears twice in a mapping is an error.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from burg_drake.core.documents.yaml_events import TAGS, YamlEvent, checked_events
from burg_drake.core.errors import DocumentError, quoted
from burg_drake.core.files import DOCUMENT, GRASP_FILE, Limits, read_text

Tree = Any
"""A text, a list of trees, or a dict of trees by text."""

_STARTS = (yaml.ScalarEvent, yaml.SequenceStartEvent, yaml.MappingStartEvent)


def load_plain_yaml(path: str | Path) -> Tree:
    """The first document of a YAML file of grasps.

    Raises:
        DocumentError: it cannot be read, is not YAML, is beyond the limits or is empty, or a
            mapping has a key twice; the message names file and line.
    """
    return parse_plain_yaml(read_text(path, GRASP_FILE), str(path), GRASP_FILE)


def parse_plain_yaml(
    text: str,
    name: str,
    limits: Limits = DOCUMENT,
    tags: frozenset[str] = TAGS,
    empty: str = "the document is empty",
) -> Tree:
    """As `load_plain_yaml`, from text.

    Args:
        text, name, limits, tags: see `checked_events`.
        empty: what to say of a document without content.
    """
    events = checked_events(text, name, limits, tags)
    anchors: dict[str, Tree] = {}
    for event in events:
        if isinstance(event, _STARTS):
            return _tree(event, events, anchors, name)
    raise DocumentError(f"{name}: {empty}")


def _tree(
    event: YamlEvent, events: Iterator[YamlEvent], anchors: dict[str, Tree], name: str
) -> Tree:
    """The value that begins with `event`; takes the events that belong to it."""
    kind = type(event)
    if kind is yaml.ScalarEvent:
        result: Tree = event.value
    elif kind is yaml.AliasEvent:
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
                raise DocumentError(f"{name}:{line}: a key is a list or a mapping; expected a name")
            if key in result:
                raise DocumentError(
                    f"{name}:{line}: {quoted(key)} appears twice in the same mapping"
                )
            result[key] = _tree(next(events), events, anchors, name)
    if event.anchor is not None:
        anchors[event.anchor] = result
    return result
