"""A small scene without physics behind it, and judges whose verdicts are known."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from burg_drake.scene.scene import Scene
from burg_drake.station.station import Station, load_station

# Worker processes and scripts import the judges by name.
sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    """Two cubes and a bar on a board."""
    from known_scene import write_scene

    return write_scene(tmp_path)


@pytest.fixture
def station() -> Station:
    """The built-in station."""
    return load_station("panda_tabletop")


@pytest.fixture
def known_judge(monkeypatch: pytest.MonkeyPatch) -> None:
    """Puts `known_judge.KnownJudge` in the place of the simulation."""
    import known_judge

    known_judge.install(monkeypatch.setattr)
