"""What the documents say is so: links lead somewhere, code runs, commands and YAML fit.

The Python of a page runs as it is printed, one block after the other, in a folder of its own. A
comment of the page right before a block (`<!-- ... -->`) says what is different:

- `not run: REASON`: it is compiled, and what it takes from burg_drake is looked up;
- `run first` and lines of Python: what a reader has at hand, and the blocks take for granted;
- `file NAME`: the block is written to that file, for those after it;
- `run`: commands are run, and not only parsed.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from markdown_it import MarkdownIt

from burg_drake.apps.cli import build_parser, main
from burg_drake.cameras.optics.intrinsics import Intrinsics
from burg_drake.core.documents.schema import parse_document
from burg_drake.evaluation.cluster.document import ClusterDocument
from burg_drake.evaluation.workers.executor import LocalExecutor
from burg_drake.experiment.trials.sheet import TrialSheet
from burg_drake.scene.document.scene import SceneDocument
from burg_drake.station.document.gripper_document import Hand
from burg_drake.station.document.station_document import StationDocument
from burg_drake.system_libraries import missing_render_libraries
from tests.evaluation.inline_executor import Inline

ROOT = Path(__file__).resolve().parents[1]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]
SMALLER = {
    "README": {
        "grasps_per_object=100)": "grasps_per_object=2, engine='screening', only=['mug'])",
        "scene, station, 50, ": "scene, station, 8, ",
        "scene, station, 500)": "scene, station, 1, only=['mug', 'box'])",
        "burg.reach(scene, station, grasps)": "burg.reach(scene, station, grasps, workers=1)",
        "AdvanceTo(plan.duration)": "AdvanceTo(0.1)",
        '"runs/best", grasps=best)': '"runs/best", grasps=best, engine="screening")',
    },
    "reach": {"motion=low)\nrun": "motion=low, grasps_per_object=1, only=['mug'])\nrun"},
    "scenes": {
        '"close", 1000, workers=2)': '"close", 1)',
        "size=(0.594, 0.420)), height": "size=(0.1, 0.1)), height",
        "count_grasps(scene, station)": "count_grasps(scene, station, grasps_per_object=5)",
        "duration=0.5)": "duration=0.05)",
    },
}
"""What is printed, and what is run in its place, as it is quick."""
HOLDS = {
    "README": [
        "isinstance(plan, burg.Plan) and burg.load_plan('plan.json')",
        "result.outcome in set(burg.Outcome)",
        "len(judged.column('blocker')) == 8",
        "burg.load_run('runs/python').complete and burg.load_run('runs/best').complete",
        "burg.load_scene('breakfast.yaml').instances",
    ],
    "scenes": ["plant.Finalize() or plant.num_bodies() == 1 + 6 + 1"],
}
"""What is true after a page has run."""
SCHEMAS = {
    "name: breakfast": SceneDocument,
    "dictionary: ARUCO": SceneDocument,
    "hand: wsg_50": StationDocument,
    "kind: inverse_dynamics": StationDocument,
    "least_lift: ": StationDocument,
    "coupled: true": Hand,
    "focal: ": Intrinsics,
    "stratum: ": TrialSheet,
    "tls: {": ClusterDocument,
    "jobqueue:": ClusterDocument,
}
"""By words of a document in YAML, what it is."""
PARTS = {
    SceneDocument: "version: 1\nname: part\nlibrary: household\n",
    StationDocument: "version: 1\nname: part\n",
}
"""What stands before a part of such a document."""


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
            yield shlex.split(line.partition(" > ")[0], comments=True)


def blocks(page: Path) -> Iterator[Block]:
    text = page.read_text("utf-8")
    for printed, small in SMALLER.get(page.stem, {}).items():
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


BLOCKS = {page: list(blocks(page)) for page in PAGES}


def ids(value: Any) -> str:
    return value.stem if isinstance(value, Path) else f"{value.page.stem}:{value.line}"


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_links_lead_somewhere(page: Path) -> None:
    for target, anchor in re.findall(r"\]\(([^)#\s]*)#?([^)\s]*)\)", page.read_text("utf-8")):
        if "://" not in target:
            there = page.parent / target if target else page
            assert there.exists(), target
            assert not anchor or anchor in anchors(there), f"{target}#{anchor}"


def anchors(page: Path) -> set[str]:
    """Of the headings, as GitHub makes them."""
    titles = re.findall(r"^#+ (.*)$", page.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_names_in_the_text_exist(page: Path) -> None:
    for code in re.findall(r"`[^`\n]+`", page.read_text("utf-8")):
        for name in re.findall(r"\bburg(?:_drake)?((?:\.[A-Za-z_]\w*)+)\b", code):
            pkgutil.resolve_name(f"burg_drake{name}")


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_paths_in_the_text_exist(page: Path) -> None:
    rooms = "burg_drake|benchmarks|docs|examples|models|tests|tools|\\.github"
    for path in re.findall(rf"`((?:{rooms})/[\w./*-]*)`", page.read_text("utf-8")):
        assert list(ROOT.glob(path)), path


@pytest.mark.parametrize("page", [p for p in PAGES if any(b.runs for b in BLOCKS[p])], ids=ids)
def test_blocks_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if "camera" in page.read_text("utf-8") and missing_render_libraries():
        pytest.skip("the renderer's system libraries are missing")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(LocalExecutor, "judge", lambda self, *jobs: Inline().judge(*jobs))
    monkeypatch.setattr("burg_drake.evaluation.run.scene_processes.preparers", lambda workers: 0)
    names: dict[str, Any] = {}
    for block in filter(lambda block: block.runs, BLOCKS[page]):
        if block.language == "python":
            exec(compile(block.module, str(page), "exec"), names)
        elif block.remark.startswith("file "):
            Path(block.remark.removeprefix("file ")).write_text(block.code, "utf-8")
        else:
            assert [main(arguments) for arguments in block.commands()].count(0)
    for fact in HOLDS.get(page.stem, []):
        assert eval(fact, names), fact


NOT_RUN = [b for page in PAGES for b in BLOCKS[page] if b.language == "python" and not b.runs]


@pytest.mark.parametrize("block", NOT_RUN, ids=ids)
def test_what_does_not_run_is_about_what_there_is(block: Block) -> None:
    names: dict[str, Any] = {"burg": importlib.import_module("burg_drake")}
    for node in ast.walk(block.module):
        if isinstance(node, ast.Import):
            for alias in node.names:
                names[alias.asname or alias.name] = importlib.import_module(alias.name)
        elif isinstance(node, ast.ImportFrom):
            module = importlib.import_module(str(node.module))
            names |= {a.asname or a.name: getattr(module, a.name) for a in node.names}
    for node in ast.walk(block.module):
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


PARSER = build_parser()
COMMANDS = [b for page in PAGES for b in BLOCKS[page] if any(b.commands())]


@pytest.mark.parametrize("block", COMMANDS, ids=ids)
def test_commands_are_understood(block: Block) -> None:
    for arguments in block.commands():
        PARSER.parse_args(arguments)


DOCUMENTS = [b for page in PAGES for b in BLOCKS[page] if b.language == "yaml"]


@pytest.mark.parametrize("block", DOCUMENTS, ids=ids)
def test_yaml_fits_its_schema(block: Block) -> None:
    (schema,) = [schema for words, schema in SCHEMAS.items() if words in block.code]
    code = block.code
    if not code.startswith("version: "):
        code = PARTS[schema] + code
    parse_document(code, schema, block.page.name)
