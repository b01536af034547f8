"""The report's section about what the arm reaches of the board."""

from __future__ import annotations

import dataclasses

import pytest
from page_reading import part, read_page

from burg_drake.evaluation import Run, reachability_section, report_page
from burg_drake.scene import Scene


@pytest.fixture
def run(own_run: Run) -> Run:
    return own_run


def test_it_shows_where_the_objects_stand(
    run: Run, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the page, too, which other tests with the known judge do without."""
    place = "burg_drake.evaluation.report.pages.reachability_section"
    monkeypatch.setattr(place, reachability_section)
    section = reachability_section(run)
    assert section is not None and len(section.charts) == 2
    section = part(read_page(report_page(run)), "Reach of the arm")
    assert len(section.find("svg")) == 3  # two heights and the key
    for said in ("Reach of the arm", "5 cm above the board", "15 cm above the board", "68 hand"):
        assert said in section.text
    for name in scene.instances:
        assert [node.text for node in section.find("text")].count(name) == 2


def test_without_the_arm_there_is_none(run: Run) -> None:
    document = dataclasses.replace(run.document, mode="hand")
    assert reachability_section(Run(run.path, document)) is None


def test_without_the_documents_of_then_there_is_none(run: Run) -> None:
    path = run.path / "station.yaml"
    moved = path.read_text(encoding="utf-8").replace("0.24", "0.25", 1)
    path.write_text(moved, encoding="utf-8")
    assert reachability_section(Run(run.path, run.document)) is None
