"""Lets the tests beside it import the module that they share, and what it makes."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from recording import RecordingMeshcat


@pytest.fixture
def recorder() -> RecordingMeshcat:
    return RecordingMeshcat()
