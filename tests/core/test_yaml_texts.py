"""Texts of YAML files against PyYAML's own loader of texts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from burg_drake.core import DocumentError, load_plain_yaml


def random_tree(rng: np.random.Generator, depth: int) -> Any:
    kind = rng.integers(0, 3) if depth else 0
    if kind == 0:
        values = [None, True, 1.5, -3, "a: b", "", "null", "ü", 1e-9, "two\nlines", "'\""]
        return values[rng.integers(0, len(values))]
    n = rng.integers(0, 4)
    if kind == 1:
        return [random_tree(rng, depth - 1) for _ in range(n)]
    return {f"key {i}": random_tree(rng, depth - 1) for i in range(n)}


@pytest.mark.parametrize("flow", [True, False, None])
def test_texts_are_those_of_pyyaml(tmp_path: Path, flow: bool | None) -> None:
    rng = np.random.default_rng(2)
    path = tmp_path / "a.yaml"
    for _ in range(40):
        tree = {"top": random_tree(rng, 4)}
        tree["again"] = tree["top"]  # an anchor, where it is a structure
        path.write_text(yaml.safe_dump(tree, default_flow_style=flow), encoding="utf-8")
        assert load_plain_yaml(path) == yaml.load(path.read_text(encoding="utf-8"), yaml.BaseLoader)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "the document is empty"),
        ("# nothing\n", "the document is empty"),
        ("a: 1\nb: 2\na: 3\n", r"a\.yaml:3: 'a' appears twice"),
        ("a: {b: 1, b: 2}\n", r"a\.yaml:1: 'b' appears twice"),
        ("? [1, 2]\n: 3\n", r"a\.yaml:1: a key is a list or a mapping"),
        ("a: *b\n", r"a\.yaml:1: alias \*b has no anchor"),
        ("a: &b [*b]\n", r"a\.yaml:1: alias \*b has no anchor"),
        ("a: [1, 2\n", r"a\.yaml:\d: not valid YAML"),
        ("a: 1\n  b: 2\n", r"a\.yaml:2: not valid YAML"),
        ("\t- a", r"not valid YAML"),
    ],
)
def test_errors_name_file_and_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(text)
    with pytest.raises(DocumentError, match=said):
        load_plain_yaml(path)


def test_files_that_are_not_there_or_not_text(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match="cannot read"):
        load_plain_yaml(tmp_path / "none.yaml")
