"""Finds Blender and renders with it in a process of its own."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from threading import RLock
from typing import IO, Any, Literal, get_args

import cv2
import numpy as np

from burg_drake.cameras import Intrinsics
from burg_drake.core import Array, Bytes, MissingDependencyError, SimulationError
from burg_drake.dataset.blender_scene import BlenderScene

RendererName = Literal["drake", "blender"]
RENDERERS: tuple[RendererName, ...] = get_args(RendererName)
"""Names of the renderers of colour images."""
BLENDER_ENVIRONMENT_VARIABLE = "BURG_DRAKE_BLENDER"
"""Environment variable with the path of Blender, or of a Python that has bpy."""
BLENDER_INSTALL_ADVICE = (
    "pip install 'burg-drake[blender]' with Python 3.11 or 3.13, or set"
    f" {BLENDER_ENVIRONMENT_VARIABLE} to a Blender, or to a Python that has the package bpy"
)
"""Ending of the messages about a missing Blender."""


def blender_command() -> list[str]:
    """Command line of the rendering process.

    Raises:
        MissingDependencyError: there is no Blender, or `BURG_DRAKE_BLENDER` names none.
    """
    # The program that runs in the Blender process.
    worker_program = Path(__file__).with_name("blender_worker.py")
    given = os.environ.get(BLENDER_ENVIRONMENT_VARIABLE)
    if not given:
        if importlib.util.find_spec("bpy") is None:
            raise MissingDependencyError(
                f"the renderer blender is not installed: {BLENDER_INSTALL_ADVICE}"
            )
        return [sys.executable, "-P", str(worker_program)]
    found = shutil.which(given)
    if found is None:
        raise MissingDependencyError(
            f"{BLENDER_ENVIRONMENT_VARIABLE} is {given!r}, which is not an executable:"
            f" {BLENDER_INSTALL_ADVICE}"
        )
    version_output = subprocess.run(
        [found, "--version"], capture_output=True, text=True, check=False
    )
    if version_output.stdout.startswith("Blender"):
        quiet = ["--background", "--factory-startup", "--python-exit-code", "1"]
        return [found, *quiet, "--python", str(worker_program)]
    return [found, "-P", str(worker_program)]


class Blender:
    """A rendering process, which ends with the process that started it.

    The number of threads, `OMP_NUM_THREADS` or one per processor, does not change images.

    Attributes:
        version: version of Blender.

    Args:
        command: command line of the process.

    Raises:
        MissingDependencyError: the program has no bpy.
        SimulationError: the process ended at once.
    """

    def __init__(self, command: list[str]) -> None:
        self._log: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115, closed in `close`
        foreign: tuple[str, ...] = ()
        if os.environ.get(BLENDER_ENVIRONMENT_VARIABLE):
            foreign = ("PYTHONPATH", "PYTHONHOME")  # another Python must not inherit them
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._log,
            env={name: value for name, value in os.environ.items() if name not in foreign},
        )
        self._lock = RLock()
        self._loaded_scene: BlenderScene | None = None
        self._program = command[0]
        self.version = str(self._read_response("starting")["version"])

    @property
    def alive(self) -> bool:
        """Whether the process is running."""
        return self._process.poll() is None

    def image(
        self,
        scene: BlenderScene,
        poses: Mapping[str, Array],
        intrinsics: Intrinsics,
        X_WC: Array,
        clip: tuple[float, float],
    ) -> Bytes:
        """Renders the image of a pinhole camera.

        Args:
            scene: the scene; sent to the process only if it is another object than before.
            poses: `X_WB` (4, 4) of the bodies.
            intrinsics: intrinsics of the camera.
            X_WC: (4, 4) pose of the camera's optical frame in the world.
            clip: near and far clipping depth [m].

        Returns:
            (H, W, 4) sRGB and coverage of each pixel by surfaces, not premultiplied.

        Raises:
            SimulationError: Blender failed, or ended; the message has its last lines of output.
        """
        with self._lock, tempfile.TemporaryDirectory(prefix="burg_drake-") as name:
            folder = Path(name)
            if self._loaded_scene is not scene:
                self._loaded_scene = None
                scene.write(folder, _thread_count())
                self._send_request("loading a scene", do="load", folder=name)
                self._loaded_scene = scene
            path = folder / "view.png"
            self._send_request(
                "rendering",
                do="render",
                width=intrinsics.width,
                height=intrinsics.height,
                focal=intrinsics.focal,
                center=intrinsics.center,
                X_WC=X_WC.tolist(),
                clip=clip,
                poses={body: X_WB.tolist() for body, X_WB in poses.items()},
                output=str(path),
            )
            image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if image is None or image.shape != (intrinsics.height, intrinsics.width, 4):
            raise SimulationError(f"Blender wrote no image; {self._last_output()}")
        return np.ascontiguousarray(image[..., [2, 1, 0, 3]])

    def close(self) -> None:
        """Ends the process."""
        self._process.kill()
        self._process.communicate()
        self._log.close()

    def _send_request(self, when: str, **task: Any) -> None:
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # reading the answer reports the end
            self._process.stdin.write(json.dumps(task).encode() + b"\n")
            self._process.stdin.flush()
        try:
            error = self._read_response(when).get("error")
        except BaseException:
            self._process.kill()  # a late answer must not be taken for that of the next request
            raise
        if error is not None:
            raise SimulationError(f"Blender failed while {when}: {error}")

    def _read_response(self, when: str) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        while line.endswith(b"\n") and not line.startswith(b"{"):  # Blender's own messages
            line = self._process.stdout.readline()
        if not line.endswith(b"\n"):
            code = self._process.wait()
            how = f"by {signal.Signals(-code).name}" if code < 0 else f"with code {code}"
            raise SimulationError(f"Blender ended {how} while {when}; {self._last_output()}")
        found: dict[str, Any] = json.loads(line)
        if "missing" in found:
            self.close()
            raise MissingDependencyError(
                f"{self._program} has no Blender ({found['missing']}): {BLENDER_INSTALL_ADVICE}"
            )
        return found

    def _last_output(self) -> str:
        self._log.seek(0)
        lines = self._log.read().decode(errors="replace").split("\n")
        last_lines = [line.strip() for line in lines if line.strip()][-5:]
        return f"its last lines: {' | '.join(last_lines)}" if last_lines else "it printed nothing"


def running_blender() -> Blender:
    """The rendering process of this process, started if it is not running.

    Raises:
        MissingDependencyError: there is no Blender.
        SimulationError: the process ended at once.
    """
    command = tuple(blender_command())
    found = _start_blender(command)
    if not found.alive:
        _start_blender.cache_clear()
        found = _start_blender(command)
    return found


@lru_cache(maxsize=1)
def _start_blender(command: tuple[str, ...]) -> Blender:
    return Blender(list(command))


def _thread_count() -> int:
    given = os.environ.get("OMP_NUM_THREADS", "")
    return int(given) if given.isdecimal() else 0
