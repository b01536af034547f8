"""The command as a whole: help, version, exit codes, errors in one line."""

from __future__ import annotations

import inspect
import json
import os
import shlex
import signal
import subprocess
import sys

import pytest

from burg_drake import __version__
from burg_drake.apps import DEFAULT_STATION, cli
from burg_drake.apps.commands import evaluate
from burg_drake.core import InvalidInputError, UnknownNameError, builtin_names

COMMANDS = [command for commands in cli.COMMANDS.values() for command in commands]
GROUPS = [command.words.split() for command in COMMANDS if command.module is None]
HELP = [[], *(command.words.split() for command in COMMANDS if command.words != "completion")]
"""Commands whose help is tested; the examples of `completion` are for several shells."""


@pytest.mark.parametrize("verb", HELP, ids=" ".join)
def test_help(verb: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main([*verb, "--help"])
    assert ended.value.code == 0
    text = capsys.readouterr().out
    assert text.startswith(f"usage: burg-drake {' '.join(verb)}".strip())
    if verb not in GROUPS:
        assert "examples:\n  burg-drake " in text


@pytest.mark.parametrize("columns", [80, 120])
def test_help_fits_the_terminal(
    columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    for verb in HELP:
        with pytest.raises(SystemExit):
            cli.build_parser().parse_args([*verb, "--help"])
        lines = capsys.readouterr().out.splitlines()
        wide = [line for line in lines if len(line) > min(columns, 100)]
        assert [line for line in wide if not line.startswith("  burg-drake ")] == []


@pytest.mark.parametrize("verb", [[], *GROUPS], ids=" ".join)
def test_the_help_lists_each_verb_in_one_line(
    verb: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit):
        cli.main([*verb, "--help"])
    listed = [line.split()[0] for line in capsys.readouterr().out.splitlines() if "  " in line[2:]]
    with pytest.raises(SystemExit):
        cli.main([*verb, "zzz"])
    known = capsys.readouterr().err.partition("known: ")[2].partition(" (see")[0]
    named, _, others = known.partition(" and ")
    listed = [name for name in listed if name != "--version"]
    assert set(named.split(", ")) <= set(listed)
    assert len(listed) == len(set(listed)) == named.count(",") + 1 + int(others[:-7] or 0)


def test_examples_of_the_help_can_be_parsed(capsys: pytest.CaptureFixture[str]) -> None:
    parser = cli.build_parser()
    for verb in HELP:
        with pytest.raises(SystemExit):
            parser.parse_args([*verb, "--help"])
        for line in capsys.readouterr().out.splitlines():
            if line.startswith("  burg-drake "):
                parser.parse_args(shlex.split(line)[1:])


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys, json\nfrom burg_drake.apps.cli import main\n"
        "try: main(['evaluate', '--help'])\nexcept SystemExit: pass\n"
        "print('MODULES', json.dumps(sorted(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    modules = json.loads(done.stdout.split("MODULES ")[1])
    heavy = ("pydrake", "trimesh", "scipy", "numpy", "rich", "cv2", "coacd", "embreex", "yaml")
    heavy += ("pandas", "pyarrow", "distributed", "dask")
    assert [name for name in heavy if name in modules] == []


def test_help_imports_no_other_command() -> None:
    code = """
import contextlib, importlib, io, os, sys
from burg_drake.apps.cli import COMMANDS, main
from burg_drake.dataset import SceneRenderer  # imports once what many commands need

def command_modules():
    return {name for name in sys.modules if name.startswith("burg_drake.apps.commands.")}

def print_help(words):
    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
        main([*words.split(), "--help"])

print_help("")
assert command_modules() == set()
for command in (command for commands in COMMANDS.values() for command in commands):
    if os.fork() == 0:  # each command in a process of its own
        if command.module is not None:
            importlib.import_module(f"burg_drake.apps.commands.{command.module}")
        own_modules = command_modules()
        print_help(command.words)
        assert command_modules() == own_modules, (command, command_modules() - own_modules)
        os._exit(0)
    if os.wait()[1]:
        sys.exit(1)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"burg-drake {__version__}\n"


def test_as_a_process() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "burg_drake.apps.cli", "scene", "validate", "nowhere"],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert done.stdout == ""
    names = ", ".join(builtin_names("scenes"))
    assert done.stderr == f"burg-drake: error: scene nowhere does not exist; known: {names}\n"


@pytest.mark.parametrize("arguments", [[], ["scene"], ["nonsense"], ["evaluate", "--sead", "1"]])
def test_usage_errors_are_one_line(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(arguments)
    assert ended.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith("burg-drake: error: ")
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "verb"),
    [
        (["--sead", "report", "a"], "burg-drake"),
        (["evaluate", "a", "--sead", "1"], "burg-drake evaluate"),
        (["grasps", "stats", "a", "b", "c"], "burg-drake grasps stats"),
        (["hand", "list", "--all"], "burg-drake hand list"),
    ],
)
def test_what_is_not_known_leads_to_the_help_of_its_verb(
    arguments: list[str], verb: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        cli.main(arguments)
    error = capsys.readouterr().err
    assert "unrecognized arguments: " in error
    assert error.endswith(f"(see {verb} --help)\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["evalute", "a"], "'evalute'; did you mean 'evaluate'? Known: "),
        (["scene", "setle"], "'setle'; did you mean 'settle'? Known: "),
        (["evaluate", "a", "--engine", "standart"], "'standart'; did you mean 'standard'? Known: "),
        (["evaluate", "a", "--grasp-per-object=5"], "=5; did you mean '--grasps-per-object'? (see"),
        (["evaluate", "a", "--zzz"], "unrecognized arguments: --zzz (see "),
        (["scene", "sample", "a", "--ouput", "b"], "--ouput; did you mean '--output'? (see "),
    ],
)
def test_the_nearest_of_what_is_misspelt_is_named(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        cli.main(arguments)
    assert message in capsys.readouterr().err


def run_with(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> int:
    """Exit code of a command that ends with an error."""

    def fail(arguments: object) -> int:
        raise error

    monkeypatch.setattr("burg_drake.apps.commands.runs.run_report", fail)
    monkeypatch.setattr(cli, "build_parser", inspect.unwrap(cli.build_parser))
    return cli.main(["report", "somewhere"])


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (InvalidInputError("two\nlines"), 2, "burg-drake: error: two lines"),
        (UnknownNameError("no 'x' here"), 2, "burg-drake: error: no 'x' here"),
        (KeyboardInterrupt(), 130, "burg-drake: interrupted"),
        (InvalidInputError("a\x1b[2Jb\0 \udcff"), 2, r"burg-drake: error: a\x1b[2Jb\x00 \udcff"),
        (InvalidInputError("9" * 5000), 2, f"burg-drake: error: {'9' * 297}..."),
        (
            MemoryError("Unable to allocate 9 TiB"),
            2,
            "burg-drake: error: there is not enough memory for this input. Unable to allocate 9"
            " TiB",
        ),
    ],
)
def test_how_it_ends(
    error: BaseException,
    code: int,
    line: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.delenv("BURG_DEBUG", raising=False)
    assert run_with(monkeypatch, error) == code
    assert capsys.readouterr().err == f"{line}\n"


def test_an_interrupt_behind_another_error_is_an_interrupt(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As when Ctrl-C comes while a module in C++ is imported."""
    monkeypatch.delenv("BURG_DEBUG", raising=False)
    failed = ImportError("initialization failed")
    failed.__cause__ = KeyboardInterrupt()
    late = InvalidInputError("too late")
    late.__context__ = failed
    for error in (failed, late):
        assert run_with(monkeypatch, error) == 130
        assert capsys.readouterr().err == "burg-drake: interrupted\n"


def test_further_interrupts_change_nothing() -> None:
    code = (
        "import os, signal, sys\nfrom burg_drake.apps import cli\n"
        "from burg_drake.apps.commands import runs\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "def interrupt(*_): os.kill(os.getpid(), signal.SIGINT)\n"
        "runs.run_report = interrupt\nsys.argv[1:] = ['report', 'somewhere']\n"
        "code = cli.main()\ninterrupt()\ninterrupt()\nsys.exit(code)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (130, "burg-drake: interrupted\n")


def test_what_goes_on_later_ends_on_sigterm_as_on_ctrl_c(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(arguments: object) -> int:
        signal.raise_signal(signal.SIGTERM)
        return 0

    monkeypatch.setattr(evaluate, "run_evaluate", run)
    monkeypatch.setattr(cli, "build_parser", inspect.unwrap(cli.build_parser))
    assert cli.main(["evaluate", "tabletop_six"]) == 130
    assert "interrupted; run the same command to continue" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_debug_shows_where_an_error_came_from(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("BURG_DEBUG", "1")
    with pytest.raises(InvalidInputError):
        run_with(monkeypatch, InvalidInputError("x"))


@pytest.mark.parametrize("bug", [ZeroDivisionError, RecursionError, BrokenPipeError])
def test_bugs_are_not_hidden(monkeypatch: pytest.MonkeyPatch, bug: type[Exception]) -> None:
    with pytest.raises(bug):
        run_with(monkeypatch, bug())


def test_a_missing_system_library_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("BURG_DEBUG", raising=False)
    gone = ImportError("libX.so.1: cannot open shared object file: No such file or directory")
    assert run_with(monkeypatch, gone) == 2
    assert capsys.readouterr().err.count("\n") == 1
    with pytest.raises(ImportError):
        run_with(monkeypatch, ImportError("No module named 'x'"))


@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
def test_a_reader_that_goes_away_is_no_error() -> None:
    done = subprocess.run(
        f"{sys.executable} -m burg_drake.apps.cli library list household | head -1",
        shell=True,
        capture_output=True,
        text=True,
    )
    assert done.stderr == ""


def test_names_that_are_no_text_are_printed() -> None:
    code = (
        "import sys\nfrom burg_drake.apps import cli\nfrom burg_drake.apps.commands import runs\n"
        "runs.run_report = lambda _: print('\\udcff') or 0\nsys.argv[1:] = ['report', 'x']\n"
        "sys.exit(cli.main())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "\\udcff\n", "")


def test_the_station_by_default_is_there() -> None:
    assert DEFAULT_STATION in builtin_names("stations")
