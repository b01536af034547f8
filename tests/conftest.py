"""What all tests share: one thread a process, a cache, Ctrl-C, and the generators under `tools/`.

Worker processes import Drake and build their station again, which takes longer than most of what
the tests ask of them. Tests that are not about processes ask for `judged_here`.

The tests run against a checkout (editable install) and against an installed wheel alike
(`make test`). `tools/` is in no wheel, and putting the root of the checkout on `sys.path` would
shadow the wheel; therefore the package `tools`, and nothing else, is announced by hand.
"""

from __future__ import annotations

import atexit
import functools
import gc
import hashlib
import math
import os
import pickle
import shutil
import signal
import sys
import tempfile
from collections.abc import Generator, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

# pytest-xdist fills the cores with processes; read by OpenMP and OpenBLAS when they are loaded.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# What is computed once for a robot or a scene serves all tests of a run, but not the next run.
if "BURG_DRAKE_CACHE" not in os.environ:
    os.environ["BURG_DRAKE_CACHE"] = tempfile.mkdtemp(prefix="burg_drake_cache_")
    atexit.register(shutil.rmtree, os.environ["BURG_DRAKE_CACHE"], ignore_errors=True)

# Tests write thousands of small files, which need not survive a power failure.
os.fsync = lambda file: None

# What a script starts in the background ignores Ctrl-C, and so do all its children; the tests of
# interrupts need it as it is at a terminal.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def _announce_tools(folder: Path) -> None:
    tools = ModuleType("tools")
    tools.__path__ = [str(folder)]
    sys.modules["tools"] = tools


_announce_tools(Path(__file__).resolve().parents[1] / "tools")


PHYSICS = tuple(
    Path(__file__).parent / name
    for name in (
        *(
            "apps",
            "cameras",
            "compose",
            "dataset",
            "evaluation",
            "experiment/gap",
            "experiment/pages",
        ),
        *("experiment/test_trial_export.py", "export", "fuzzing", "generation"),
        *("grasping/test_clearance.py", "grasping/test_signed_clearance.py", "motion", "pipeline"),
        *("printout/test_board_printout.py", "ros", "simulation", "station", "ui"),
        *("visualization", "test_document_code.py", "test_notebooks.py"),
        *("test_packaging.py", "test_typed_use.py"),
    )
)
"""Folders and files of tests that build or step diagrams of Drake, render, or start programs."""
WITHOUT_PHYSICS = "not physics and not thorough"


@functools.cache
def _is_physics(path: Path) -> bool:
    return any(path == physics or physics in path.parents for physics in PHYSICS)


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "physics: Drake, renderers, programs; see PHYSICS")
    config.addinivalue_line("markers", "thorough: left out by `make test`; see tests/thorough.py")
    if gone := [str(path) for path in PHYSICS if not path.exists()]:
        raise pytest.UsageError(f"{__file__}: PHYSICS names {', '.join(gone)}; name it as it is")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """What is not going to run is not imported either."""
    left_out = config.option.markexpr == WITHOUT_PHYSICS and _is_physics(collection_path)
    return True if left_out else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if _is_physics(item.path):
            item.add_marker(pytest.mark.physics)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, Any, Any]:
    """Collecting makes millions of objects, nearly all of which stay: looking through them again
    and again for garbage takes a third of the time, and later some of that of every test."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


@pytest.fixture(scope="session")
def measured_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The convex pieces of a mesh, how far they are from it, its symmetries and the surface that
    pads touch are most of the work of building an object, and tests build the same few ones: all
    workers of a run share what was found."""
    import numpy as np

    from burg_drake.objects import SymmetrySearch, contact, convex_decomposition, shape_fit

    folder = tmp_path_factory.getbasetemp()
    known = (folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder) / "measured"
    known.mkdir(exist_ok=True)

    def once(measure: Any, *key: Any) -> Any:
        digest = hashlib.blake2b(digest_size=16)
        for part in key:
            is_array = isinstance(part, np.ndarray)
            digest.update(repr((part.shape, part.dtype) if is_array else part).encode())
            digest.update(part.tobytes() if is_array else b"")
        path = known / digest.hexdigest()
        if not path.exists():
            made = path.with_name(f"{path.name}.{os.getpid()}")
            made.write_bytes(pickle.dumps(measure()))
            made.replace(path)
        return pickle.loads(path.read_bytes())

    farthest, find, surface_of = (
        shape_fit._max_distance,
        SymmetrySearch.find,
        contact.contact_surface,
    )
    cut = convex_decomposition.run_coacd

    def find_once(search: SymmetrySearch) -> Any:
        key = (search._triangles, search.tolerance, search._covered)
        return once(lambda: find(search), "symmetries", *key)

    def farthest_once(points: Any, surface: Any, enough: float = math.inf) -> Any:
        key = (points, surface.vertices, surface.faces, enough)
        return once(lambda: farthest(points, surface, enough), "distance", *key)

    def surface_once(surface: Any, closed: bool) -> Any:
        key = (surface.vertices, surface.faces, closed)
        return once(lambda: surface_of(surface, closed), "surface", *key)

    def cut_once(*arguments: Any) -> Any:
        return once(lambda: cut(*arguments), "pieces", *arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shape_fit, "_max_distance", farthest_once)
        patch.setattr(SymmetrySearch, "find", find_once)
        patch.setattr(contact, "contact_surface", surface_once)
        patch.setattr(convex_decomposition, "run_coacd", cut_once)
        yield


@pytest.fixture(scope="module")
def judged_here() -> Iterator[None]:
    """What asks for one worker gets this process in its place, for the work beside judging too."""
    from burg_drake.evaluation import JudgePool, SceneProcesses
    from tests.evaluation.scenes_here import ScenesHere

    def scenes(request: Any, outputs: Any, workers: int) -> Any:
        return (ScenesHere if workers == 1 else SceneProcesses)(request, outputs, workers)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("burg_drake.evaluation.many_scenes.SceneProcesses", scenes)
        patch.setattr("burg_drake.evaluation.executor.JudgePool", _pool_or_this_process(JudgePool))
        yield


@pytest.fixture(scope="module")
def no_pose_mistakes() -> Iterator[None]:
    """Grasps that fit are not looked for in the frames of other projects. That is most of the work
    on a file of few grasps, and has tests of its own."""
    place = "burg_drake.evaluation.grasp_sets.mistake_search"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(f"{place}.find_mistake", lambda *_: None)
        patch.setattr(f"{place}.half_width_note", lambda *_: "")
        yield


def _pool_or_this_process(pool: type) -> Any:
    from burg_drake.core import BurgError
    from burg_drake.evaluation import JobFailed, JudgingState, judge_grasp, screen_grasps

    class ThisProcess:
        """Judges the grasps of one job after the other, in their order, without limits of time."""

        def run(self, jobs: Any, on_failure: Any = None) -> Iterator[tuple[Any, Any, Any]]:
            for job in jobs:
                if job is None or not job.candidates:
                    continue
                try:
                    judge = job.make_judge()
                except BurgError as error:
                    if on_failure is None:
                        raise
                    on_failure(JobFailed(job, error))
                    continue
                grasps = [(candidate, JudgingState()) for candidate in job.candidates]
                for screen in judge.screens:
                    passed = [grasp for grasp in grasps if grasp[1].outcome is None]
                    states: dict[str, JudgingState] = {}
                    for k in range(0, len(passed), screen.batch):
                        batch = passed[k : k + screen.batch]
                        for (candidate, _), state in zip(
                            batch, screen_grasps(judge, batch), strict=True
                        ):
                            states[candidate.id] = state
                    grasps = [(c, states.get(c.id, state)) for c, state in grasps]
                for candidate, state in grasps:
                    yield job, candidate, judge_grasp(judge, candidate, screened=state)

        def release(self) -> None:
            pass

    return lambda count, limits: ThisProcess() if count == 1 else pool(count, limits)
