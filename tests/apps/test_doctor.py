"""`doctor`: installed and broken features, and commands to install missing ones."""

from __future__ import annotations

import importlib.metadata
import json
import sys
from pathlib import Path

import pytest

from burg_drake.apps import FeatureCheck, main
from burg_drake.apps.commands import doctor

Capture = pytest.CaptureFixture[str]
REQUIREMENTS = [
    "numpy>=2.1",
    'mujoco>=3.10; extra == "mujoco"',
    'msgspec>=0.19; extra == "ui"',
    'viser<1.2,>=1.1; extra == "ui"',
    'viser>=1.1; extra == "dev"',
    "cmeel-mimalloc>=3.4; sys_platform == 'linux'",
]


@pytest.fixture
def declared(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Sets made-up requirements; the given packages are installed."""
    installed: dict[str, str] = {}

    def version(package: str) -> str:
        if package in installed:
            return installed[package]
        raise importlib.metadata.PackageNotFoundError

    monkeypatch.setattr(importlib.metadata, "requires", lambda _: REQUIREMENTS)
    monkeypatch.setattr(importlib.metadata, "version", version)
    return installed


def test_what_is_here_is_told(capsys: Capture) -> None:
    assert main(["doctor", "--json"]) == 0
    found = {check["feature"]: check for check in json.loads(capsys.readouterr().out)["checks"]}
    drake = found["simulation (Drake)"]
    assert drake["state"] == "ok" and drake["required"]
    assert drake["found"] == f"drake {importlib.metadata.version('drake')}"
    for check in found.values():
        assert bool(check["remedy"]) == (check["state"] != "ok"), check


@pytest.mark.parametrize(
    ("checks_", "code", "line"),
    [
        (
            [FeatureCheck("a", "ok", required=True), FeatureCheck("b", "missing", "", "get b")],
            0,
            "-> get b",
        ),
        (
            [FeatureCheck("a", "broken", "no x", "mend a", required=True)],
            1,
            "cannot run: see a above",
        ),
    ],
)
def test_the_exit_code_is_about_evaluate(
    checks_: list[FeatureCheck],
    code: int,
    line: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Capture,
) -> None:
    monkeypatch.setattr(doctor, "all_checks", lambda: checks_)
    assert main(["doctor"]) == code
    assert line in capsys.readouterr().out


def test_a_package_that_cannot_be_imported_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "without_library.py").write_text("raise ImportError('libz.so: no such file')")
    (tmp_path / "deadly.py").write_text("import os\nos.abort()")
    (tmp_path / "sound.py").write_text("")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    assert doctor.import_error("sound") is None
    assert doctor.import_error("sound, without_library") == "ImportError: libz.so: no such file"
    assert doctor.import_error("deadly") == "import deadly ends the process (signal 6)"


def test_requirements_of_an_extra(declared: dict[str, str]) -> None:
    declared |= {"numpy": "2.0.9", "viser": "1.10.0", "msgspec": "0.19.0"}
    assert doctor.unmet_requirements() == ["numpy>=2.1 (2.0.9 is installed)"]
    assert doctor.unmet_requirements("mujoco") == ["mujoco>=3.10"]
    assert doctor.unmet_requirements("ui") == ["viser<1.2,>=1.1 (1.10.0 is installed)"]
    declared |= {"numpy": "2.1", "viser": "1.1.9+local", "mujoco": "3.10.1rc1"}
    for extra in ("", "ui", "mujoco"):
        assert doctor.unmet_requirements(extra) == []


def test_each_installer_has_its_command(
    declared: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    assert doctor.install_command("ui", []).endswith("pip install 'burg-drake[ui]'")
    (tmp_path / "uv-receipt.toml").touch()
    assert doctor.install_command("ui", ["usd"]) == "uv tool install 'burg-drake[usd,ui]'"
    (tmp_path / "pipx_metadata.json").touch()
    assert (
        doctor.install_command("ui", [])
        == "pipx inject burg-drake 'msgspec>=0.19' 'viser<1.2,>=1.1'"
    )


def test_limits_of_a_container(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    limit, cpu = tmp_path / "memory.max", tmp_path / "cpu.max"
    monkeypatch.setattr(doctor, "LIMIT_FILES", (str(limit),))
    monkeypatch.setattr(doctor, "QUOTA_FILE", cpu)
    whole, cores = doctor.usable_memory(), doctor.usable_cores()
    limit.write_text("max\n")
    cpu.write_text("max 100000\n")
    assert (doctor.usable_memory(), doctor.usable_cores()) == (whole, cores)
    limit.write_text("1048576\n")
    cpu.write_text("50000 100000\n")
    assert (doctor.usable_memory(), doctor.usable_cores()) == (1 << 20, 0.5)
    assert doctor._check_cores_and_memory().state == "low"


def test_a_cache_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("BURG_DRAKE_CACHE", str(tmp_path / "file" / "cache"))
    assert doctor._check_cache().state == "broken"
    monkeypatch.setenv("BURG_DRAKE_CACHE", str(tmp_path / "new" / "cache"))
    assert doctor._check_cache().state == "ok"
    monkeypatch.setenv("BURG_DRAKE_CACHE", "off")
    assert doctor._check_cache().found == "off, by BURG_DRAKE_CACHE"
