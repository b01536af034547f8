"""Edits a trials file as text: one trial changes, and all else stays as people wrote it.

Only the keys of the trial whose values change are edited, so that comments within it stay, too.
"""

from __future__ import annotations

import bisect
import dataclasses
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import yaml

from burg_drake.core import (
    DocumentError,
    InvalidInputError,
    Reader,
    dump_document,
    empty_document_message,
    parse_yaml_node,
    plain_data,
    read_document,
)
from burg_drake.experiment.trials.trial_sheet import RealTrial, TrialSheet

_LINE_BREAK = re.compile("\r\n|[\n\r\x85\u2028\u2029]")
"""End of a line in YAML."""
_YAML_SPACE = " \t\n\r\x85\u2028\u2029"
"""Space around a value in YAML; a no-break space is part of the value."""
_ITEM_START = re.compile("( *)- +")
"""Start of a trial, on the line where it begins."""
_YAML_DIRECTIVE = re.compile("^%", re.MULTILINE)
_ANCHOR_OR_TAG = re.compile(r"(^|[\s\[{,:-])[&!]", re.MULTILINE)
"""Possible anchor or tag, which may have a meaning for other lines or depend on them."""

Edit = tuple[int, int, str]
"""Start and end offset of a text, and its replacement."""


@dataclass(frozen=True, eq=False)
class SheetText:
    """The text of a trials file, and its contents.

    If each trial has its own lines, as in files written by this project, a changed trial is read
    alone, in a time that does not depend on the size of the file.

    Attributes:
        name: name of the file, for messages.
        text: text of the file.
        sheet: parsed contents.
        starts: offsets of the first line of each trial in order, and of the end of the last trial;
            empty if a trial does not have its own lines.
        column: column of the hyphens before trials.
    """

    name: str
    text: str
    sheet: TrialSheet
    starts: tuple[int, ...] = ()
    column: int = 0

    @classmethod
    def read(cls, text: str, name: str) -> SheetText:
        """Reads a whole text.

        Raises:
            DocumentError: it does not fit the schema.
        """
        root = parse_yaml_node(text, name, empty_document_message(TrialSheet))
        sheet = read_document(root, TrialSheet, name)
        return cls(name, text, sheet, *_locate_trials(root, text))

    def read_changed(self, text: str) -> SheetText:
        """Reads a later text of the file; if only one trial has changed, only the trial's lines.

        Raises:
            DocumentError: it does not fit the schema.
        """
        if text == self.text:
            return self
        index = self._find_changed_trial(text)
        changed = None if index is None else self._replace_trial_lines(index, text)
        return changed or SheetText.read(text, self.name)

    def with_trial(self, new: RealTrial) -> SheetText:
        """The text with a new trial in place of the trial with this number.

        Raises:
            DocumentError: the trial cannot be edited in place, such as with an alias.
        """
        index = self.sheet.index(new.number)
        old, trials = self.sheet.trials[index], list(self.sheet.trials)
        trials[index] = new
        if self.starts:
            start, end = self.starts[index : index + 2]
            (node,) = parse_yaml_node(self.text[start:end], self.name).value
            line = self.text.count("\n", 0, start) + node.start_mark.line
        else:
            start, end = 0, len(self.text)
            root = parse_yaml_node(self.text, self.name)
            trials_node = next(value for key, value in root.value if key.value == "trials")
            node = trials_node.value[index]
            line = node.start_mark.line
        lines = self.text[start:end]
        try:
            edited = _apply_edits(lines, _list_edits(_LineIndex(lines), node, old, new))
            text = self.text[:start] + edited + self.text[end:]
            changed = self._replace_trial_lines(index, text) or SheetText.read(text, self.name)
            if changed.sheet == dataclasses.replace(self.sheet, trials=tuple(trials)):
                return changed
        except (InvalidInputError, yaml.YAMLError):
            pass
        raise DocumentError(
            f"{self.name}:{line + 1}: trial {new.number} is written in a way that a program"
            " cannot change; write it as 'key: value' lines, without aliases"
        )

    def _replace_trial_lines(self, index: int, text: str) -> SheetText | None:
        """Reads a text that differs in the lines of one trial; None if the whole text has to be
        read.
        """
        if not self.starts:
            return None
        added = len(text) - len(self.text)
        starts = *self.starts[: index + 1], *(start + added for start in self.starts[index + 1 :])
        trial = _parse_trial(text[starts[index] : starts[index + 1]], self.name, self.column)
        if trial is None:
            return None
        trials = (*self.sheet.trials[:index], trial, *self.sheet.trials[index + 1 :])
        try:
            sheet = dataclasses.replace(self.sheet, trials=trials)
        except InvalidInputError:  # such as the number of another trial
            return None
        return SheetText(self.name, text, sheet, starts, self.column)

    def _find_changed_trial(self, text: str) -> int | None:
        """Index of the trial whose lines contain all differences from another text; None if there
        is no such trial.
        """
        if not self.starts:
            return None
        longest = min(len(text), len(self.text))
        tail = _bisect_largest(longest, lambda n: text[-n:] == self.text[-n:])
        head = _bisect_largest(longest - tail, lambda n: text[:n] == self.text[:n])
        index = bisect.bisect_right(self.starts, head) - 1
        if not 0 <= index < len(self.sheet.trials):
            return None
        return index if len(self.text) - tail <= self.starts[index + 1] else None


def _bisect_largest(limit: int, holds: Callable[[int], bool]) -> int:
    """The largest number from 0 to `limit` for which a monotone condition holds."""
    return bisect.bisect_left(range(1, limit + 1), True, key=lambda n: not holds(n))


def _locate_trials(root: yaml.Node, text: str) -> tuple[tuple[int, ...], int]:
    """Offsets and column of trials whose lines can be read alone, see `SheetText`; no offsets if
    trials are written in another way.
    """
    nothing: tuple[tuple[int, ...], int] = ((), 0)
    key_index = next((k for k, (key, _) in enumerate(root.value) if key.value == "trials"), None)
    if _YAML_DIRECTIVE.search(text) or key_index is None or _has_alias(root):
        return nothing
    items = root.value[key_index][1].value
    lines = _LineIndex(text)
    starts, columns = [], set()
    for item in items:
        start = lines.starts[item.start_mark.line]
        hyphen = _ITEM_START.fullmatch(text, start, lines.offset(item.start_mark))
        if hyphen is None or not isinstance(item, yaml.MappingNode) or item.flow_style:
            return nothing
        starts.append(start)
        columns.add(len(hyphen[1]))
    end = len(text)
    if key_index + 1 < len(root.value):
        next_key = root.value[key_index + 1][0].start_mark
        end = lines.starts[next_key.line]
        if text[end : lines.offset(next_key)].strip(_YAML_SPACE):
            return nothing
    return ((*starts, end), columns.pop()) if len(columns) == 1 else nothing


def _has_alias(node: yaml.Node) -> bool:
    """Whether a tree contains a node twice, as by an alias."""
    seen: set[int] = set()
    stack = [node]
    while stack:
        node = stack.pop()
        if id(node) in seen:
            return True
        seen.add(id(node))
        if isinstance(node, yaml.MappingNode):
            stack += [part for pair in node.value for part in pair]
        elif isinstance(node, yaml.SequenceNode):
            stack += node.value
    return False


def _parse_trial(lines: str, name: str, column: int) -> RealTrial | None:
    """Parses the lines of a trial; None if their meaning may depend on other lines. They have to be
    whole lines with a single list entry, its hyphen in this column, and without anchors and tags.
    """
    if not lines.endswith("\n") or _ANCHOR_OR_TAG.search(lines):
        return None
    try:
        node = parse_yaml_node(lines, name)
        if not isinstance(node, yaml.SequenceNode) or node.flow_style or len(node.value) != 1:
            return None
        if node.start_mark.column != column or node.value[0].flow_style:
            return None
        trial: RealTrial = Reader(name).read(node.value[0], RealTrial, "")
    except InvalidInputError:
        return None
    return trial


class _LineIndex:
    """A text with the offsets of its lines."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.starts = [0, *(found.end() for found in _LINE_BREAK.finditer(text))]
        self.newline = "\r\n" if "\r\n" in text else "\n"

    def offset(self, mark: Any) -> int:
        """Offset of a mark of the parser."""
        return self.starts[int(mark.line)] + int(mark.column)

    def end(self, node: yaml.Node) -> int:
        """End offset of a value's text. The parser's own end mark lies after the blank lines and
        comments that follow the value.
        """
        if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
            last = node.value[-1]
            return self.end(last[-1] if isinstance(last, tuple) else last)
        start, end = self.offset(node.start_mark), self.offset(node.end_mark)
        return start + len(self.text[start:end].rstrip(_YAML_SPACE))

    def line_start(self, offset: int) -> int:
        """Start of the line that contains an offset."""
        return max(start for start in self.starts if start <= offset)

    def line_end(self, offset: int) -> int:
        """End of the line that contains an offset, before the line break."""
        found = _LINE_BREAK.search(self.text, offset)
        return found.start() if found else len(self.text)


def _list_edits(text: _LineIndex, node: yaml.Node, old: RealTrial, new: RealTrial) -> list[Edit]:
    """Edits of the lines of a trial: a trial in flow style is written anew, others by key."""
    if not isinstance(node, yaml.MappingNode) or node.flow_style:
        trial = yaml.safe_dump(
            plain_data(new), default_flow_style=True, sort_keys=False, width=1 << 30
        )
        return [(text.offset(node.start_mark), text.offset(node.end_mark), trial.strip())]
    entries = {key.value: (key, value) for key, value in node.value}
    _require_in_order(text, node)
    column = node.start_mark.column
    bottom = text.line_end(text.end(node))
    edits, added = [], ""
    for field in dataclasses.fields(RealTrial):
        value = plain_data(getattr(new, field.name))
        if value == plain_data(getattr(old, field.name)):
            continue
        lines = _format_entry({field.name: value}, column, text.newline)
        if field.name in entries:
            default = value == plain_data(_field_default(field))
            edits.append(_replace_value(text, node, *entries[field.name], lines, default))
        else:
            added += text.newline + " " * column + lines
    return [*edits, (bottom, bottom, added)]


def _replace_value(
    text: _LineIndex, trial: yaml.Node, key: yaml.Node, value: yaml.Node, lines: str, default: bool
) -> Edit:
    """Edit that gives a key another value. A value at its default is removed with its lines, unless
    the lines contain something else.
    """
    start, end = text.offset(key.start_mark), text.end(value)
    first, last = text.line_start(start), text.line_end(end)
    has_own_lines = not (text.text[first:start] + text.text[end:last]).strip(_YAML_SPACE)
    if default and has_own_lines and key.start_mark.line != trial.start_mark.line:
        return (first - len(text.newline), last, "")
    return (start, max(start, end), lines)


def _format_entry(entry: Mapping[str, Any], column: int, newline: str) -> str:
    """Formats a key and its value as an entry of a mapping at a column."""
    lines = dump_document(entry).rstrip("\n").split("\n")
    return newline.join([lines[0], *(" " * column + line if line else "" for line in lines[1:])])


def _require_in_order(text: _LineIndex, node: yaml.Node) -> None:
    """Refuses a mapping whose keys and values are not written in order, such as with an alias."""
    last = text.offset(node.start_mark)
    for key, value in node.value:
        for part in (key, value):
            if text.offset(part.start_mark) < last:
                raise InvalidInputError("an alias")
            last = text.offset(part.start_mark)


def _field_default(field: dataclasses.Field[Any]) -> Any:
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default


def _apply_edits(text: str, edits: list[Edit]) -> str:
    for start, end, new in sorted(edits, key=lambda edit: edit[:2], reverse=True):
        text = text[:start] + new + text[end:]
    return text
