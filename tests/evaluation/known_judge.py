"""Judges at the seam of the simulation: verdicts follow from the grasp's id alone.

They live in a module of their own because worker processes import them.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from burg_drake.core import DeviceError, InvalidInputError, Outcome, Stage
from burg_drake.evaluation import Candidate, Decide, Decision, Screen

JUDGE_FACTORY = "burg_drake.evaluation.run_preparation.StationJudgeFactory"
TOPPLED = 0.0185
"""What is moved by more than this lies afterwards [m]."""


def number(id: str) -> int:
    """A number in [0, 100) that follows from an id."""
    return int(hashlib.md5(id.encode()).hexdigest(), 16) % 100


def expected(id: str) -> Outcome:
    """The outcome that `KnownJudge` gives."""
    n = number(id)
    if n < 30:
        return Outcome.COLLISION_TABLE
    if n < 45:
        return Outcome.NO_IK
    if n < 60:
        return Outcome.SLIPPED
    return Outcome.LIFTED if n < 90 else Outcome.LIFTED_DISTURBED


def confidence(id: str) -> float:
    """The confidence that `KnownJudge` gives: every fifth verdict is contested."""
    return 0.6 if number(id) % 5 == 0 else 0.97


@dataclass(frozen=True)
class SecondJudge:
    """Judges again, otherwise than `KnownJudge`: each grasp is lifted, but for those that are told
    to fail."""

    failing: str = ""

    @property
    def screens(self) -> Sequence[Screen]:
        return ()

    @property
    def stages(self) -> Sequence[tuple[Stage, Decide]]:
        return ((Stage.EXECUTED, lambda grasp, motion: self.execute(grasp)),)

    def execute(self, grasp: Candidate) -> Decision:
        if grasp.id == self.failing:
            return Decision(Outcome.SIMULATION_FAILED, reason="not finite")
        return Decision(Outcome.LIFTED, margins={"slip": 1e-4, "tilt": 1e-3}, confidence=0.7)


def _all(one: Callable[[Candidate], Decision], grasps: Sequence[Candidate]) -> list[Decision]:
    return [one(grasp) for grasp in grasps]


@dataclass(frozen=True)
class KnownJudge:
    """Judges by `expected`; writes a line to `log` for each grasp it is asked about.

    Attributes:
        pause: before each grasp that is executed [s]: verdicts of the others come at once.
        batches: grasps that are screened at a time, by screen.
        devices: those that execute grasps, in turn.
    """

    log: Path | None = None
    pause: float = 0.0
    batches: tuple[int, int] = (512, 16)
    devices: tuple[str, ...] = ("",)

    @property
    def screens(self) -> Sequence[Screen]:
        asked = ((Stage.CLEAR, self.clear), (Stage.REACHABLE, self.reach))
        return [
            Screen(stage, partial(_all, one), batch)
            for (stage, one), batch in zip(asked, self.batches, strict=True)
        ]

    @property
    def stages(self) -> Sequence[tuple[Stage, Decide]]:
        return ((Stage.EXECUTED, lambda grasp, motion: self.execute(grasp)),)

    def clear(self, grasp: Candidate) -> Decision:
        if self.log is not None:
            with self.log.open("a") as file:
                file.write(f"{grasp.id}\n")
        outcome = expected(grasp.id)
        if outcome is Outcome.COLLISION_TABLE:
            return Decision(outcome, blocker="table", margins={"overlap": number(grasp.id) / 3e3})
        return Decision(margins={"overlap": 0.0})

    def reach(self, grasp: Candidate) -> Decision:
        if expected(grasp.id) is Outcome.NO_IK:
            return Decision(Outcome.NO_IK)
        q = tuple(number(f"{grasp.id}{k}") / 33 for k in range(7))
        return Decision(q_grasp=q, q_pregrasp=q)

    def execute(self, grasp: Candidate) -> Decision:
        time.sleep(self.pause)
        n = number(grasp.id)
        outcome = expected(grasp.id)
        moved = n / 5e3 if outcome is Outcome.LIFTED_DISTURBED else 0.0
        margins = {"slip": n / 7e4, "tilt": n / 900, "pad_force": 40 - n / 30}
        margins |= {"patch_area": n / 1e6, "others_moved": moved, "others_turned": 50.0 * moved}
        others = {"left", "right", "bar"} - {grasp.instance}
        return Decision(
            outcome,
            margins=margins,
            displacements={min(others): moved},
            turned={min(others): 50.0 * moved},
            toppled=min(others) if moved > TOPPLED else "",
            confidence=confidence(grasp.id),
            device=self.devices[n % len(self.devices)],
        )


@dataclass(frozen=True)
class CrashingJudge(KnownJudge):
    """Ends its process on some grasps, in the stage `executed`.

    Attributes:
        how: by grasp id: `segfault`, `killed`, which another process does as the system does when
            memory runs out, `exit`, `error`, `hang`, `spin`, `memory`, which asks for more than it
            may have, `parent`, which ends the parent process, `device`, which is an error of a
            card, `broken`, after which the first process that meets it has that error at all
            grasps, or `once`, which crashes only as long as the file `log` does not exist; `screen`
            and `screen_error` are `segfault` and `error` in the stage `clear`, `reach` and
            `reach_error` in the stage `reachable`.
    """

    how: tuple[tuple[str, str], ...] = ()

    def execute(self, grasp: Candidate) -> Decision:
        match dict(self.how).get(grasp.id):
            case "segfault":
                os.kill(os.getpid(), signal.SIGSEGV)
            case "killed":
                other = f"import os; os.kill({os.getpid()}, {signal.SIGKILL:d})"
                subprocess.run([sys.executable, "-c", other], check=False)
                time.sleep(3600.0)
            case "exit":
                raise SystemExit("a condition of Drake failed")
            case "error":
                raise RuntimeError("the solver\ndid not converge")
            case "hang":
                time.sleep(3600.0)
            case "spin":
                while True:
                    pass
            case "memory":
                resource.setrlimit(resource.RLIMIT_AS, (4 << 30, resource.RLIM_INFINITY))
                bytearray(8 << 30)
            case "parent":
                os.kill(os.getppid(), signal.SIGKILL)
                time.sleep(3600.0)
            case "device":
                raise DeviceError("device cuda:0 failed")
            case "broken" if self.log is not None and not self.log.exists():
                self.log.write_text(str(os.getpid()))
            case "once" if self.log is not None and not self.log.exists():
                self.log.touch()
                os.kill(os.getpid(), signal.SIGKILL)
        if self.log is not None and self.log.exists() and self.log.read_text() == str(os.getpid()):
            raise DeviceError("device cuda:0 failed")
        return super().execute(grasp)

    def clear(self, grasp: Candidate) -> Decision:
        time.sleep(self.pause)
        match dict(self.how).get(grasp.id):
            case "screen":
                os.kill(os.getpid(), signal.SIGSEGV)
            case "screen_error":
                raise RuntimeError("not a pose")
        return Decision()

    def reach(self, grasp: Candidate) -> Decision:
        match dict(self.how).get(grasp.id):
            case "reach":
                os.kill(os.getpid(), signal.SIGSEGV)
            case "reach_error":
                raise RuntimeError("no joint")
        return Decision()


@dataclass(frozen=True)
class TimedJudge(KnownJudge):
    """Writes process, begin and end of each trial to `trials`, by a clock that all share."""

    trials: Path = Path()

    def execute(self, grasp: Candidate) -> Decision:
        begin = time.monotonic()
        decision = super().execute(grasp)
        with self.trials.open("a") as file:
            file.write(f"{os.getpid()} {begin!r} {time.monotonic()!r}\n")
        return decision


@dataclass(frozen=True)
class ShortOfMemory(KnownJudge):
    """Some grasps end its process in the stage `executed`, as the system does or by themselves.

    Attributes:
        killed: ids of grasps at which it is ended by SIGKILL.
        crashing: ids of those at which it ends by SIGSEGV.
    """

    killed: tuple[str, ...] = ()
    crashing: tuple[str, ...] = ()

    def execute(self, grasp: Candidate) -> Decision:
        if grasp.id in (*self.killed, *self.crashing):
            os.kill(os.getpid(), signal.SIGKILL if grasp.id in self.killed else signal.SIGSEGV)
        return super().execute(grasp)


@dataclass(frozen=True)
class Make:
    """A factory as `judge_all` takes it."""

    judge: Any

    def __call__(self) -> Any:
        return self.judge


def refuse() -> KnownJudge:
    """A factory that cannot build its judge."""
    raise InvalidInputError("no such model")


def die() -> KnownJudge:
    """A factory that ends the process."""
    os.kill(os.getpid(), signal.SIGSEGV)
    raise AssertionError


@dataclass(frozen=True)
class MakeAndTell:
    """A factory that writes its name and its process to `log` when it is called."""

    judge: Any
    log: Path
    name: str

    def __call__(self) -> Any:
        with self.log.open("a") as file:
            file.write(f"{self.name} {os.getpid()}\n")
        return self.judge


@dataclass(frozen=True)
class ParallelJudge(CrashingJudge):
    """Executes grasps as the last screen, many at once."""

    @property
    def screens(self) -> Sequence[Screen]:
        last = Screen(Stage.EXECUTED, partial(_all, self.execute), 1000)
        return [*super().screens, last]

    @property
    def stages(self) -> Sequence[tuple[Stage, Decide]]:
        return ()


@dataclass(frozen=True)
class DieOnStart:
    """A factory that ends the process in which it is called for the n-th time, counted in `log`."""

    judge: Any
    log: Path
    n: tuple[int, ...]

    def __call__(self) -> Any:
        with self.log.open("a") as file:
            file.write("start\n")
        if len(self.log.read_text().split()) in self.n:
            die()
        return self.judge


def install(setattr: Callable[[str, Any], None], log: Path | None = None, pause: float = 0) -> None:
    """Replaces the simulation of `evaluate` in this process by `KnownJudge`."""
    judge = Make(KnownJudge(log, pause))
    setattr(JUDGE_FACTORY, lambda *_: judge)
    for module in ("cascade", "scene_tasks"):
        setattr(f"burg_drake.evaluation.{module}.require_sound", lambda *_: None)
    # of many scenes, too: processes of their own would not know of this
    beside = f"{__package__}.scenes_here" if __package__ else "scenes_here"  # no package in workers
    scenes_here = importlib.import_module(beside).ScenesHere
    setattr("burg_drake.evaluation.many_scenes.SceneProcesses", scenes_here)
    # the chart of the arm's reach takes longer than all else
    setattr("burg_drake.evaluation.report.pages.reachability_section", lambda *_: None)
