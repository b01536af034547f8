"""YAML text as a tree of nodes that know their line, before anything is made of it."""

from __future__ import annotations

from pathlib import Path

import yaml

from burg_drake.core.errors import DocumentError

_LOADER = yaml.CSafeLoader if hasattr(yaml, "CSafeLoader") else yaml.SafeLoader


def load_nodes(path: str | Path) -> yaml.Node:
    """The root node of a YAML file.

    Raises:
        DocumentError: it cannot be read, is not YAML, or is empty; the message names file and line.
    """
    return parse_nodes(read_text(path), str(path))


def read_text(path: str | Path) -> str:
    """The text of a document.

    Raises:
        DocumentError: it cannot be read.
    """
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not a text file"
        raise DocumentError(f"cannot read {path}: {reason}") from error


def parse_nodes(text: str, name: str, empty: str = "the document is empty") -> yaml.Node:
    """As `load_nodes`, from text.

    Args:
        text: YAML.
        name: stands for the file in messages.
        empty: what to say of a document without content.
    """
    try:
        node = yaml.compose(text, Loader=_LOADER)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f":{mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise DocumentError(f"{name}{line}: not valid YAML: {problem}") from error
    if node is None:
        raise DocumentError(f"{name}: {empty}")
    return node
