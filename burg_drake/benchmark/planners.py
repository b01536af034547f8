"""Planners by reference: built-in ones, functions, programs and servers, asked in one way.

Whatever a planner does (crash, hang, exhaust the memory, answer nonsense) costs one answer: `ask`
raises `PlannerError`, and the planner can be asked again.
"""

from __future__ import annotations

import abc
import errno
import importlib
import importlib.util
import os
import re
import shlex
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from burg_drake.benchmark.burg_planner import (
    Observation,
    RemotePlanner,
    serve,
    write_arrays,
)
from burg_drake.benchmark.planner_functions import (
    FunctionError,
    FunctionLoader,
    call_function,
    clean_text,
    is_loaded,
    module_content,
)
from burg_drake.core import (
    NUMBER_KINDS,
    BurgError,
    InvalidInputError,
    MissingDependencyError,
    Session,
    Task,
    TaskCancelled,
    TimeLimit,
    UnknownNameError,
    WorkerDied,
    WorkerFuture,
    WorkerPool,
    content_hash,
    default_workers,
    open_npz,
    quote_value,
    report_read_errors,
    software_versions,
    suggest_names,
)

if TYPE_CHECKING:
    from burg_drake.scene import SceneLike
    from burg_drake.station import StationLike

LOADING_TIMEOUT = 300.0
"""Seconds to import a planner's module, with the models that it loads."""
MAX_TIME_LIMIT = 1e6
"""Largest time for an answer [s]."""
SIGNAL_MARGIN = 5.0
"""Seconds after a limit until a worker is killed that the system's timer has not ended."""


class PlannerError(BurgError):
    """A planner failed: on one observation, after which it can be asked again, or at opening."""


class PlannerLost(PlannerError):
    """The planner cannot be asked any more, such as a server that has ended."""


@dataclass(frozen=True)
class BuiltinPlanner:
    """A planner that comes with burg_drake.

    Attributes:
        function: its module in `burg_drake.benchmark`, and its function.
        uses: what of an observation it uses.
        summary: what it does.
    """

    function: str
    uses: str
    summary: str


BUILTIN_PLANNERS: Mapping[str, BuiltinPlanner] = {
    "antipodal": BuiltinPlanner(
        "baselines:antipodal",
        "depth",
        "antipodal grasps on the visible surfaces, in the manner of GPD",
    ),
    "top_down": BuiltinPlanner(
        "baselines:top_down", "depth", "straight down, across the shorter axis of each object"
    ),
    "random": BuiltinPlanner(
        "baselines:random_grasps",
        "depth",
        "random hands at visible points, tilted by up to 60 degrees",
    ),
    "oracle": BuiltinPlanner(
        "oracle_planner:oracle",
        "meshes, arm, physics",
        "grasps that were tried in simulation: a bound for planners, not a planner for a robot",
    ),
}
"""Built-in planners by name."""

REFERENCE_FORMS: Mapping[str, str] = {
    "my_module:plan": "function of a module in the working directory or on PYTHONPATH",
    "folder/my_planner.py:plan": "function of a file",
    "ws://127.0.0.1:9000": "server: a program that ends with burg_planner.run(plan)",
    "command:my_env/bin/python my_planner.py": (
        "program that gets two more arguments, the files of observation and answer (.npz)"
    ),
}
"""Examples of references to other planners, and what each refers to."""


def open_planner(
    reference: str,
    *,
    time_limit: float = 60.0,
    limit_source: str = "its time limit",
    show_output: bool = False,
) -> GraspPlanner:
    """Opens a planner; use it in a `with` block.

    Built-in planners and functions run in a process of their own, with one thread for linear
    algebra. The function is loaded once; it is called as `function(observation)`, and returns the
    dict that `burg_planner` describes.

    Args:
        reference: name of a built-in planner (`BUILTIN_PLANNERS`), or another reference
            (`REFERENCE_FORMS`).
        time_limit: time for each answer [s]; for a command, with the start of its program.
        limit_source: what sets this limit, for the message about an answer that takes longer.
        show_output: whether what a function prints goes to standard error; if not, the last lines
            are in the message about its failure.

    Raises:
        UnknownNameError: there is no such planner, or its module has no such function.
        InvalidInputError: the reference cannot be used, such as a module that cannot be imported.
        PlannerError: the planner crashed while it was loaded, or no server answers.
        MissingDependencyError: the packages for websockets are missing.
    """
    if not 0.0 < time_limit <= MAX_TIME_LIMIT:
        raise InvalidInputError(
            f"the time limit of a planner is {time_limit:g} s; give a time above 0, at most"
            f" {MAX_TIME_LIMIT:g} s"
        ).about("time_limit")
    if reference.startswith("command:"):
        opened: GraspPlanner = _CommandPlanner(reference, time_limit)
    elif re.match("wss?://", reference):
        opened = _ServedPlanner(reference, time_limit)
    else:
        opened = _open_function(reference, time_limit, show_output=show_output)
    opened.limit_source = f"10 times {limit_source}" if opened.knows_meshes else limit_source
    return opened


def _open_function(reference: str, time_limit: float, *, show_output: bool) -> _FunctionPlanner:
    if reference in BUILTIN_PLANNERS:
        module, _, function = BUILTIN_PLANNERS[reference].function.partition(":")
        loader = FunctionLoader(reference, f"burg_drake.benchmark.{module}", function)
        knows_meshes = reference == "oracle"
        if knows_meshes:  # simulation takes longer than any planner may
            time_limit *= 10.0
        return _FunctionPlanner(
            loader, reference, time_limit, knows_meshes=knows_meshes, show_output=show_output
        )
    module, _, function = reference.rpartition(":")
    if not module or not all(part.isidentifier() for part in function.split(".")):
        raise _unknown_planner(reference)
    path = Path(module).expanduser().absolute() if module.endswith(".py") else None
    if path is not None and not path.is_file():
        raise InvalidInputError(f"planner {reference}: there is no file {path}").about("planner")
    name = f"{path.stem}:{function}" if path else reference
    loader = FunctionLoader(reference, module, function, folder=os.getcwd(), path=path)
    return _FunctionPlanner(loader, name, time_limit, show_output=show_output)


def _unknown_planner(reference: str) -> UnknownNameError:
    file = reference if reference.endswith(".py") else f"{reference}.py"
    if file == reference or Path(file).is_file():
        return UnknownNameError(
            f"planner {reference} names no function; give {file}:plan, or whatever the function is"
            " called"
        ).about("planner")
    if reference.startswith("http://"):
        return UnknownNameError(
            f"planner {reference} is no websocket; give ws://{reference.removeprefix('http://')}"
        ).about("planner")
    return UnknownNameError(
        f"planner {quote_value(reference)} is unknown; {suggest_names(reference, BUILTIN_PLANNERS)}"
        f"; others: {', '.join(REFERENCE_FORMS)}"
    ).about("planner")


class GraspPlanner(abc.ABC):
    """A planner that can be asked; made by `open_planner`. Ask from one thread at a time.

    Attributes:
        reference: reference by which it was opened.
        name: short name for tables.
        knows_meshes: whether it needs the scene, and so is no planner for a robot.
        content: hash of the file that has its function, or for a built-in planner the version of
            burg_drake; empty for servers and commands.
        limit_source: what sets its time limit, for messages.
    """

    def __init__(self, reference: str, name: str, time_limit: float) -> None:
        self.reference, self.name = reference, name
        self.knows_meshes = False
        self.content = self.limit_source = ""
        self._time_limit = time_limit

    def ask(
        self,
        observation: Observation,
        scene: SceneLike | None = None,
        station: StationLike | None = None,
    ) -> dict[str, Any]:
        """The planner's answer: arrays, texts and numbers by name, with `time` [s]; not checked.

        Args:
            observation: the observation.
            scene: the observed scene, for a planner that knows the meshes.
            station: the station of the scene, likewise.

        Raises:
            PlannerError: the planner failed, or took too long. It can be asked again.
        """
        begun = time.perf_counter()
        try:
            answer = self._answer(observation, scene, station)
        except TimeoutError as error:
            raise PlannerError(
                f"planner {self.reference}: no answer within {self._time_limit:g} s,"
                f" {self.limit_source}; make it faster, or give it more"
                f" time{clean_text(self._last_output(), 500)}"
            ) from error
        except _AnswerFailure as error:
            raise PlannerError(
                f"planner {self.reference}: {clean_text(f'{error}{self._last_output()}', 1000)}"
            ) from error
        if answer.get("time") is None:
            answer["time"] = time.perf_counter() - begun
        return answer

    @abc.abstractmethod
    def _answer(
        self, observation: Observation, scene: SceneLike | None, station: StationLike | None
    ) -> dict[str, Any]:
        """The answer.

        Raises:
            TimeoutError: the planner took too long.
            _AnswerFailure: it failed.
        """

    def _last_output(self) -> str:
        """End of a message with the last lines that the planner printed, if they are kept."""
        return ""

    @abc.abstractmethod
    def close(self) -> None:
        """Ends the planner's process or connection."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _AnswerFailure(Exception):
    """A planner failed on an observation; the message begins with what it did."""


# --- functions, in a worker process ---------------------------------------------------------------


class _FunctionPlanner(GraspPlanner):
    def __init__(
        self,
        loader: FunctionLoader,
        name: str,
        time_limit: float,
        *,
        knows_meshes: bool = False,
        show_output: bool,
    ) -> None:
        super().__init__(loader.reference, name, time_limit)
        self.knows_meshes = knows_meshes
        self._folder = tempfile.TemporaryDirectory(
            prefix="burg_planner_", ignore_cleanup_errors=True
        )
        self._output = None if show_output else Path(self._folder.name, "output.txt")
        self._loader = replace(loader, output=self._output)
        self._pool = WorkerPool(1, retries=0, own_group=True)
        try:
            self._load()
            self.content = self._hash_content()
        except (WorkerDied, TimeoutError) as error:
            why = f"{str(error) or 'it took too long'}{clean_text(self._last_output(), 500)}"
            self.close()
            raise PlannerError(
                f"planner {self.reference} could not be loaded: {why}; to see why:"
                f" {f'python {loader.path}' if loader.path else f'python -m {loader.module}'}"
            ).about("planner") from error
        except BaseException:
            self.close()
            raise

    def _session(self) -> Session:
        # A worker that has the key does not load again. A new session has no failures.
        limit = self._limit(LOADING_TIMEOUT)
        return Session("planner", self._loader, limit, attempts=1)

    def _limit(self, seconds: float) -> TimeLimit:
        """A limit of wall time; the processors cannot do more within it."""
        return TimeLimit(cpu=seconds * (default_workers() + 1), wall=seconds)

    def _load(self) -> None:
        """Makes the worker load the function, unless it has done so.

        Raises:
            BurgError: it cannot be loaded.
        """
        task = Task(is_loaded, session=self._session(), retries=1)
        self._wait(self._pool.submit_task(task), LOADING_TIMEOUT)

    def _hash_content(self) -> str:
        if not self._loader.folder:
            return f"burg_drake {software_versions({}, with_platform=False)['burg_drake']}"
        if self._loader.path is not None:
            return content_hash(self._loader.path)[:16]
        task = Task(module_content, (self._loader.module,), session=self._session())
        return str(self._wait(self._pool.submit_task(task), LOADING_TIMEOUT))

    def _last_output(self) -> str:
        return "" if self._output is None else _last_lines(self._output)

    def _wait(self, future: WorkerFuture[Any], seconds: float) -> Any:
        """Waits for a result; ends the worker if it takes too long or if we are interrupted."""
        try:
            return future.result(seconds + SIGNAL_MARGIN)
        except BaseException:
            if not future.done():
                future.terminate()
            raise

    def _answer(
        self, observation: Observation, scene: SceneLike | None, station: StationLike | None
    ) -> dict[str, Any]:
        if self.knows_meshes and (scene is None or station is None):
            raise InvalidInputError(f"planner {self.reference} needs the scene and the station")
        context = {"scene": scene, "station": station} if self.knows_meshes else {}
        task = Task(
            call_function,
            (observation, context),
            session=self._session(),
            limit=self._limit(self._time_limit),
        )
        try:
            self._load()
        except (BurgError, TimeoutError) as error:
            raise PlannerLost(
                f"planner {self.reference} cannot be loaded again: {clean_text(str(error), 1000)}"
            ) from error
        if self._output is not None:
            self._output.write_bytes(b"")
        begun = time.monotonic()
        try:
            answer = self._wait(self._pool.submit_task(task), self._time_limit)
        except WorkerDied as error:
            if time.monotonic() - begun >= self._time_limit:
                raise TimeoutError from error
            raise _AnswerFailure(f"it crashed; {error}") from error
        except TaskCancelled as error:
            raise _AnswerFailure(f"it was closed meanwhile: {error}") from error
        except TimeoutError:
            raise
        except Exception as error:  # of classes that other processes do not know
            raise _AnswerFailure(f"its answer cannot be sent: {type(error).__name__}") from error
        if isinstance(answer, FunctionError):
            failure = _AnswerFailure(f"it raised {answer.line}")
            failure.add_note(answer.traceback_text)
            raise failure
        assert isinstance(answer, dict)
        return answer

    def close(self) -> None:
        self._pool.kill_workers()
        self._folder.cleanup()


# --- programs -------------------------------------------------------------------------------------


class _CommandPlanner(GraspPlanner):
    def __init__(self, reference: str, time_limit: float) -> None:
        try:
            words = shlex.split(reference.removeprefix("command:"))
            self._words = [os.path.expanduser(word) for word in words]
        except ValueError as error:
            raise InvalidInputError(f"planner {reference}: {error}").about("planner") from error
        if not self._words:
            raise InvalidInputError(
                f"planner {reference} names no program; give for example"
                " 'command:my_env/bin/python my_planner.py'"
            ).about("planner")
        if shutil.which(self._words[0]) is None:
            raise InvalidInputError(
                f"planner {reference}: there is no program {self._words[0]!r}; give its path, or"
                " a name on PATH"
            ).about("planner")
        scripts = [Path(word).stem for word in self._words if word.endswith(".py")]
        name = scripts[0] if scripts else Path(self._words[0]).name
        super().__init__(reference, name, time_limit)

    def _answer(
        self, observation: Observation, scene: SceneLike | None, station: StationLike | None
    ) -> dict[str, Any]:
        with tempfile.TemporaryDirectory(
            prefix="burg_planner_", ignore_cleanup_errors=True
        ) as folder:
            question, answer, errors = (
                Path(folder, name) for name in ("observation.npz", "answer.npz", "stderr.txt")
            )
            write_arrays(question, observation.arrays())
            code = self._run([*self._words, str(question), str(answer)], errors)
            if code != 0:
                reason = _signal_name(-code) if code < 0 else f"exit code {code}"
                said = _last_lines(errors) or ", and no message"
                raise _AnswerFailure(f"the program ended with {reason}{said}")
            if not answer.exists():
                said = _last_lines(errors) or ", and no message"
                raise _AnswerFailure(f"the program wrote no answer{said}")
            try:
                return _read_answer(answer)
            except InvalidInputError as error:
                text = str(error).replace(f"{folder}/", "")
                raise _AnswerFailure(f"its answer cannot be read: {text}") from error

    def close(self) -> None:
        """Does nothing: a program runs only while it is asked."""

    def _run(self, words: list[str], errors: Path) -> int:
        """Runs the program and returns its exit code; ends it, with its children, if it takes too
        long or if we are interrupted."""
        try:
            with errors.open("wb") as stream:
                process = subprocess.Popen(
                    words,
                    stdin=subprocess.DEVNULL,
                    stdout=stream,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )
        except OSError as error:
            raise _AnswerFailure(f"the program cannot be started: {error.strerror}") from error
        try:
            return process.wait(self._time_limit)
        except subprocess.TimeoutExpired as error:
            raise TimeoutError from error
        finally:
            if process.returncode is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


def _read_answer(path: Path) -> dict[str, Any]:
    """The arrays, texts and numbers of a file, within the limits of memory.

    Raises:
        InvalidInputError: the file is damaged, too large, or has something else.
    """
    with report_read_errors(path, "an .npz file of arrays"), open_npz(path) as file:
        found = {name: file.array(name).read(f"{NUMBER_KINDS}U") for name in file.names}
    return {name: value if value.ndim else value.item() for name, value in found.items()}


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # a real-time signal
        return f"signal {number}"


def _last_lines(path: Path) -> str:
    """End of a message with the last lines that a planner wrote; empty if it wrote none."""
    max_bytes, max_lines = 2000, 3
    try:
        with path.open("rb") as stream:
            stream.seek(max(0, path.stat().st_size - max_bytes))
            lines = stream.read().decode(errors="replace").split("\n")
    except OSError:  # the program has removed it
        lines = []
    kept = [line.strip() for line in lines if line.strip()][-max_lines:]
    return f"; its last lines: {' | '.join(kept)}" if kept else ""


# --- servers --------------------------------------------------------------------------------------


def require_websocket_packages() -> None:
    """Checks that the packages for planners over websockets are installed.

    Raises:
        MissingDependencyError: msgpack or websockets is not installed.
    """
    for name in ("msgpack", "websockets"):
        if importlib.util.find_spec(name) is None:
            raise MissingDependencyError(
                f"planners over websockets need {name}: pip install 'burg-drake[benchmark]'"
            )


def serve_planner(planner: GraspPlanner, port: int, host: str = "127.0.0.1") -> None:
    """Serves a planner over a websocket until the process is interrupted.

    Args:
        planner: the planner.
        port: port to listen on.
        host: address to listen on; by default only programs of this machine can connect.

    Raises:
        InvalidInputError: the planner knows the meshes, the port is in use, or the address is not
            this machine's.
        MissingDependencyError: the packages for websockets are missing.
    """
    require_websocket_packages()
    if planner.knows_meshes:
        raise InvalidInputError(
            f"planner {planner.name} needs the scene, which an observation does not have; it cannot"
            " be served, only benchmarked"
        ).about("planner")
    try:
        serve(planner.ask, port, host, planner.name)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            raise InvalidInputError(f"port {port} of {host} is in use; choose another one").about(
                "port"
            ) from error
        raise InvalidInputError(
            f"a planner cannot be served on {host}: {error.strerror or error}"
        ).about("host") from error


class _ServedPlanner(GraspPlanner):
    def __init__(self, reference: str, time_limit: float) -> None:
        require_websocket_packages()
        try:
            self._remote = RemotePlanner(reference, time_limit)
        except OSError as error:
            raise PlannerError(
                f"planner {reference}: no server answers there:"
                f" {clean_text(str(error), 200)}; start it first, as a"
                " program that ends with burg_planner.run(plan)"
            ).about("planner") from error
        except ValueError as error:
            raise PlannerError(f"planner {clean_text(str(error), 300)}").about("planner") from error
        max_name_length = 60
        name = clean_text(self._remote.name, max_name_length).strip()
        super().__init__(reference, name or reference, time_limit)

    def _answer(
        self, observation: Observation, scene: SceneLike | None, station: StationLike | None
    ) -> dict[str, Any]:
        try:
            return self._remote.plan(observation)
        except TimeoutError:
            raise
        except ConnectionError as error:
            raise PlannerLost(
                f"planner {self.reference}: no server answers there any more:"
                f" {clean_text(str(error), 200)}; start it again, and run the same command"
            ) from error
        except OSError as error:
            raise _AnswerFailure(f"the server cannot be reached: {error}") from error
        except ValueError as error:
            raise _AnswerFailure(f"its answer cannot be read: {error}") from error
        except RuntimeError as error:
            raise _AnswerFailure(f"the server reports {error}") from error

    def close(self) -> None:
        self._remote.close()
