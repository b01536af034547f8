"""The pages of documentation and the blocks of code in them, for tests that hold them to it.

A comment of a page right before a block (`<!-- ... -->`) says what is special about it:

- `not run: REASON`: of Python; it is compiled, and what it takes from burg_drake is looked up;
- `run first` and lines of Python: what a reader has at hand, or what holds after the block before;
- `file NAME`: the block is written to that file, for those after it;
- `scene`, `station` or another kind of document (`burg-drake schema`): of YAML; what it is;
- `run`: of commands; they are run, and not only parsed.

A comment anywhere on a page that begins with a line `in tests` replaces text of the page by what
runs faster, one replacement a line: `printed => replacement`. The printed text has to occur exactly
once outside the comment.
"""

from __future__ import annotations

import ast
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt

ROOT = Path(__file__).resolve().parents[1]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("**/[!_]*.md"))]
REPLACEMENTS = re.compile(r"<!-- in tests\n(.*?)-->", re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A block of code of a page, or Python of a comment.

    Attributes:
        line: of the page before its first one, counted from 1.
        language: as the page says; nothing for commands.
        remark: the comment before it.
    """

    page: Path
    line: int
    language: str
    code: str
    remark: str = ""

    @property
    def runs(self) -> bool:
        if self.language == "python":
            return not self.remark.startswith("not run: ")
        return self.remark == "run" or self.remark.startswith("file ")

    @property
    def module(self) -> ast.Module:
        """Its Python, with the page's lines."""
        return ast.parse("\n" * self.line + self.code, str(self.page))

    def commands(self) -> Iterator[list[str]]:
        """The arguments of each `burg-drake` in it; variables of a shell are 1."""
        text = re.sub(r"\$\w+", "1", self.code).replace("\\\n", " ")
        for line in re.findall(r"^(?:\$ |ssh .*? )?burg-drake (.*)$", text, re.MULTILINE):
            yield shlex.split(re.split(r" \\?[>|] ", line)[0], comments=True)


def blocks(page: Path) -> Iterator[Block]:
    """The blocks of a page, in order."""
    text = page.read_text("utf-8")
    lines = [line for comment in REPLACEMENTS.findall(text) for line in comment.splitlines()]
    text = REPLACEMENTS.sub(lambda found: "\n" * found[0].count("\n"), text)
    for printed, small in (line.split(" => ", 1) for line in lines):
        assert text.count(printed) == 1, printed
        text = text.replace(printed, small)
    remark = ""
    for token in MarkdownIt().parse(text):
        line = token.map[0] + 1 if token.map else 0
        comment = re.fullmatch(r"<!--(.*)-->", token.content.strip(), re.DOTALL)
        if token.type == "html_block" and comment:
            remark, _, code = comment[1].strip().partition("\n")
            if remark == "run first":
                yield Block(page, line, "python", code)
            continue
        if token.type == "fence":
            yield Block(page, line, token.info, token.content, remark)
        elif token.type == "code_block":
            yield Block(page, line - 1, "", token.content, remark)
        remark = ""
