"""One station for all tests of sessions, without an arm, which would be slow to load."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from burg_drake.compose import ComposeSession
from burg_drake.station import Station, load_station


@pytest.fixture(scope="session")
def station() -> Station:
    return load_station("wsg_tabletop")


@pytest.fixture
def session(station: Station, tmp_path: Path) -> Iterator[ComposeSession]:
    with ComposeSession.open("household", station, folder=tmp_path) as session:
        yield session
