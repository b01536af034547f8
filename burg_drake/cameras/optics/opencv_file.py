"""Files that OpenCV's `FileStorage` writes, YAML or XML, as plain dicts, lists and texts.

OpenCV's own reader follows structures by recursion, so that a deep one ends the process.
"""

from __future__ import annotations

from typing import Any
from xml.parsers import expat

from burg_drake.core import DocumentError
from burg_drake.core.documents import TAGS, Tree, parse_plain_yaml
from burg_drake.core.files import DOCUMENT

MARKS = ("%YAML:1.0", "!!opencv-matrix", "<opencv_storage>")
MATRIX_TAG = "tag:yaml.org,2002:opencv-matrix"
"""Of a mapping of rows, cols, dt (the type) and data."""


def is_opencv(text: str) -> bool:
    """Whether OpenCV wrote a file."""
    return any(mark in text for mark in MARKS)


def read_opencv(text: str, name: str) -> Tree:
    """The contents of a file.

    Args:
        text: of the file.
        name: stands for the file in messages.

    Raises:
        DocumentError: it is neither such YAML nor such XML, or beyond the limits of documents.
    """
    if text.lstrip().startswith("<"):
        return _XmlReader(name).read(text)
    if text.startswith("%YAML"):  # `%YAML:1.0`, which YAML does not know, on a line of its own
        text = "#" + text
    return parse_plain_yaml(text, name, tags=TAGS | {MATRIX_TAG})


class _XmlReader:
    """Elements as dicts by tag; the text of one that is called `data` is a list of words."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._values = 0
        self._opened: list[dict[str, Any]] = [{}]
        self._text = ""
        self._parser = expat.ParserCreate()
        self._parser.buffer_text = True
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._characters
        self._parser.StartDoctypeDeclHandler = self._doctype

    def read(self, text: str) -> Tree:
        try:
            self._parser.Parse(text.encode(), True)
        except expat.ExpatError as error:
            problem = expat.ErrorString(error.code)
            raise DocumentError(f"{self._name}:{error.lineno}: not valid XML: {problem}") from error
        return self._opened[0].get("opencv_storage", {})

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._values += 1
        if len(self._opened) > DOCUMENT.depth:
            raise self._failure(f"nested more than {DOCUMENT.depth} levels deep")
        if self._values > DOCUMENT.values:
            raise self._failure(f"more than {DOCUMENT.values:,} values")
        self._opened.append({})
        self._text = ""

    def _end(self, tag: str) -> None:
        inner = self._opened.pop()
        value: Tree = inner or (self._text.split() if tag == "data" else self._text.strip())
        if tag != "_" and tag in self._opened[-1]:  # `_` is the item of a list
            raise self._failure(f"{tag!r} appears twice in the same element")
        self._opened[-1][tag] = value
        self._text = ""

    def _characters(self, text: str) -> None:
        self._text += text

    def _doctype(self, *_: object) -> None:
        raise self._failure("document type declarations (DOCTYPE) are not supported; remove it")

    def _failure(self, what: str) -> DocumentError:
        return DocumentError(f"{self._name}:{self._parser.CurrentLineNumber}: {what}")
