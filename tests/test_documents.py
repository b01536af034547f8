"""What the documents say is so: links lead somewhere, names exist, commands and YAML fit.

Their Python runs in `test_document_code`.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
import textwrap
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from burg_drake.apps import build_parser
from burg_drake.cameras import Intrinsics
from burg_drake.core import DOCUMENT_KINDS, document_class, parse_document
from burg_drake.evaluation import ClusterDocument
from burg_drake.experiment import TrialSheet
from burg_drake.pipeline import RecipeDocument
from burg_drake.scene import SceneDocument
from burg_drake.station import Hand, StationDocument
from tests.pages import PAGES, ROOT, Block, blocks
from tests.test_faces import public_names
from tools.site import generated_pages, picture_script

SCHEMAS = {
    "name: breakfast": SceneDocument,
    "dictionary: ARUCO": SceneDocument,
    "name: desk": SceneDocument,
    "hand: wsg_50": StationDocument,
    "hand: robotiq_2f85.yaml": StationDocument,
    "kind: inverse_dynamics": StationDocument,
    "least_lift: ": StationDocument,
    "coupled: true": Hand,
    "focal: ": Intrinsics,
    "stratum: ": TrialSheet,
    "tls: {": ClusterDocument,
    "jobqueue:": ClusterDocument,
    "{mesh: ": RecipeDocument,
}
"""By words of a document in YAML, what it is, unless its first line or a comment says so."""
PARTS = {
    SceneDocument: "version: 1\nname: part\nlibrary: household\n",
    StationDocument: "version: 1\nname: part\n",
}
"""What stands before a part of such a document."""
BLOCKS = {page: list(blocks(page)) for page in PAGES}


def ids(value: Any) -> str:
    page = value if isinstance(value, Path) else value.page
    name = page.relative_to(ROOT).with_suffix("").as_posix()
    return name if page is value else f"{name}:{value.line}"


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_links_lead_somewhere(page: Path) -> None:
    for target, anchor in re.findall(r"\]\(([^)#\s]*)#?([^)\s]*)\)", page.read_text("utf-8")):
        if "://" not in target:
            there = page.parent / target if target else page
            assert there.exists() or there.resolve() in generated(), target
            assert not anchor or anchor in anchors(there), f"{target}#{anchor}"


@cache
def generated() -> set[Path]:
    """Pages that only the site has."""
    return {ROOT / "docs" / name for name in generated_pages()}


def anchors(page: Path) -> set[str]:
    """Of the headings, as GitHub makes them; the site adds one for each kind of document."""
    titles = re.findall(r"^#+ (.*)$", page.read_text("utf-8"), re.MULTILINE)
    if page.name == "documents.md":
        titles += DOCUMENT_KINDS
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_names_in_the_text_exist(page: Path) -> None:
    for code in re.findall(r"`[^`\n]+`", page.read_text("utf-8")):
        for name in re.findall(r"\bburg(?:_drake)?((?:\.[A-Za-z_]\w*)+)\b", code):
            pkgutil.resolve_name(f"burg_drake{name}")


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_paths_in_the_text_exist(page: Path) -> None:
    rooms = "burg_drake|benchmarks|docs|examples|models|tests|tools"
    for path in re.findall(rf"`((?:{rooms})/[\w./*-]*)`", page.read_text("utf-8")):
        assert list(ROOT.glob(path)), path


NOT_RUN = [b for page in PAGES for b in BLOCKS[page] if b.language == "python" and not b.runs]


@pytest.mark.parametrize("block", NOT_RUN, ids=ids)
def test_what_does_not_run_is_about_what_there_is(block: Block) -> None:
    require_existing(block.module)


EXAMPLES = {
    ".".join(filter(None, ("burg", face, name))): textwrap.dedent(found[1])
    for face, names in public_names().items()
    for name, value in names.items()
    if (found := re.search(r"^Example::\n\n((?: .*\n|\n)+)", f"{inspect.getdoc(value)}\n", re.M))
}
"""Code in docstrings, by public name."""


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_of_docstrings_are_about_what_there_is(name: str) -> None:
    loader = f"burg.load_{name.rpartition('.')[2].lower()}"
    assert any(f"{call}{end}" in EXAMPLES[name] for call in (name, loader) for end in "(.")
    require_existing(ast.parse(EXAMPLES[name], name))


def test_functions_of_the_main_road_have_examples() -> None:
    functions = {n for n, value in public_names()[""].items() if inspect.isfunction(value)}
    assert {f"burg.{name}" for name in functions} <= EXAMPLES.keys()


def require_existing(module: ast.Module) -> None:
    """What code takes from packages exists, and its calls fit the signatures."""
    names: dict[str, Any] = {"burg": importlib.import_module("burg_drake")}
    for node in ast.walk(module):
        if isinstance(node, ast.Import):
            for alias in node.names:
                names[alias.asname or alias.name] = importlib.import_module(alias.name)
        elif isinstance(node, ast.ImportFrom):
            package = importlib.import_module(str(node.module))
            names |= {a.asname or a.name: getattr(package, a.name) for a in node.names}
    for node in ast.walk(module):
        if isinstance(node, ast.Attribute):
            looked_up(node, names)
        elif isinstance(node, ast.Call) and (called := looked_up(node.func, names)):
            given = {keyword.arg: None for keyword in node.keywords if keyword.arg}
            inspect.signature(called).bind(*node.args, **given)


def looked_up(node: ast.expr, names: dict[str, Any]) -> Any:
    """What an expression of names stands for; None for what only a run would make."""
    if isinstance(node, ast.Name):
        return names.get(node.id)
    if isinstance(node, ast.Attribute):
        owner = looked_up(node.value, names)
        return None if owner is None else getattr(owner, node.attr)
    return None


def test_a_script_makes_each_picture() -> None:
    for path in (ROOT / "docs" / "images").iterdir():
        picture_script(path.name)


PARSER = build_parser()
COMMANDS = [b for page in PAGES for b in BLOCKS[page] if any(b.commands())]


@pytest.mark.parametrize("block", COMMANDS, ids=ids)
def test_commands_are_understood(block: Block) -> None:
    for arguments in block.commands():
        PARSER.parse_args(arguments)


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_commands_in_the_text_exist(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They are often cut short: verb and options have to be known, others may be missing."""
    for code in re.findall(r"`burg-drake ([^`\n]+)`", page.read_text("utf-8")):
        try:
            PARSER.parse_args(re.sub(r"[][]", "", re.split(r" \\?[>|] ", code)[0]).split())
        except SystemExit as end:
            told = capsys.readouterr().err
            assert not end.code or "required" in told or "expected" in told, told


DOCUMENTS = [b for page in PAGES for b in BLOCKS[page] if b.language == "yaml"]


@pytest.mark.parametrize("block", DOCUMENTS, ids=ids)
def test_yaml_fits_its_schema(block: Block) -> None:
    code = block.code
    if line := re.match(r"# (?:yaml-language-server: )?\$schema[=:] ?\S*?/?(\w+)\.json\n", code):
        schema, code = document_class(line[1]), code[line.end() :]
        if not code:  # the line alone
            return
    elif block.remark in DOCUMENT_KINDS:
        schema = document_class(block.remark)
    else:
        (schema,) = [schema for words, schema in SCHEMAS.items() if words in code]
    if not code.startswith("version: "):
        code = PARTS[schema] + code
    parse_document(code, schema, block.page.name)


UNCLEAR = re.compile(
    r"\bof which\b|\bsuch an? [a-z]|\banew\b|\b(?:is|are) none of\b|\bwhat there is\b"
    r"|\b[wW]hat became of\b"
)
"""Phrases that readers of earlier pages and messages had to read twice."""


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_pages_read_plainly(page: Path) -> None:
    if "contributing" not in page.parts:
        text = re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.DOTALL)
        assert UNCLEAR.findall(text) == []


def test_messages_read_plainly() -> None:
    """All strings of the package but docstrings: messages, help, reports and pages."""
    found = []
    for path in (ROOT / "burg_drake").rglob("*.py"):
        nodes = list(ast.walk(ast.parse(path.read_text("utf-8"))))
        docstrings = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
        for node in nodes:
            text = getattr(node, "value", None) if isinstance(node, ast.Constant) else None
            if isinstance(text, str) and id(node) not in docstrings and UNCLEAR.search(text):
                found.append(f"{path.relative_to(ROOT)}:{node.lineno}: {text}")
    assert found == []
