"""A small scene without physics behind it, and judges whose verdicts are known."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from burg_drake.evaluation import Campaign, EvaluationSettings, Run, evaluate, load_run
from burg_drake.scene import Scene
from burg_drake.station import Station, load_station

# Worker processes and scripts import the judges by name.
sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="module", autouse=True)
def no_chart_of_reach(no_pose_mistakes: None) -> Iterator[None]:
    """How far the arm reaches is most of the work of a page, and has a test of its own."""
    with pytest.MonkeyPatch.context() as patch:
        place = "burg_drake.evaluation.report.pages.reachability_section"
        patch.setattr(place, lambda run: None)
        yield


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


@pytest.fixture(scope="session")
def known_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A complete run of `scene` by the known judge; nobody changes it, its scene or its library."""
    import known_judge
    from known_scene import write_scene

    folder = tmp_path_factory.mktemp("known")
    with pytest.MonkeyPatch.context() as patch:
        known_judge.install(patch.setattr)
        return evaluate(
            write_scene(folder),
            load_station("panda_tabletop"),
            folder / "run",
            settings=EvaluationSettings(grasps_per_object=30, blind=True),
            workers=1,
            progress=False,
        )


@pytest.fixture
def own_run(known_run: Run, scene: Scene, tmp_path: Path, known_judge: None) -> Run:
    """A copy of it, made of `scene`, that a test may change."""
    folder = shutil.copytree(known_run.path, tmp_path / "run")
    for name in ("run.yaml", "results.csv", "report.html"):
        text = (folder / name).read_text(encoding="utf-8")
        moved = text.replace(str(known_run.path.parent), str(tmp_path))
        (folder / name).write_text(moved, encoding="utf-8")
    return load_run(folder)


@pytest.fixture(scope="session")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Files of three scenes; nobody changes them."""
    from known_many import write_scenes

    return write_scenes(tmp_path_factory.mktemp("many"))


@pytest.fixture(scope="session")
def whole(scenes: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """A complete run over the three scenes, without pages; who changes it takes a copy."""
    import known_judge
    from known_many import empty_pages, run_all

    with pytest.MonkeyPatch.context() as patch:
        known_judge.install(patch.setattr)
        empty_pages(patch.setattr)
        out = tmp_path_factory.mktemp("whole") / "all"
        return run_all(scenes, load_station("panda_tabletop"), out)


@pytest.fixture
def pages(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports have nothing in them, unless a test asks for `reports`."""
    from known_many import empty_pages

    if "reports" not in request.fixturenames:
        empty_pages(monkeypatch.setattr)


@pytest.fixture
def reports() -> None:
    """Reports are those that a user gets."""
