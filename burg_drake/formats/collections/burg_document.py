"""What the YAML files of BURG-Toolkit have in common.

`YAMLObject.dump_yaml_data` in burg_toolkit/io.py (github.com/mrudorfer/burg-toolkit) writes them:
`yaml_file_type` and `yaml_file_version` say what a file is, keys are sorted, what is not known is
null, and paths are relative to the file, in the writer's spelling: with backslashes from Windows.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import yaml

from burg_drake.core import nearest, quoted
from burg_drake.core.documents import Reader

MatrixRow = tuple[float, float, float, float]
Matrix = tuple[MatrixRow, MatrixRow, MatrixRow, MatrixRow]
"""A pose as lists of numbers."""


class BurgReader(Reader):
    """Leaves aside keys that the schema lacks.

    Attributes:
        notes: what was left aside, one sentence each.
    """

    def __init__(self, name: str, skipped: Collection[str] = ()) -> None:
        """Begins to read a document.

        Args:
            name: of the file.
            skipped: keys that are left aside without a note.
        """
        super().__init__(name)
        self.skipped = skipped
        self.notes: list[str] = []

    def read_dataclass(self, node: yaml.Node, kind: type, where: str) -> Any:
        known = kind.__dataclass_fields__  # type: ignore[attr-defined]
        if isinstance(node, yaml.MappingNode):
            pairs = []
            for key, (key_node, value) in self.entries(node, where).items():
                if key in known:
                    pairs.append((key_node, value))
                    continue
                if key in self.skipped:
                    continue
                place = f" {where}:" if where else ""
                self.notes.append(
                    f"{self.name}:{key_node.start_mark.line + 1}:{place} unknown key "
                    f"{key!r} was ignored; {nearest(key, known)}"
                )
            node = yaml.MappingNode(node.tag, pairs, node.start_mark, node.end_mark)
        return super().read_dataclass(node, kind, where)

    def item_lines(self, node: yaml.Node, key: str) -> list[int]:
        """Where the items of a list of the document begin."""
        entries = self.entries(node, "")
        return (
            [item.start_mark.line + 1 for item in entries[key][1].value] if key in entries else []
        )

    def check_kind(
        self, node: yaml.Node, type: str, version: str, title: str, hints: Mapping[str, str]
    ) -> None:
        """Refuses other files.

        Args:
            node: the document.
            type: expected `yaml_file_type`.
            version: expected `yaml_file_version`.
            title: what such a file is, for people.
            hints: what to do about files of other types.

        Raises:
            DocumentError: it is no such file, or of another version.
        """
        entries = self.entries(node, "")
        for key, expected in (("yaml_file_type", type), ("yaml_file_version", version)):
            if key not in entries:
                raise self.fail(
                    node,
                    key,
                    f"missing; if this is {title} of an early BURG-Toolkit, which did not write"
                    f" it, add the lines 'yaml_file_type: {type}' and"
                    f" 'yaml_file_version: \"{version}\"'",
                )
            value = entries[key][1]
            given = value.value if isinstance(value, yaml.ScalarNode) else "a structure"
            if given != expected:
                hint = f"; {hints[given]}" if given in hints else ""
                raise self.fail(
                    value, key, f"{quoted(given)} cannot be read; expected {expected!r}{hint}"
                )


def relocated(given: str | None, folder: Path) -> Path | None:
    """A file that a document in `folder` names; where it is not, the longest end of its path that
    there is.

    A library that was moved without what lay outside of its folder, or that names files of another
    machine, still finds `/home/someone/library/meshes/mug.obj` as `meshes/mug.obj`.
    """
    if not given:
        return None
    parts = given.replace("\\", "/")
    named = folder / parts
    if os.path.exists(named):  # in contrast to Path.exists, no error for names that are too long
        return named
    names = [name for name in parts.split("/") if name not in ("", ".", "..")]
    ends = (folder.joinpath(*names[i:]) for i in range(len(names)))
    return next((end for end in ends if os.path.isfile(end)), named)
