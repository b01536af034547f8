"""The gallery shows what programs print: each line is one that the program can print.

Figures differ between machines and versions, so the words alone are compared.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

import pytest

from tools.site import ROOT, printed_by_examples

PRINTED = printed_by_examples()


def patterns(code: str) -> Iterator[str]:
    """A regular expression for each call of print: its literal words, and anything for values."""
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "print":
            yield " *".join(map(pattern, node.args))


def pattern(text: ast.expr) -> str:
    if isinstance(text, ast.JoinedStr):
        return "".join(map(pattern, text.values))
    return re.escape(str(text.value)) if isinstance(text, ast.Constant) else ".*"


@pytest.mark.parametrize("name", PRINTED)
def test_examples_print_what_their_list_shows(name: str) -> None:
    able = list(patterns((ROOT / "examples" / f"{name}.py").read_text("utf-8")))
    for line in PRINTED[name].splitlines():
        assert any(re.fullmatch(words, line) for words in able), (
            f"examples/README.md: {name}.py cannot print {line!r}: run it, and copy what it prints"
        )
