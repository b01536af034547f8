"""Objects built in worker processes: the same results, and deaths that cost one object."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest
import trimesh

from burg_drake.core import SimulationError
from burg_drake.pipeline import ObjectSource, build_library, library_build


def boxes(count: int) -> list[ObjectSource]:
    mesh = trimesh.creation.box((0.05, 0.06, 0.07))
    return [
        ObjectSource(name=f"box_{i}", mesh=mesh, mass=0.1, contact="pieces") for i in range(count)
    ]


class Fatal(trimesh.Trimesh):
    """A mesh that ends the process that looks at it, unless that is the one that made it."""

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "made_by": os.getpid()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)

    @property
    def faces(self) -> Any:
        if self.__dict__.get("made_by", os.getpid()) != os.getpid():
            os.kill(os.getpid(), signal.SIGKILL)
        return super().faces

    @faces.setter
    def faces(self, values: Any) -> None:
        trimesh.Trimesh.faces.fset(self, values)


def test_errors_and_a_worker_that_dies_cost_one_object_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = trimesh.creation.box((0.05, 0.06, 0.07))
    fatal = Fatal(box.vertices, box.faces, process=False)
    module = Path(__file__).stem
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    Fatal.__module__ = module
    __import__(module).Fatal = Fatal
    (tmp_path / "nan.obj").write_text("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    sources = [
        *boxes(2),
        ObjectSource(name="fatal", mesh=fatal, mass=0.1),
        ObjectSource.from_file(tmp_path / "nan.obj"),
    ]
    report = build_library(sources, tmp_path / "lib", confirm=False, workers=2)
    assert report.built == ("box_0", "box_1")
    assert report.failed == {
        "fatal": "the worker process was killed from outside by SIGKILL",
        "nan": f"{tmp_path / 'nan.obj'}: 1 of 3 vertices are NaN or infinite",
    }
    assert not (tmp_path / "lib" / "fatal").exists()


def test_drake_giving_up_is_a_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def gives_up(*_: object) -> None:
        raise SystemExit("abort: Failure at plant.cc")

    monkeypatch.setattr(library_build, "build_object", gives_up)
    report = build_library(boxes(1), tmp_path / "lib")
    assert report.failed == {"box_0": "Drake failed: abort: Failure at plant.cc"}
    assert issubclass(SimulationError, RuntimeError)
