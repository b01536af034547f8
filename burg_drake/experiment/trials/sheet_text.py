"""Changes one trial in the text of a trials file, and leaves all else as people wrote it.

Of the trial itself only those keys change whose value does, so that comments within it stay, too.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from typing import Any

import yaml

from burg_drake.core import DocumentError, InvalidInputError
from burg_drake.core.documents import dump_document, parse_document, parse_nodes, plain_data
from burg_drake.experiment.trials.sheet import RealTrial, TrialSheet

_BREAK = re.compile("\r\n|[\n\r\x85\u2028\u2029]")
"""What YAML counts as the end of a line."""
_SPACE = " \t\n\r\x85\u2028\u2029"
"""What YAML counts as space around a value: a no-break space is part of it."""

Edit = tuple[int, int, str]
"""Text from one offset to another, and what it becomes."""


def with_trial(text: str, name: str, sheet: TrialSheet, new: RealTrial) -> str:
    """The text with another trial in the place of that of the same number.

    Args:
        text: of the trials file.
        name: of the file, for messages.
        sheet: what the text holds.
        new: the trial as it is to be.

    Raises:
        DocumentError: the trial is written in a way that cannot be changed in its place, such as
            by an alias.
    """
    place = sheet.index(new.number)
    old = sheet.trials[place]
    trials = (*sheet.trials[:place], new, *sheet.trials[place + 1 :])
    node = _trials(parse_nodes(text, name)).value[place]
    try:
        changed = _edited(text, _edits(_Text(text), node, old, new))
        if parse_document(changed, TrialSheet, name) == dataclasses.replace(sheet, trials=trials):
            return changed
    except (InvalidInputError, yaml.YAMLError):
        pass
    raise DocumentError(
        f"{name}:{node.start_mark.line + 1}: trial {new.number} is written in a way that a program"
        " cannot change; write it as 'key: value' lines, without aliases"
    )


class _Text:
    """A text with the offsets of its lines."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.starts = [0, *(found.end() for found in _BREAK.finditer(text))]
        self.newline = "\r\n" if "\r\n" in text else "\n"

    def offset(self, mark: Any) -> int:
        """Of a place that a parser names."""
        return self.starts[int(mark.line)] + int(mark.column)

    def end(self, node: yaml.Node) -> int:
        """Where the text of a value ends; marks of the parser come after blank lines and comments
        that follow."""
        if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
            last = node.value[-1]
            return self.end(last[-1] if isinstance(last, tuple) else last)
        start, end = self.offset(node.start_mark), self.offset(node.end_mark)
        return start + len(self.text[start:end].rstrip(_SPACE))

    def line_start(self, offset: int) -> int:
        """Where the line of an offset begins."""
        return max(start for start in self.starts if start <= offset)

    def line_end(self, offset: int) -> int:
        """Where the line of an offset ends, before its break."""
        found = _BREAK.search(self.text, offset)
        return found.start() if found else len(self.text)


def _trials(root: yaml.Node) -> yaml.Node:
    node: yaml.Node = next(value for key, value in root.value if key.value == "trials")
    return node


def _edits(text: _Text, node: yaml.Node, old: RealTrial, new: RealTrial) -> list[Edit]:
    if not isinstance(node, yaml.MappingNode) or node.flow_style:
        whole = yaml.safe_dump(
            plain_data(new), default_flow_style=True, sort_keys=False, width=1 << 30
        )
        return [(text.offset(node.start_mark), text.offset(node.end_mark), whole.strip())]
    entries = {key.value: (key, value) for key, value in node.value}
    _require_in_order(text, node)
    column = node.start_mark.column
    bottom = text.line_end(text.end(node))
    edits, added = [], ""
    for field in dataclasses.fields(RealTrial):
        value = plain_data(getattr(new, field.name))
        if value == plain_data(getattr(old, field.name)):
            continue
        lines = _lines({field.name: value}, column, text.newline)
        if field.name in entries:
            default = value == plain_data(_default(field))
            edits.append(_replaced(text, node, *entries[field.name], lines, default))
        else:
            added += text.newline + " " * column + lines
    return [*edits, (bottom, bottom, added)]


def _replaced(
    text: _Text, trial: yaml.Node, key: yaml.Node, value: yaml.Node, lines: str, default: bool
) -> Edit:
    """A key with another value; what is at its default goes away with its lines, unless there is
    something else on them."""
    start, end = text.offset(key.start_mark), text.end(value)
    first, last = text.line_start(start), text.line_end(end)
    alone = not (text.text[first:start] + text.text[end:last]).strip(_SPACE)
    if default and alone and key.start_mark.line != trial.start_mark.line:
        return (first - len(text.newline), last, "")
    return (start, max(start, end), lines)


def _lines(entry: Mapping[str, Any], column: int, newline: str) -> str:
    """A key and its value as they stand in a mapping at a column."""
    lines = dump_document(entry).rstrip("\n").split("\n")
    return newline.join([lines[0], *(" " * column + line if line else "" for line in lines[1:])])


def _require_in_order(text: _Text, node: yaml.Node) -> None:
    """Refuses values that are written elsewhere."""
    at = text.offset(node.start_mark)
    for key, value in node.value:
        for part in (key, value):
            if text.offset(part.start_mark) < at:
                raise InvalidInputError("an alias")
            at = text.offset(part.start_mark)


def _default(field: dataclasses.Field[Any]) -> Any:
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default


def _edited(text: str, edits: list[Edit]) -> str:
    for start, end, new in sorted(edits, key=lambda edit: edit[:2], reverse=True):
        text = text[:start] + new + text[end:]
    return text
