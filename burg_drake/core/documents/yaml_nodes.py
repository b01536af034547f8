"""YAML text as a tree of nodes that know their line, before anything is made of it."""

from __future__ import annotations

from pathlib import Path

import yaml

from burg_drake.core.documents.yaml_events import LOADER, checked_events
from burg_drake.core.errors import DocumentError
from burg_drake.core.files import read_text


def load_nodes(path: str | Path) -> yaml.Node:
    """The root node of a YAML file.

    Raises:
        DocumentError: it cannot be read, is not YAML, is beyond the limits of documents, or is
            empty; the message names file and line.
    """
    return parse_nodes(read_text(path), str(path))


def parse_nodes(text: str, name: str, empty: str = "the document is empty") -> yaml.Node:
    """As `load_nodes`, from text.

    Args:
        text: YAML.
        name: stands for the file in messages.
        empty: what to say of a document without content.
    """
    starts = 0
    for event in checked_events(text, name):
        starts += isinstance(event, yaml.DocumentStartEvent)
        if starts > 1:
            line = event.start_mark.line + 1
            raise DocumentError(f"{name}:{line}: not valid YAML: a second document begins")
    try:
        node = yaml.compose(text, Loader=LOADER)
    except yaml.YAMLError as error:  # that only composing finds: the same anchor twice
        mark = getattr(error, "problem_mark", None)
        line = f":{mark.line + 1}" if mark else ""
        raise DocumentError(
            f"{name}{line}: not valid YAML: {str(error).splitlines()[0]}"
        ) from error
    if node is None:
        raise DocumentError(f"{name}: {empty}")
    return node
