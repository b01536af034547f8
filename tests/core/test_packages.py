"""Packages are found where Drake's own PackageMap finds them, one way each."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import pytest
from pydrake.multibody.parsing import PackageMap

from burg_drake.core import Packages, UnknownNameError, drake_models_folder, package_file


def package(folder: Path, name: str) -> Path:
    """A package with a mesh in it."""
    (folder / "meshes").mkdir(parents=True)
    (folder / "package.xml").write_text(
        f"<package format='3'>\n<!-- <name>old</name> -->\n<name>{name}</name></package>\n"
    )
    (folder / "meshes" / "link.obj").write_text("v 0 0 0\n")
    return folder


@pytest.fixture(autouse=True)
def no_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(variable, raising=False)


def found(names: Iterable[str], near: Path) -> dict[str, Path]:
    """Folders of those packages that there are."""
    result = {}
    for name in names:
        try:
            result[name] = Packages().find(name, near).resolve()
        except UnknownNameError:
            continue
    return result


def of_drake(packages: PackageMap) -> dict[str, Path]:
    return {name: Path(packages.GetPath(name)).resolve() for name in packages.GetPackageNames()}


def test_upwards_from_the_file_that_names_it(tmp_path: Path) -> None:
    arm = package(tmp_path / "ws/src/arm_description-2.1", "arm")
    package(tmp_path / "ws/src/hand", "hand")
    package(tmp_path / "other/far", "far")
    near = arm / "urdf/arms"
    near.mkdir(parents=True)
    drake = PackageMap.MakeEmpty()
    drake.PopulateFromFolder(str(tmp_path / "ws"))
    assert found(["arm", "hand", "far", "old", "urdf"], near) == of_drake(drake)
    mesh = package_file("package://arm/meshes/link.obj", near, Packages())
    assert mesh.samefile(drake.ResolveUrl("package://arm/meshes/link.obj"))
    assert package_file("model://hand/meshes", near, Packages()).samefile(
        tmp_path / "ws/src/hand/meshes"
    )


def test_ros_package_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    package(one / "deep/down/arm", "arm")
    package(one / "deep/down/arm/inner", "inside_a_package")
    package(one / ".hidden/ghost", "ghost")
    for k, mark in enumerate(("CATKIN_IGNORE", "COLCON_IGNORE", "AMENT_IGNORE")):
        (package(one / f"out{k}/left", f"left{k}").parent / mark).touch()
    package(two / "arm_again", "arm")
    package(two / "plain", "plain")
    (one / "deep/circle").symlink_to(two, target_is_directory=True)
    (two / "no_package").mkdir()
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{one}::{two}:{tmp_path / 'missing'}")
    drake = PackageMap.MakeEmpty()
    drake.PopulateFromRosPackagePath()
    names = ["arm", "plain", "inside_a_package", "ghost", "left0", "left1", "left2", "arm_again"]
    assert set(of_drake(drake)) == {"arm", "plain"}
    assert found(names, tmp_path).keys() == of_drake(drake).keys()
    assert found(["plain"], tmp_path)["plain"] == of_drake(drake)["plain"]
    assert found(["arm"], tmp_path)["arm"] == (one / "deep/circle/arm_again").resolve()


def test_ament_prefix_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package(tmp_path / "jazzy/share/arm", "arm")
    package(tmp_path / "mine/share/hand", "hand")
    package(tmp_path / "mine/elsewhere", "elsewhere")
    prefixes = f"{tmp_path / 'mine'}:{tmp_path / 'jazzy'}"
    monkeypatch.setenv("AMENT_PREFIX_PATH", prefixes)
    drake = PackageMap.MakeEmpty()
    drake.PopulateFromEnvironment("AMENT_PREFIX_PATH")
    drake.Remove("elsewhere")  # it crawls all of a prefix; a package's files are in share/NAME
    assert found(["arm", "hand", "elsewhere"], tmp_path) == of_drake(drake)


def test_models_of_drake_that_it_has_fetched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("TEST_TMPDIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("DRAKE_ALLOW_NETWORK", "none")
    folder = drake_models_folder()
    assert folder is not None and found(["drake_models"], tmp_path) == {}
    folder.mkdir(parents=True)
    assert found(["drake", "drake_models"], tmp_path) == of_drake(PackageMap())


def test_what_a_document_states_comes_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    near, stated = package(tmp_path / "near", "arm"), package(tmp_path / "stated", "arm")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(package(tmp_path / "ros", "arm")))
    assert Packages({"arm": stated}).find("arm", near) == stated
    assert Packages().find("arm", near) == near
    assert Packages().find("arm", stated) == stated


def test_messages_tell_what_was_searched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/opt/one{os.pathsep}/opt/two")
    mine = package(tmp_path / "mine", "my_arm")
    packages = Packages({"my_arm": mine}, tmp_path / "s.yaml")

    def message(reference: str) -> str:
        with pytest.raises(UnknownNameError) as caught:
            package_file(reference, tmp_path, packages)
        return str(caught.value)

    assert message("package://my_amr/meshes/link.obj") == (
        f"package://my_amr/meshes/link.obj: package 'my_amr' is not found in {tmp_path} and the"
        " folders above it, ROS_PACKAGE_PATH (/opt/one:/opt/two), AMENT_PREFIX_PATH (not set); did"
        " you mean 'my_arm'? If not, name its folder by packages: {my_amr: FOLDER} in"
        f" {tmp_path / 's.yaml'}"
    )
    assert message("package://my_arm/link.obj") == (
        f"package://my_arm/link.obj does not exist: 'my_arm' is {mine}"
    )
    assert message("package:///link.obj").endswith("has no package name; write package://NAME/FILE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert f"Drake's cache ({tmp_path}/drake/package_map/" in message("package://drake_models/x")
