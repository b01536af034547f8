"""Planners in every form: what they answer, how they fail, and that they can be asked again."""

from __future__ import annotations

import importlib
import math
import os
import pickle
import shlex
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import burg_drake
from burg_drake.benchmark import planners
from burg_drake.core import (
    BurgError,
    InvalidInputError,
    MissingDependencyError,
    UnknownNameError,
)
from tests.benchmark.planner_programs import (
    ANSWERS,
    command,
    observation,
    same,
    served,
    write_program,
)
from tests.hang_guard import HANG_GUARD, until

PlannerError, open_planner = planners.PlannerError, planners.open_planner

MODULE = """\
import os, signal, sys, time
import numpy as np
import beside

LOADED = beside.count_load()

class OwnError(Exception):
    def __init__(self, one, two):
        super().__init__(f"{one} and {two}")

class OwnText(str):
    pass

def boom():
    raise OwnError("this", "that")

def crash():
    os.kill(os.getpid(), signal.SIGSEGV)

def hang():
    time.sleep(60.0)

def stubborn():
    signal.signal(signal.SIGALRM, signal.SIG_IGN)
    time.sleep(60.0)

def exhaust():
    np.ones(1 << 50)

ACTIONS = {1: boom, 2: lambda: os._exit(0), 3: hang, 4: crash, 5: lambda: sys.exit("enough"),
           6: lambda: None, 7: lambda: {"score": object()}, 8: exhaust,
           9: lambda: {"X_CG": np.zeros((1 << 23, 4))}, 10: stubborn,
           11: lambda: {"X_CG": [[1.0], [1.0, 2.0]]},
           12: lambda: {"X_CG": "none", "score": [[float("nan")]], "name": OwnText("text")}}

def plan(observation):
    if observation.target in ACTIONS:
        return ACTIONS[observation.target]()
    return {**vars(beside)["ANSWERS"], "pid": os.getpid(), "loaded": LOADED, **observation.arrays()}

class Method:
    def __init__(self):
        self.width = 0.05

    def plan(self, observation):
        return {"width": self.width}

method = Method()

def two(observation, camera): ...

def factory(): ...

NUMBER = 5
"""
BESIDE = """\
import pickle
from pathlib import Path

ANSWERS = pickle.loads(Path(__file__).with_name("answers.pickle").read_bytes())

def count_load():
    path = Path(__file__).with_name("loads.txt")
    with path.open("a") as file:
        file.write("loaded\\n")
    return len(path.read_text().splitlines())
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with a module of planners and one that it needs."""
    (tmp_path / "own_planners.py").write_text(MODULE)
    (tmp_path / "beside.py").write_text(BESIDE)
    (tmp_path / "answers.pickle").write_bytes(pickle.dumps(ANSWERS))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def is_alive(pid: int) -> bool:
    status = Path(f"/proc/{pid}/stat")
    return status.exists() and status.read_text().rpartition(")")[2].split()[0] != "Z"


# --- functions ------------------------------------------------------------------------------------


def test_a_function_fails_in_any_way_and_is_asked_again(folder: Path) -> None:
    def answers() -> dict[str, Any]:
        found = planner.ask(asked)
        for name, value in (*asked.arrays().items(), *ANSWERS.items()):
            # Pickling makes the order of bytes that of this machine.
            native = value.astype(value.dtype.newbyteorder("=")) if name == "width" else value
            assert same(found[name], native), name
        assert found["observation"] == asked.id
        return found

    asked = observation(target=100)
    with open_planner("own_planners:plan", time_limit=1.0) as planner:
        assert (planner.name, planner.reference) == ("own_planners:plan",) * 2
        assert not planner.knows_meshes
        first = answers()
        assert first["pid"] != os.getpid()
        line = MODULE.splitlines().index('    raise OwnError("this", "that")') + 1
        stays = {
            1: rf"it raised OwnError: this and that \(own_planners\.py:{line}\)",
            6: "it raised TypeError: the planner returned NoneType, not a dict with grasps",
            7: r"it raised TypeError: score is object '<object object at 0x\w+>', not numbers",
            8: r"it raised MemoryError: Unable to allocate .* \(own_planners\.py:\d+\)",
            9: "it raised ValueError: the answer has 268,435,456 bytes; at most 67,108,864",
            11: "it raised TypeError: X_CG cannot be made an array: .*",
        }
        for target, message in stays.items():
            with pytest.raises(PlannerError, match=message) as raised:
                planner.ask(observation(target))
            assert str(raised.value).startswith("planner own_planners:plan: it raised")
            assert "\n" not in str(raised.value)
        assert answers()["pid"] == first["pid"]
        dies = {
            2: "it crashed; the worker process ended: exit code 0$",
            3: "no answer within 1 s, its time limit; make it faster, or give it more time$",
            4: "it crashed; the worker process was killed by SIGSEGV$",
            5: "it crashed; the worker process ended: SystemExit: enough$",
        }
        for target, message in dies.items():
            begun = time.monotonic()
            with pytest.raises(PlannerError, match=message):
                planner.ask(observation(target))
            assert time.monotonic() - begun < 20.0
        last = answers()
        assert last["pid"] != first["pid"] and last["loaded"] == 5 and first["loaded"] == 1
        os.kill(last["pid"], signal.SIGKILL)  # while it is idle, as for lack of memory
        until(lambda: not is_alive(last["pid"]))
        last = answers()
    assert not is_alive(last["pid"])


def test_what_can_be_sent_is_passed_on(folder: Path) -> None:
    """Others check answers, as those of all forms."""
    with open_planner("own_planners:plan") as planner:
        found = planner.ask(observation(12))
    assert found["X_CG"] == "none" and type(found["name"]) is str
    assert found["score"].shape == (1, 1) and math.isnan(found["score"][0, 0])
    assert 0.0 < found["time"] < 10.0


def test_the_function_cannot_switch_the_time_limit_off(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(planners, "SIGNAL_MARGIN", 0.3)
    monkeypatch.setattr(planners, "LOADING_TIMEOUT", HANG_GUARD)
    with open_planner("own_planners:plan", time_limit=0.5) as planner:
        pid = planner.ask(observation(100))["pid"]
        with pytest.raises(PlannerError, match=r"no answer within 0\.5 s"):
            planner.ask(observation(10))
        until(lambda: not is_alive(pid))
        assert planner.ask(observation(100))["pid"] != pid


def test_files_and_methods_of_objects(
    folder: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    with open_planner("own_planners:method.plan") as planner:
        assert planner.ask(observation())["width"] == 0.05
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    monkeypatch.chdir(elsewhere)
    reference = f"{os.path.relpath(folder)}/own_planners.py:method.plan"
    with open_planner(reference) as planner:
        assert planner.name == "own_planners:method.plan"
        assert planner.ask(observation())["width"] == 0.05
    (elsewhere / "random.py").write_text(
        "import sys\n"
        "def plan(observation): return {'same': sys.modules['random'].__file__ == __file__}\n"
    )
    with open_planner("random.py:plan") as planner:  # of the same name as a module of Python
        assert not planner.ask(observation())["same"]


@pytest.mark.parametrize(
    ("reference", "kind", "message"),
    [
        ("antipodl", UnknownNameError, "'antipodl' is unknown; did you mean 'antipodal'? Known: "),
        ("ends", UnknownNameError, "planner ends names no function; give ends.py:plan, or"),
        ("http://localhost:9000", UnknownNameError, "give ws://localhost:9000"),
        ("", UnknownNameError, "planner '' is unknown; known: antipodal, "),
        (":plan", UnknownNameError, "is unknown"),
        ("own_planners:", UnknownNameError, "is unknown"),
        ("own_planners.py", UnknownNameError, "names no function; give own_planners.py:plan"),
        ("nowhere.py:plan", InvalidInputError, "there is no file /"),
        (
            "nowhere:plan",
            InvalidInputError,
            "planner nowhere:plan: nowhere cannot be imported: ModuleNotFoundError: No module named"
            " 'nowhere'; modules are searched in the working directory and on PYTHONPATH",
        ),
        ("broken:plan", InvalidInputError, "No module named 'torsh' (broken.py:2)"),
        ("ends:plan", InvalidInputError, "SystemExit: usage: ends (ends.py:2)"),
        (
            "crashes:plan",
            PlannerError,
            "could not be loaded: the worker process ended: exit code 5",
        ),
        (
            "own_planners:plam",
            UnknownNameError,
            "own_planners has no 'plam'; did you mean 'plan'? Known: ",
        ),
        ("own_planners:method.plam", UnknownNameError, "own_planners has no 'method.plam'"),
        ("own_planners:Method", InvalidInputError, "Method is a class; name a function"),
        ("own_planners:NUMBER", InvalidInputError, "NUMBER is int, no function"),
        ("own_planners:two", InvalidInputError, "two(observation, camera) cannot be: missing"),
        ("own_planners:factory", InvalidInputError, "factory() cannot be: too many positional"),
        ("command:", InvalidInputError, "command: names no program"),
        ("command:'python", InvalidInputError, "command:'python: No closing quotation"),
        ("command:no_such_python x.py", InvalidInputError, "there is no program 'no_such_python'"),
        ("command:./own_planners.py", InvalidInputError, "there is no program './own_planners.py'"),
        (
            "ws://127.0.0.1:1",
            PlannerError,
            "no server answers there: [Errno 111] Connection refu",
        ),
        ("ws://", PlannerError, "planner ws:// is not a planner"),
        (
            "ws://127.0.0.1:99999",
            PlannerError,
            "planner ws://127.0.0.1:99999 is not a planner: ",
        ),
    ],
)
def test_what_cannot_be_opened_is_one_clear_line(
    reference: str, kind: type[BurgError], message: str, folder: Path
) -> None:
    (folder / "broken.py").write_text("import os\nimport torsh\n")
    (folder / "ends.py").write_text("import sys\nsys.exit('usage: ends')\n")
    (folder / "crashes.py").write_text("import os\nos._exit(5)\n")
    with pytest.raises(kind) as raised:
        open_planner(reference)
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)
    assert type(raised.value) is kind
    assert raised.value.arguments == ("planner",)


@pytest.mark.parametrize("limit", [0.0, -1.0, 1e10, math.inf, math.nan])
def test_the_time_limit_is_a_time(limit: float) -> None:
    with pytest.raises(InvalidInputError, match="the time limit of a planner is"):
        open_planner("antipodal", time_limit=limit)


def test_a_module_that_breaks_meanwhile_is_an_error(folder: Path) -> None:
    with open_planner("own_planners:plan", time_limit=5.0) as planner:
        (folder / "own_planners.py").write_text("import torsh")
        planner.ask(observation(100))
        for message in ("it crashed", "cannot be loaded again: .*torsh", "torsh"):
            with pytest.raises(PlannerError, match=message):
                planner.ask(observation(4))
        (folder / "own_planners.py").write_text(MODULE)
        assert planner.ask(observation(100))["loaded"] == 2


TALKATIVE = """\
import os, sys, time
print("loading")

def plan(observation):
    print("looking")
    os.write(1, b"not from Python\\n")
    print("warning", file=sys.stderr)
    if observation.target == 1:
        raise ValueError("no weights")
    if observation.target == 2:
        os._exit(5)
    if observation.target == 3:
        time.sleep(60.0)
    return {"score": [1.0]}
"""


def test_the_last_lines_that_a_function_printed_are_told(folder: Path) -> None:
    (folder / "talks.py").write_text(TALKATIVE)
    printed = "; its last lines: looking | not from Python | warning"
    with open_planner("talks:plan", time_limit=1.0) as planner:
        assert planner.ask(observation())["score"] == [1.0]
        for target, message in {
            1: "it raised ValueError: no weights (talks.py:9)",
            2: "it crashed; the worker process ended: exit code 5",
            3: "no answer within 1 s, its time limit; make it faster, or give it more time",
        }.items():
            with pytest.raises(PlannerError) as raised:
                planner.ask(observation(target))
            assert str(raised.value).endswith(f"{message}{printed}")


def test_what_a_function_prints_can_be_shown(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (folder / "talks.py").write_text(TALKATIVE)
    with open_planner("talks:plan", show_output=True) as planner:
        planner.ask(observation())
    assert capfd.readouterr() == ("", "loading\nlooking\nnot from Python\nwarning\n")
    with open_planner("talks:plan") as planner:
        planner.ask(observation())
    assert capfd.readouterr() == ("", "")


def test_the_content_of_a_planner_is_that_of_its_file(folder: Path) -> None:
    def content(reference: str) -> str:
        with open_planner(reference) as planner:
            return planner.content

    (folder / "package").mkdir()
    (folder / "package" / "method.py").write_text("def plan(observation): ...\n")
    (folder / "copy.py").write_text("def plan(observation): ...\n")
    first = content("copy.py:plan")
    assert first == content("package.method:plan") == content("package/method.py:plan")
    assert len(first) == 16 and first != content("own_planners:plan")
    (folder / "copy.py").write_text("def plan(observation): ... \n")
    assert content("copy.py:plan") != first
    assert content("top_down") == f"burg_drake {burg_drake.__version__}"
    assert content(f"command:{shlex.join(command(folder / 'copy.py'))}") == ""


def interrupt_soon(begun: Callable[[], object]) -> None:
    """Sends this process a Ctrl-C as soon as a condition is true."""

    def wait() -> None:
        until(begun)
        time.sleep(0.2)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=wait, daemon=True).start()


@pytest.mark.parametrize("reference", ["own_planners:plan", "command"])
def test_an_interrupt_ends_what_works(reference: str, folder: Path) -> None:
    if reference == "command":
        program = folder / "sleeps.py"
        program.write_text("import os, time\nopen('pid', 'w').write(str(os.getpid()))\n")
        with program.open("a") as file:
            file.write("os.rename('pid', 'begun')\ntime.sleep(60.0)\n")
        reference = f"command:{shlex.join(command(program))}"
    else:
        text = MODULE.replace("    time.sleep(60.0)", "    beside.begin()", 1)
        (folder / "own_planners.py").write_text(text)
        with (folder / "beside.py").open("a") as file:
            file.write("def begin():\n    import os, time\n")
            file.write("    open('pid', 'w').write(str(os.getpid()))\n")
            file.write("    os.rename('pid', 'begun')\n    time.sleep(60.0)\n")
    with open_planner(reference) as planner:
        interrupt_soon((folder / "begun").exists)
        with pytest.raises(KeyboardInterrupt):
            planner.ask(observation(3))
        pid = int((folder / "begun").read_text())
        until(lambda: not is_alive(pid))


# --- built-in planners ----------------------------------------------------------------------------


def test_the_built_in_planners_are_there() -> None:
    for name, planner in planners.BUILTIN_PLANNERS.items():
        module, _, function = planner.function.partition(":")
        found = importlib.import_module(f"burg_drake.benchmark.{module}")
        assert callable(getattr(found, function)), name


def test_the_oracle_is_given_the_scene(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And nobody else is; here, a function of our own stands for it."""
    (folder / "told.py").write_text(
        "def oracle(observation, scene, station):\n"
        "    return {'told': f'{scene} {station}', 'observation': observation.id}\n"
    )
    monkeypatch.syspath_prepend(folder)
    loader = planners.FunctionLoader("oracle", "told", "oracle")
    monkeypatch.setattr(planners, "FunctionLoader", lambda *_: loader)
    with open_planner("oracle") as planner:
        assert planner.knows_meshes
        with pytest.raises(InvalidInputError, match="planner oracle needs the scene and the"):
            planner.ask(observation())
        answer = planner.ask(observation(5), "scene", "station")  # type: ignore[arg-type]
        assert answer["told"] == "scene station" and answer["observation"] == observation(5).id


# --- programs -------------------------------------------------------------------------------------


def program(folder: Path, text: str) -> str:
    """Reference to a Python program that gets the paths as `files`."""
    path = folder / "a program.py"
    path.write_text(f"import sys, os, time\nfiles = sys.argv[1:]\n{text}\n")
    return f"command:{shlex.join(command(path))}"


def test_a_program_answers_to_the_bit(tmp_path: Path) -> None:
    path = write_program(tmp_path)
    with open_planner(f"command:{shlex.join(command(path))}") as planner:
        assert planner.name == "my_planner"
        asked = observation()
        answers = [planner.ask(asked) for _ in range(2)]
        for name, value in asked.arrays().items():
            assert same(answers[0][f"seen_{name}"], value), name
        assert "burg_drake" not in answers[0]["modules"].split()
        assert answers[0]["pid"] != answers[1]["pid"]
        assert 0.0 < answers[0]["time"] < 5.0
        with pytest.raises(PlannerError) as raised:
            planner.ask(observation(1))
        assert "the program ended with exit code 1; its last lines: " in str(raised.value)
        assert str(raised.value).endswith("| ValueError: no object | at all")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "print('too hot', file=sys.stderr); os._exit(3)",
            "ended with exit code 3; its last lines: too hot",
        ),
        (
            "sys.exit('first\\n\\n  no robot\\x1b[2J')",
            "exit code 1; its last lines: first | no rob",
        ),
        ("os.kill(os.getpid(), 11)", "the program ended with SIGSEGV, and no message"),
        ("os.kill(os.getpid(), 40)", "the program ended with signal 40, and no message"),
        ("print('no answer', file=sys.stderr)", "the program wrote no answer; its last lines: no"),
        ("open(files[1], 'wb').write(b'nonsense')", "its answer cannot be read: answer.npz is not"),
        ("open(files[1], 'wb')", "its answer cannot be read: answer.npz is not"),
        ("os.mkdir(files[1])", "its answer cannot be read: cannot read answer.npz: it is a "),
        (
            "os.symlink('/dev/zero', files[1])",
            "its answer cannot be read: cannot read answer.npz: it is a ",
        ),
        (
            "import numpy; numpy.savez(files[1], X_CG=numpy.array([{}]))",
            "its answer cannot be read: answer.npz: X_CG",
        ),
        (
            "import numpy\nnumpy.savez_compressed(files[1], X_CG=numpy.zeros(1 << 20))\n"
            "data = open(files[1], 'rb').read().replace(b'1048576,', b'9048576,')\n"
            "open(files[1], 'wb').write(data[:-40])",
            "its answer cannot be read: answer.npz is not",
        ),
        ("for _ in range(9999): print('much', file=sys.stderr)", "its last lines: much | much |"),
    ],
)
def test_programs_that_fail(text: str, message: str, tmp_path: Path) -> None:
    with open_planner(program(tmp_path, text)) as planner:
        assert planner.name == "a program"
        with pytest.raises(PlannerError) as raised:
            planner.ask(observation())
        assert message in str(raised.value)
        assert str(raised.value).isprintable() and len(str(raised.value)) < 1500


def test_a_program_that_hangs_is_ended_with_its_children(tmp_path: Path) -> None:
    text = (
        "import subprocess\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'])\n"
        f"open({str(tmp_path / 'pids')!r}, 'w').write(f'{{os.getpid()}} {{child.pid}}')\n"
        "time.sleep(60)"
    )
    with (
        open_planner(
            program(tmp_path, text), time_limit=1.0, limit_source="the budget of two"
        ) as planner,
        pytest.raises(PlannerError, match="no answer within 1 s, the budget of two; make it"),
    ):
        planner.ask(observation())
    pids = (tmp_path / "pids").read_text().split()
    assert len(pids) == 2
    until(lambda: not any(is_alive(int(pid)) for pid in pids))


def test_a_program_that_cannot_be_started(tmp_path: Path) -> None:
    path = tmp_path / "damaged"
    path.write_bytes(b"\x7fELF")
    path.chmod(0o755)
    with (
        open_planner(f"command:{path}") as planner,
        pytest.raises(PlannerError, match="the program cannot be started: Exec format error"),
    ):
        planner.ask(observation())
    gone = tmp_path / "gone"
    gone.symlink_to(sys.executable)
    with open_planner(f"command:{gone}") as planner:
        gone.unlink()
        with pytest.raises(PlannerError, match="cannot be started: No such file or directory"):
            planner.ask(observation())


def test_a_program_in_another_language_needs_no_time(tmp_path: Path) -> None:
    """The time around its run is that of planning."""
    text = "import numpy; time.sleep(0.2); numpy.savez(files[1], X_CG=numpy.eye(4)[None])"
    with open_planner(program(tmp_path, text)) as planner:
        answer = planner.ask(observation())
    assert answer.keys() == {"X_CG", "time"} and 0.2 < answer["time"] < 20.0


# --- servers --------------------------------------------------------------------------------------


def test_a_server_goes_down_and_comes_back(tmp_path: Path) -> None:
    path = write_program(tmp_path)
    with served(path) as (url, process):
        planner = open_planner(url, time_limit=1.0)
        assert (planner.name, planner.reference) == ("my_planner", url)
        assert planner.ask(observation())["pid"] == process.pid
        with pytest.raises(PlannerError, match="the server reports ValueError: no object at all"):
            planner.ask(observation(1))
        for target, message in {7: "ValueError: [?]", 8: "SystemExit: enough"}.items():
            with pytest.raises(PlannerError, match=f"the server reports {message}"):
                planner.ask(observation(target))
        with pytest.raises(PlannerError, match="no answer within 1 s"):
            planner.ask(observation(6))
        assert planner.ask(observation())["pid"] == process.pid  # late answers cost no others
        with pytest.raises(PlannerError, match="no answer within 1 s"):
            planner.ask(observation(3))
    with pytest.raises(PlannerError, match=r"no server answers .*Connection refused"):
        planner.ask(observation())
    with planner, served(path, int(url.rpartition(":")[2])) as (again, process):
        assert again == url
        assert planner.ask(observation())["pid"] == process.pid
        with pytest.raises(PlannerError, match="the server cannot be reached: the planner closed"):
            planner.ask(observation(2))  # ends the server
        assert process.wait(HANG_GUARD) == 3


def test_a_server_that_was_restarted_between_two_questions_costs_nothing(tmp_path: Path) -> None:
    path = write_program(tmp_path)
    with served(path) as (url, process):
        planner = open_planner(url)
        assert planner.ask(observation())["pid"] == process.pid
    with planner, served(path, int(url.rpartition(":")[2])) as (_, process):
        assert planner.ask(observation())["pid"] == process.pid


@pytest.mark.parametrize("package", ["msgpack", "websockets"])
def test_missing_packages_are_named(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = planners.importlib.util.find_spec
    monkeypatch.setattr(
        planners.importlib.util,
        "find_spec",
        lambda name: None if name == package else found(name),
    )
    text = rf"planners over websockets need {package}: pip install 'burg-drake\[benchmark\]'"
    with pytest.raises(MissingDependencyError, match=text):
        open_planner("ws://127.0.0.1:9000")


def test_the_names_of_servers_are_plain(monkeypatch: pytest.MonkeyPatch) -> None:
    class Remote:
        def __init__(self, url: str, timeout: float) -> None:
            self.name = names.pop(0)

        def close(self) -> None: ...

    names = ["", "\x1b[31m red\n", "x" * 500]
    monkeypatch.setattr(planners, "RemotePlanner", Remote)
    opened = [open_planner("ws://127.0.0.1:9000").name for _ in range(3)]
    assert opened == ["ws://127.0.0.1:9000", "[31m red", f"{'x' * 57}..."]
