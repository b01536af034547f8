"""The probe agrees with what Drake does; the names are those of the releases."""

from __future__ import annotations

import subprocess
import sys

import pytest

from burg_drake import system_libraries
from tests.hang_guard import HANG_GUARD

RENDER = """
from pydrake.geometry import (
    ClippingRange, ColorRenderCamera, MakeRenderEngineVtk, RenderCameraCore, RenderEngineVtkParams,
    SceneGraph,
)
from pydrake.math import RigidTransform
from pydrake.systems.sensors import CameraInfo

scene_graph = SceneGraph()
scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(RenderEngineVtkParams()))
core = RenderCameraCore("vtk", CameraInfo(8, 6, 1.0), ClippingRange(0.1, 1.0), RigidTransform())
query = scene_graph.get_query_output_port().Eval(scene_graph.CreateDefaultContext())
query.RenderColorImage(
    ColorRenderCamera(core, False), scene_graph.world_frame_id(), RigidTransform()
)
"""


def pretend_only(monkeypatch: pytest.MonkeyPatch, *present: str) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(system_libraries, "_can_load", lambda soname: soname in present)
    driver = system_libraries.SystemLibrary.mesa_driver in present
    monkeypatch.setattr(system_libraries, "_has_mesa_driver", lambda: driver)


@pytest.mark.skipif(sys.platform != "linux", reason="asks for system libraries on Linux only")
def test_nothing_missing_means_that_drake_renders() -> None:
    """The oracle is Drake in a process of its own: without a driver it ends by a signal."""
    rendered = subprocess.run(
        [sys.executable, "-c", RENDER], capture_output=True, timeout=HANG_GUARD
    )
    assert (rendered.returncode == 0) == (not system_libraries.missing_render_libraries())


def test_a_slim_machine_lacks_everything(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend_only(monkeypatch)
    monkeypatch.setattr(system_libraries.shutil, "which", lambda _: "/usr/bin/apt-get")
    monkeypatch.setattr(system_libraries.platform, "libc_ver", lambda: ("glibc", "2.36"))
    missing = system_libraries.missing_render_libraries()
    assert missing == [
        "libglib-2.0.so.0",
        "libEGL.so.1",
        "libEGL_mesa.so.0",
        "swrast_dri.so",
    ]
    assert system_libraries.describe_missing(missing) == (
        "pydrake cannot be imported without libglib-2.0.so.0, libEGL.so.1, libEGL_mesa.so.0,"
        " swrast_dri.so; run: sudo apt-get install libglib2.0-0 libegl1 libegl-mesa0"
        " libgl1-mesa-dri"
    )


def test_only_the_driver_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pretend_only(monkeypatch, "libglib-2.0.so.0", "libEGL.so.1", "libEGL_mesa.so.0")
    monkeypatch.setattr(system_libraries.shutil, "which", lambda _: None)
    assert system_libraries.main([]) == 1
    assert capsys.readouterr().out == (
        "Drake cannot render images without swrast_dri.so;"
        " install it with the package manager of this system\n"
    )


def test_a_graphics_driver_replaces_mesa(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend_only(monkeypatch, "libglib-2.0.so.0", "libEGL.so.1", "libEGL_nvidia.so.0")
    assert system_libraries.missing_render_libraries() == []
    assert system_libraries.apt_command() == ""
    assert system_libraries.main([]) == 0


@pytest.mark.parametrize(
    ("glibc", "package"),
    [
        ("2.35", "libglib2.0-0"),  # Ubuntu 22.04
        ("2.36", "libglib2.0-0"),  # Debian 12
        ("2.39", "libglib2.0-0t64"),  # Ubuntu 24.04
        ("2.41", "libglib2.0-0t64"),  # Debian 13
    ],
)
def test_package_names_follow_the_release(
    monkeypatch: pytest.MonkeyPatch, glibc: str, package: str
) -> None:
    monkeypatch.setattr(system_libraries.platform, "libc_ver", lambda: ("glibc", glibc))
    assert system_libraries.apt_packages(["libglib-2.0.so.0"]) == [package]
    expected = f"sudo apt-get install {package}"
    assert system_libraries.apt_command(["libglib-2.0.so.0"]) == expected


def test_nothing_is_asked_for_on_macos(monkeypatch: pytest.MonkeyPatch) -> None:
    pretend_only(monkeypatch)
    monkeypatch.setattr(sys, "platform", "darwin")
    assert system_libraries.missing_render_libraries() == []


def test_packages_option_prints_names_only(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pretend_only(monkeypatch, "libEGL.so.1", "libEGL_nvidia.so.0")
    monkeypatch.setattr(system_libraries.platform, "libc_ver", lambda: ("glibc", "2.41"))
    assert system_libraries.main(["--packages"]) == 2
    assert capsys.readouterr().out == "libglib2.0-0t64 libatomic1\n"


def test_useful_libraries_are_installed_but_not_missed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pretend_only(monkeypatch, "libglib-2.0.so.0", "libEGL.so.1", "libEGL_nvidia.so.0")
    assert system_libraries.main([]) == 0
    assert capsys.readouterr().out == ""
    assert system_libraries.main(["--packages"]) == 0
    assert capsys.readouterr().out == "libatomic1\n"
