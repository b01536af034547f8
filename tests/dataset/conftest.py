"""Data sets in memory that exports are made of; none of them is changed."""

from __future__ import annotations

import pytest

from burg_drake.objects import ObjectLibrary
from tests.dataset.polyhedra import InMemory, scene_of, some_grasps, write_library


@pytest.fixture(scope="session", autouse=True)
def _measured_once(measured_once: None) -> None:
    """Exports look for the symmetries of the same built-in objects again and again."""


@pytest.fixture(scope="session")
def bodies(tmp_path_factory: pytest.TempPathFactory) -> ObjectLibrary:
    """The library of both bodies."""
    return write_library(tmp_path_factory.mktemp("library"))


@pytest.fixture(scope="session")
def samples(bodies: ObjectLibrary) -> InMemory:
    """Two scenes of two views, the second with two instances of an object."""
    return InMemory((*scene_of(3), *scene_of(5, twice=True)), bodies)


@pytest.fixture(scope="session")
def single(bodies: ObjectLibrary) -> InMemory:
    """A scene that has each object once, with grasps."""
    return InMemory(tuple(scene_of(0, grasps=some_grasps())), bodies)
