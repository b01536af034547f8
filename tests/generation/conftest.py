"""A library and a station for sampled scenes, loaded once."""

from __future__ import annotations

import pytest

from burg_drake.objects import ObjectLibrary, load_library
from burg_drake.station import Station, load_station


@pytest.fixture(scope="session")
def household() -> ObjectLibrary:
    return load_library("household")


@pytest.fixture(scope="session")
def tabletop() -> Station:
    return load_station("panda_tabletop")
