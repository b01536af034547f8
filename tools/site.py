"""Builds the documentation site: `python -m tools.site [-o FOLDER]`, which is `make docs`.

Sphinx reads a copy of docs/ in build/site. Pages that code can tell are added to the copy: the
public names, the command line, outcomes and columns, and the gallery of examples. Nothing that is
generated lies in docs/ itself. Comments for tests are left out, links that lead out of docs/ go to
the repository, and each picture and each named script gets a link to its source.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import inspect
import io
import itertools
import re
import shutil
import sys
import tempfile
import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import burg_drake as burg
from burg_drake.apps import build_parser, main as command
from burg_drake.core import COLUMN_FAMILIES, COLUMN_GROUPS, Outcome, Stage

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
BLOB = "https://github.com/burg-drake/burg_drake/blob/main/"

MAIN_NAMES = {
    "Load and save": "load_scene save_scene load_station load_library load_run load_campaign"
    " load_plan read_results",
    "What is loaded": "Scene SceneLike Station StationLike ObjectLibrary Run Campaign Plan",
    "Objects": "build_library ObjectSource BuildReport",
    "Scenes": "sample_scene sample_scenes SceneRecipe check_scene settle_scene print_board"
    " export_scene",
    "Grasps": "sample_grasps SamplingSettings GraspSet",
    "Evaluate": "evaluate EvaluationSettings Outcome Stage Engine ENGINES GraspMotion",
    "Simulate one grasp": "HandTrial ArmTrial TrialSettings TrialResult",
    "The arm": "reach ArmReach Reach ReachSettings plan Planner TimingSettings",
    "Drake diagrams": "build_station_diagram StationDiagram",
    "Training data": "render generate_dataset load_dataset DatasetWriter",
    "Errors": "BurgError",
}
"""Public names of `burg_drake` itself, by what a user wants to do."""

PICTURES = {
    "01_library": "library.png",
    "02_scene": "station.png",
    "03_trial": "replay.png",
    "04_evaluate": "report.png",
    "05_own_diagram": "wsg.png",
    "06_grasps": "grasp_quality.png",
    "07_reach": "reachability.png",
    "08_arm": "film.webp",
    "09_board": "board_loop.png",
    "10_ports": "ports.png",
    "11_scenes": "sampled.png",
    "12_trials": "trials_serve.png",
    "13_training_data": "dataset.png",
}
"""What each example of the gallery is about, in docs/images."""
COMMAND_PICTURES = {
    "burg-drake grasps show runs/first": ("grasps.png", "Grasps of a scene by outcome"),
    "burg-drake setup breakfast.yaml": ("setup.png", "A scene composed in the browser"),
    "burg-drake printout tabletop_six --page A2 -o board.pdf": ("board.png", "The printed board"),
    "burg-drake ar tabletop_six --camera sim:panda_tabletop/board": ("ar.png", "Live overlay"),
    "burg-drake compare runs/first trials.yaml --html compare.html": (
        "compare.png",
        "Simulated and real outcomes",
    ),
    "burg-drake camera calibrate photos/*.jpg -o K.yaml --report calibration.html": (
        "calibration.png",
        "Calibration of a camera",
    ),
}
"""Pictures that commands give, with a title."""
LIVE_RUN = "evaluate tabletop_six --only mug -n 1 --mode arm --quiet"
LIVE_PAGES = {
    "lift.html": ("replay RUN --best", "replay.png", "A grasp, from the approach to the lift"),
    "frames.html": ("frames", "frames.png", "Grasp frames of other projects"),
    "household.html": ("library show household", "household.png", "Built-in objects"),
}
"""Self-contained 3D pages, by the command that writes them, with picture and title. RUN is the
folder that `LIVE_RUN` writes."""


def main() -> int:
    """Builds the site; the exit code is Sphinx's, which takes warnings as errors."""
    parser = argparse.ArgumentParser(description="Build the documentation site.")
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "build" / "docs")
    output = parser.parse_args().output
    code = build_site(output)
    if not code:
        print(f"The site is in {output}: open {output / 'index.html'}")
    return code


def build_site(output: Path, source: Path = ROOT / "build" / "site") -> int:
    """Builds the site.

    Args:
        output: folder that gets the pages in HTML.
        source: folder for the pages that Sphinx reads.

    Returns:
        Sphinx's exit code: 0 without errors and warnings.
    """
    from sphinx.cmd.build import main as sphinx

    if (output / ".buildinfo").exists():  # an earlier site, with pages that may be gone
        shutil.rmtree(output)
    write_source(source)
    options = ["--fail-on-warning", "--keep-going", "--quiet", "--jobs", "auto"]
    code = sphinx([*options, str(source), str(output)])
    if not code:
        _write_live_pages(output / "live")
    return code


def write_source(folder: Path) -> None:
    """Writes all pages that Sphinx reads.

    Args:
        folder: gets them; what was in it is removed.
    """
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(DOCS, folder)
    for page in folder.rglob("*.md"):
        place = DOCS / page.relative_to(folder)
        page.write_text(_for_sphinx(page.read_text("utf-8"), place), "utf-8")
    for name, text in generated_pages().items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"---\ngenerated: true\n---\n\n{_for_sphinx(text, DOCS / name)}", "utf-8")


def generated_pages() -> dict[str, str]:
    """Markdown of the pages that code tells, by path below docs/."""
    return {
        **dict(_python_pages()),
        **dict(_command_pages()),
        "reference/columns.md": _columns_page(),
        "reference/outcomes.md": _outcomes_page(),
        **dict(_gallery_pages()),
    }


def _for_sphinx(text: str, place: Path) -> str:
    """A page without comments, whose links out of docs/ go to the repository, with links to the
    scripts that it names and to those that make its pictures."""

    def link(found: re.Match[str]) -> str:
        target, _, anchor = found[1].partition("#")
        path = (place.parent / target).resolve()
        if not target or "://" in target or path.is_relative_to(DOCS) or not path.exists():
            return found[0]
        return f"]({BLOB}{path.relative_to(ROOT)}{anchor and '#'}{anchor})"

    def picture(found: re.Match[str]) -> str:
        script = picture_script(found[1])
        return f"{found[0]}\n\n[How this picture is made]({BLOB}{script}){{.picture-script}}"

    def script(found: re.Match[str]) -> str:
        known = (ROOT / found[1]).exists()
        return f"[{found[0]}]({BLOB}{found[1]})" if known else found[0]

    text = re.sub(r"^<!--.*?-->\n", "", text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"(?<!\[)`((?:benchmarks|examples|tools)/[\w/]+\.py)[^`\n]*`", script, text)
    text = re.sub(r"^!\[.*\]\([./]*images/([\w.]+)\)$", picture, text, flags=re.MULTILINE)
    return re.sub(r"\]\(([^)\s]+)\)", link, text)


def picture_script(name: str) -> str:
    """The script that makes a picture of docs/images.

    Args:
        name: of the picture's file.

    Returns:
        Path from the root of the repository.

    Raises:
        LookupError: no script in tools/ or benchmarks/ names it.
    """
    wanted = name, f'"{Path(name).stem}": '  # those of the setup page have no ending
    for folder in ("tools", "benchmarks"):
        for path in sorted((ROOT / folder).glob("*.py")):
            code = path.read_text("utf-8")
            if path.stem != "site" and any(text in code for text in wanted):
                return path.relative_to(ROOT).as_posix()
    raise LookupError(f"no script in tools/ or benchmarks/ makes docs/images/{name}")


def _python_pages() -> Iterator[tuple[str, str]]:
    """The public names: one page for `burg_drake` itself, and one for each of its faces."""
    names = {n for n in burg.__all__ if not isinstance(getattr(burg, n), ModuleType)}
    groups = {title: words.split() for title, words in MAIN_NAMES.items()}
    listed = [name for group in groups.values() for name in group]
    if sorted(listed) != sorted(names):
        raise SystemExit(f"MAIN_NAMES lacks or has too many: {names.symmetric_difference(listed)}")
    faces = {n: getattr(burg, n) for n in burg.__all__ if n not in names}
    rows = [f"| [`burg.{name}`]({name}.md) | {_summary(face)} |" for name, face in faces.items()]
    lines = [
        "# Python\n",
        "`import burg_drake as burg` takes a few milliseconds, as names are imported on first use."
        " What you need for most programs is in `burg` itself, on this page; the rest is in"
        " modules by subject:\n",
        "| module | what it has |\n|---|---|",
        *rows,
        "",
    ]
    for title, group in groups.items():
        lines += [f"## {title}\n", *(_entry(burg, name) for name in group)]
    hidden = "\n".join(faces)
    lines.append(f"```{{toctree}}\n:hidden:\n\n{hidden}\n```\n")
    yield "reference/python/index.md", "\n".join(lines)
    for name, face in faces.items():
        public = getattr(face, "__all__", None) or [n for n in vars(face) if n[0] != "_"]
        members = [n for n in public if not isinstance(getattr(face, n), ModuleType)]
        text = inspect.cleandoc(face.__doc__ or "")
        entries = "\n".join(_entry(face, member) for member in members)
        yield f"reference/python/{name}.md", f"# burg.{name}\n\n{text}\n\n{entries}"


def _summary(face: ModuleType) -> str:
    return " ".join((face.__doc__ or "").partition("\n\n")[0].split())


def _entry(face: ModuleType, name: str) -> str:
    """A directive of Sphinx that documents a public name."""
    value = getattr(face, name)
    path = f"{face.__name__}.{name}"
    if inspect.isclass(value):
        # Fields of named tuples, and those of outcomes, are explained in the text of the class.
        fields = ", ".join(getattr(value, "_fields", ("meaning",) if value is Outcome else ()))
        options = "   :members:\n" + "   :undoc-members:\n" * issubclass(value, str)
        options += f"   :exclude-members: {fields}\n" * bool(fields)
        directive = f".. autoclass:: {path}\n{options}"
    elif callable(value) and hasattr(value, "__code__"):
        directive = f".. autofunction:: {path}\n"
    else:
        text = textwrap.indent(_comment_of(face, name), "   ")
        directive = f".. py:data:: {path}\n\n{text}\n"
    return f"```{{eval-rst}}\n{directive}```\n"


def _comment_of(face: ModuleType, name: str) -> str:
    """The docstring below the assignment of a constant or type alias, where it is assigned."""
    stub = Path(str(face.__file__)).with_suffix(".pyi")
    source = stub if stub.exists() else Path(str(face.__file__))
    for node in ast.walk(ast.parse(source.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                if (alias.asname or alias.name) == name:
                    package = face.__package__ if node.level else ""
                    module = ".".join(filter(None, (package, node.module)))
                    return _comment_of(sys.modules[module], alias.name)
    body = ast.parse(source.read_text("utf-8")).body
    for node, after in itertools.pairwise(body):
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        found = any(isinstance(target, ast.Name) and target.id == name for target in targets)
        if found and isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            return inspect.cleandoc(str(after.value.value))
    raise SystemExit(f"{source}: {name} has no docstring below its assignment")


def _command_pages() -> Iterator[tuple[str, str]]:
    """The command line: a page for each verb."""
    parser = build_parser()
    lines = ["# Command line\n", f"{parser.description}\n"]
    for group in parser._action_groups:
        verbs = re.findall(r"^(\S+)\s+(.*)$", group.description or "", re.MULTILINE)
        if verbs:
            lines.append(f"## {str(group.title).capitalize()}\n\n| | |\n|---|---|")
            lines += [f"| [`burg-drake {verb}`]({verb}.md) | {text} |" for verb, text in verbs]
            lines.append("")
    verbs = _verbs(parser)
    toctree = "\n".join(verbs)
    lines.append(f"```{{toctree}}\n:hidden:\n\n{toctree}\n```\n")
    yield "reference/commands/index.md", "\n".join(lines)
    for name, verb in verbs.items():
        yield f"reference/commands/{name}.md", _verb_text(verb, "#")


def _verbs(parser: argparse.ArgumentParser) -> dict[str, Any]:
    """The parsers of the verbs below a parser."""
    actions = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    return {name: verb for action in actions for name, verb in action.choices.items()}


def _verb_text(parser: Any, level: str) -> str:
    """What the help of a verb says, and that of the verbs below it."""
    usage = parser.format_usage().removeprefix("usage: ").strip()
    lines = [f"{level} {parser.prog}\n", f"{parser.description}\n", f"```text\n{usage}\n```\n"]
    formatter = parser._get_formatter()
    for group in parser._action_groups:
        actions = [
            action
            for action in group._group_actions
            if action.help is not argparse.SUPPRESS
            and not isinstance(action, argparse._SubParsersAction)
        ]
        if actions:
            lines.append(f"**{_escaped(str(group.title).capitalize())}**\n")
            if group.description:
                lines.append(f"{group.description}\n")
            verb = parser.prog.partition(" ")[2].replace(" ", "-")
            lines += [_option_text(formatter, action, verb) for action in actions]
    if parser.epilog:
        lines.append(_epilog(parser.epilog))
    lines += [_verb_text(verb, level + "#") for verb in _verbs(parser).values()]
    return "\n".join(lines)


def _option_text(formatter: argparse.HelpFormatter, action: argparse.Action, verb: str) -> str:
    """An option with its help, which links reach as `#VERB-OPTION`."""
    text = formatter._expand_help(action) if action.help else ""
    name = (action.option_strings or [action.dest])[-1].lstrip("-").replace("_", "-")
    invocation = formatter._format_action_invocation(action)
    return f"`{invocation}`{{#{verb}-{name}}}\n: {_escaped(text)}\n"


def _escaped(text: str) -> str:
    """Text in which Markdown sees no mark-up but code, and options are code."""
    text = re.sub(r"(?<![\w`-])--[a-z][\w-]*(?!\w*`)", r"`\g<0>`", text)
    return re.sub(r"([*_<>\[\]])(?=(?:[^`]*`[^`]*`)*[^`]*$)", r"\\\1", text)


def _epilog(text: str) -> str:
    """Examples as a block of code, other paragraphs as text."""
    head, _, rest = text.partition("\n\n")
    commands = textwrap.dedent(head.partition("\n")[2]).strip("\n")
    examples = f"```sh\n{commands}\n```\n" if head.startswith("examples:") else f"{head}\n"
    return f"{examples}\n{_escaped(rest)}\n"


def _columns_page() -> str:
    text = (
        "# Columns\n\nOf results, reach tables and grasp sets, with their units. `1` is a number"
        " without a unit, `g` is 9.81 m/s², and `weights` are those of the object."
        " [Files of a run](results.md) tells how files carry this along.\n"
    )
    for title, columns in {
        **COLUMN_GROUPS,
        "Names with a part that differs": COLUMN_FAMILIES,
    }.items():
        rows = (f"`{n}` | {c.unit} | {c.description}" for n, c in columns.items())
        text += f"\n## {title}\n\n{_table('column | unit | meaning', rows)}"
    return text


def _outcomes_page() -> str:
    text = (
        "# Outcomes\n\nEvery grasp ends with one of them; the first stage that it does not pass"
        " decides. [Outcomes and margins](../concepts/outcomes.md) explains how to read them.\n"
    )
    for stage in Stage:
        rows = (f"`{o}` | {o.meaning}" for o in Outcome if o.stage is stage)
        text += f"\n## {stage.capitalize()}\n\n{_table('outcome | meaning', rows)}"
    return text


def _gallery_pages() -> Iterator[tuple[str, str]]:
    """The gallery, and a page for each example."""
    cards = []
    examples = sorted((ROOT / "examples").glob("[0-9]*.py"))
    printed = printed_by_examples()
    names = {path.stem for path in examples}
    if wrong := sorted(names ^ set(PICTURES)):
        raise SystemExit(
            f"tools/site.py: PICTURES lacks or has too many: {', '.join(wrong)}; it names for each"
            " program in examples/ the file in docs/images that is shown beside it"
        )
    if wrong := sorted(names ^ set(printed)):
        raise SystemExit(
            f"examples/README.md lacks or has too many: {', '.join(wrong)}; it shows what each"
            " program prints"
        )
    for path in examples:
        code = path.read_text("utf-8")
        summary, _, rest = (ast.get_docstring(ast.parse(code)) or "").partition("\n\n")
        title = path.stem.partition("_")[2].replace("_", " ").capitalize()
        page = f"gallery/{path.stem}"
        yield (
            f"{page}.md",
            f"# {title}\n\n{summary}\n\n{rest}\n\n![{title}](../images/{PICTURES[path.stem]})\n\n"
            f"[examples/{path.name}]({BLOB}examples/{path.name}):\n\n```python\n{code}```\n\n"
            f"It prints:\n\n```text\n{printed[path.stem]}```\n",
        )
        cards.append(_card(title, summary, PICTURES[path.stem], page, "doc"))
    toctree = "\n".join(f"gallery/{name}" for name in PICTURES)
    commands = [
        f"### {title}\n\n![{title}](images/{picture})\n\n```sh\n{command}\n```\n"
        for command, (picture, title) in COMMAND_PICTURES.items()
    ]
    live = [
        _card(title, "Turn it with the mouse; some megabytes.", picture, f"live/{page}", "url")
        for page, (_, picture, title) in LIVE_PAGES.items()
    ]
    yield (
        "gallery.md",
        "# Gallery\n\n## Programs\n\nEach card opens a program in `examples/`, with what it prints."
        f" Its picture shows what the program is about.\n\n{_grid(cards)}\n"
        f"## In 3D\n\n{_grid(live)}\n"
        "## Commands\n\nRuns, trials and photos in these commands are your own.\n\n"
        + "\n".join(commands)
        + f"\n```{{toctree}}\n:hidden:\n\n{toctree}\n```\n",
    )


def printed_by_examples() -> dict[str, str]:
    """What each program in examples/ prints, as its README shows it."""
    text = (ROOT / "examples" / "README.md").read_text("utf-8")
    return dict(
        re.findall(r"^## \[(\w+)\.py\].*?```text\n(.*?)```", text, re.DOTALL | re.MULTILINE)
    )


def _card(title: str, text: str, picture: str, link: str, kind: str) -> str:
    return (
        f":::{{grid-item-card}} {title}\n:img-top: images/{picture}\n:img-alt: {title}\n"
        f":link: {link}\n:link-type: {kind}\n\n{text}\n:::\n"
    )


def _grid(cards: list[str]) -> str:
    body = "\n".join(cards)
    return f"::::{{grid}} 1 2 2 3\n:gutter: 3\n:class-container: gallery\n\n{body}\n::::\n"


def _write_live_pages(folder: Path) -> None:
    """Runs the commands that write 3D pages."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        run = str(Path(temporary) / "run")
        commands = [[*LIVE_RUN.split(), "-o", run]]
        for name, (line, _, _) in LIVE_PAGES.items():
            words = [run if word == "RUN" else word for word in line.split()]
            commands.append([*words, "--html", str(folder / name)])
        for words in commands:
            with contextlib.redirect_stdout(io.StringIO()):
                code = command(words)
            if code:
                raise SystemExit(code)


def _table(head: str, rows: Iterable[str]) -> str:
    rule = "|".join("---" for _ in head.split("|"))
    return "\n".join(f"| {row} |" for row in (head, rule, *rows)) + "\n"


if __name__ == "__main__":
    sys.exit(main())
