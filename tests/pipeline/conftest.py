"""Builds of the same few objects share what was measured on them."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="session", autouse=True)
def _measured_once(measured_once: None) -> None:
    """`tests/objects` has the tests of the measuring itself."""
