"""What is installed is complete, declares what it imports, and is light to import."""

from __future__ import annotations

import ast
import importlib
import importlib.metadata
import importlib.util
import json
import os
import pkgutil
import re
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

import burg_drake
from burg_drake.core import data_root
from tests.hang_guard import HANG_GUARD
from tests.imports import HOUSE

CHECKOUT = Path(__file__).resolve().parents[1]
PACKAGE = Path(burg_drake.__file__).parent
HEAVY = {
    "coacd",
    "cv2",
    "embreex",
    "matplotlib",
    "networkx",
    "pxr",
    "pyarrow",
    "pydrake",
    "reportlab",
    "scipy",
    "trimesh",
}
# Distributions whose import name is another one.
IMPORT_NAMES = {
    "lazy-loader": "lazy_loader",
    "dask-jobqueue": "dask_jobqueue",
    "pillow": "PIL",
    "drake": "pydrake",
    "opencv-python-headless": "cv2",
    "pyyaml": "yaml",
    "usd-core": "pxr",
    "mujoco-warp": "mujoco_warp",
    "warp-lang": "warp",
}

try:
    importlib.metadata.distribution("burg-drake")
    INSTALLED = True
except importlib.metadata.PackageNotFoundError:
    INSTALLED = False

KERNELS = (
    "device_arrays",
    "fixed_order",
    "parallel_worlds",
    "start_kernels",
    "trial_kernels",
)
"""Modules that need Warp."""
installed_only = pytest.mark.skipif(not INSTALLED, reason="reads the metadata of an installation")
wheel_only = pytest.mark.skipif(
    os.environ.get("BURG_TEST_WHEEL") != "1", reason="checks an installed wheel; see `make test`"
)


def run_python(code: str, **options: object) -> str:
    finished = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=HANG_GUARD, **options
    )
    assert finished.returncode == 0, finished.stderr
    return finished.stdout


def files_below(folder: Path) -> set[str]:
    return {
        str(path.relative_to(folder))
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.name != ".DS_Store"
    }


@wheel_only
def test_the_wheel_is_tested_and_not_the_checkout() -> None:
    site_packages = Path(sysconfig.get_path("purelib"))
    assert site_packages / "burg_drake" == PACKAGE
    located = run_python("import burg_drake; print(burg_drake.__file__)", cwd=CHECKOUT)
    assert Path(located.strip()).parent == PACKAGE
    assert data_root() == PACKAGE / "_data"


@wheel_only
def test_wheel_holds_every_file_of_the_checkout() -> None:
    for folder in ("models", "scenes", "stations"):
        assert files_below(data_root() / folder) == files_below(CHECKOUT / folder)
    data = {name for name in files_below(PACKAGE) if name.startswith("_data")}
    assert files_below(PACKAGE) - data == files_below(CHECKOUT / "burg_drake")


@installed_only
def test_metadata() -> None:
    metadata = importlib.metadata.metadata("burg-drake")
    assert metadata["Version"] == burg_drake.__version__
    assert metadata["License-Expression"] == "MIT"
    assert metadata["Requires-Python"] == ">=3.11"
    assert (PACKAGE / "py.typed").exists()


@wheel_only
def test_links_of_the_readme_lead_somewhere_from_pypi_too() -> None:
    text = importlib.metadata.metadata("burg-drake")["Description"]
    links = re.findall(r"\]\(([^)]+)\)", text)
    assert links and all(link.startswith("https://") for link in links)


def test_citation_and_changelog_name_the_version() -> None:
    assert f"\nversion: {burg_drake.__version__}\n" in (CHECKOUT / "CITATION.cff").read_text()
    assert f"\n## [{burg_drake.__version__}] - " in (CHECKOUT / "CHANGELOG.md").read_text()


FROM_ROS = {"rospy", "rclpy"}
"""Come with an installation of ROS, not from PyPI; imported by the node alone."""


@installed_only
def test_every_import_is_a_declared_dependency() -> None:
    declared = set()
    for requirement in importlib.metadata.requires("burg-drake") or []:
        name = re.match(r"[A-Za-z0-9_.-]+", requirement)[0].lower()
        if "extra == 'dev'" not in requirement:
            declared.add(IMPORT_NAMES.get(name, name))
    for module, statements in HOUSE.statements.items():
        imported = {name for node in statements for name in top_level(node)}
        foreign = imported - set(sys.stdlib_module_names) - {"burg_drake"}
        assert foreign <= declared | FROM_ROS, module


def top_level(node: ast.Import | ast.ImportFrom) -> set[str]:
    if isinstance(node, ast.Import):
        return {alias.name.partition(".")[0] for alias in node.names}
    return {node.module.partition(".")[0]} if node.module and node.level == 0 else set()


def test_every_module_can_be_imported() -> None:
    """But for kernels without Warp, which has no oldest version."""
    has_warp = importlib.util.find_spec("warp") is not None
    for module in pkgutil.walk_packages([str(PACKAGE)], "burg_drake."):
        if has_warp or module.name.rpartition(".")[2] not in KERNELS:
            importlib.import_module(module.name)


@pytest.mark.parametrize(
    "statement",
    [
        "import burg_drake.apps.cli",
        "from burg_drake.apps.cli import main\ntry: main(['--help'])\nexcept SystemExit: pass",
    ],
)
def test_light_imports(statement: str) -> None:
    listing = "\nimport json, sys; print(); print(json.dumps(sorted(sys.modules)))"
    modules = json.loads(run_python(statement + listing).splitlines()[-1])
    assert {name.partition(".")[0] for name in modules} & HEAVY == set()


def test_workers_start_without_scipys_rotations() -> None:
    """Half of the time that importing them takes would go there."""
    run_python(
        "import sys, burg_drake.evaluation.executor\nassert 'scipy.spatial' not in sys.modules"
    )


@installed_only
def test_console_script() -> None:
    script = Path(sysconfig.get_path("scripts")) / "burg-drake"
    finished = subprocess.run(
        [script, "--help"], capture_output=True, text=True, timeout=HANG_GUARD
    )
    assert finished.returncode == 0, finished.stderr
    for verb in ("library", "scene", "evaluate", "replay"):
        assert verb in finished.stdout
