"""What a worker process does for a planner that is a function: imports it, and calls it."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import inspect
import io
import os
import sys
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from burg_drake.benchmark.burg_planner import (
    MAX_ANSWER_BYTES,
    Observation,
    answer_observation,
    describe_error,
    plain_value,
)
from burg_drake.core import (
    InvalidInputError,
    UnknownNameError,
    content_hash,
    shorten_text,
    suggest_names,
)


@dataclass(frozen=True)
class FunctionLoader:
    """Imports a planner's function in a worker process.

    Attributes:
        reference: reference of the planner, for messages.
        module: name of its module, or the path of its file as it was given.
        function: name of the function in the module; with dots for a method of an object there.
        folder: folder in which modules are found besides those of Python; none if empty.
        path: absolute path of the file, if the reference names one.
        output: file for what the planner prints; standard error if None.
    """

    reference: str
    module: str
    function: str
    folder: str = ""
    path: Path | None = None
    output: Path | None = None

    def __call__(self) -> Callable[..., Any]:
        """The function.

        Raises:
            UnknownNameError: the module has no such function.
            InvalidInputError: the module cannot be imported, or what has the name is not a function
                of an observation.
        """
        # If memory runs out, Linux ends this process rather than one that has done no harm.
        with contextlib.suppress(OSError):
            Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
        self._redirect_output()
        try:
            found: Any = self._import_module()
        except (Exception, SystemExit) as error:
            why = clean_text(_describe_foreign_error(error), 500)
            raise InvalidInputError(
                f"planner {self.reference}: {self.module} cannot be imported: {why}; modules are"
                " searched in the working directory and on PYTHONPATH"
            ).about("planner") from error
        for name in self.function.split("."):
            if not hasattr(found, name):
                known = [known for known in dir(found) if not known.startswith("_")]
                raise UnknownNameError(
                    f"planner {self.reference}: {self.module} has no {self.function!r};"
                    f" {suggest_names(name, known)}"
                ).about("planner")
            found = getattr(found, name)
        self._require_function(found)
        function: Callable[..., Any] = found
        return function

    def _redirect_output(self) -> None:
        """Sends standard output, and standard error if there is a file for it, where they are to
        go; also that of libraries in other languages."""
        if self.output is None:
            os.dup2(2, 1)
        else:
            file = os.open(self.output, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
            os.dup2(file, 1)
            os.dup2(file, 2)
            os.close(file)
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(line_buffering=True)

    def _import_module(self) -> ModuleType:
        if self.folder:
            sys.path.insert(0, self.folder)
        if self.path is None:
            return importlib.import_module(self.module)
        sys.path.insert(0, str(self.path.parent))  # as Python does for a script
        name = self.path.stem
        if name in sys.modules or name in sys.stdlib_module_names:
            name = f"planner_file_{name}"
        spec = importlib.util.spec_from_file_location(name, self.path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
        return module

    def _require_function(self, found: Any) -> None:
        """Raises an error if something cannot be called with an observation."""
        if inspect.isclass(found) or not callable(found):
            kind = "a class" if inspect.isclass(found) else f"{type(found).__name__}, no function"
            raise InvalidInputError(
                f"planner {self.reference}: {self.function} is {kind}; name a function"
                " plan(observation), or the method of an object such as planner.plan"
            ).about("planner")
        if not self.folder:
            return
        try:
            signature = inspect.signature(found)
        except (TypeError, ValueError):  # some functions in C have none
            return
        try:
            signature.bind(None)
        except TypeError as error:
            raise InvalidInputError(
                f"planner {self.reference}: it is called with an observation alone, but"
                f" {self.function}{clean_text(str(signature), 100)} cannot be: {error}"
            ).about("planner") from error


def _describe_foreign_error(error: BaseException) -> str:
    """As `describe_error`, without the lines of this file that lead to the planner's."""
    trace = error.__traceback__
    while trace is not None and trace.tb_frame.f_code.co_filename == __file__:
        trace = trace.tb_next
    return describe_error(error.with_traceback(trace))


@dataclass(frozen=True)
class FunctionError:
    """An error of a planner's function, as texts: its class may be unknown in other processes."""

    line: str
    traceback_text: str


def is_loaded(function: object) -> bool:
    """In a worker: whether it has a planner's function."""
    return callable(function)


def module_content(function: object, module: str) -> str:
    """In a worker: hash of the file of a planner's module; empty if it has none.

    Args:
        function: the planner's function, which is not used.
        module: name of the module that was imported for it.
    """
    file = sys.modules[module].__file__
    return content_hash(Path(file))[:16] if file else ""


def call_function(
    function: Callable[..., Any], observation: Observation, context: Mapping[str, Any]
) -> dict[str, Any] | FunctionError:
    """In a worker: a planner's answer, which can be pickled, or its error."""
    try:
        answer = answer_observation(partial(function, **context), observation)
        plain = {name: plain_value(name, value) for name, value in answer.items()}
        size = sum(getattr(value, "nbytes", 0) for value in plain.values())
        if size > MAX_ANSWER_BYTES:
            raise ValueError(f"the answer has {size:,} bytes; at most {MAX_ANSWER_BYTES:,}")
        return plain
    except Exception as error:
        text = traceback.format_exc()
        return FunctionError(_describe_foreign_error(error), text)


def clean_text(text: str, length: int) -> str:
    """A text from outside as one line of printable characters."""
    return shorten_text("".join(c if c.isprintable() else " " for c in text), length)
