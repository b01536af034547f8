"""Whatever is in a file, reading it ends in what it holds or in one line that names it.

`benchmarks/fuzz.py` goes on for as long as one likes.
"""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from tests.fuzzing.damage import damaged
from tests.fuzzing.readers import READERS, Reader, failure

EXAMPLES = 25
"""Of damaged files for a reader."""


@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)
def test_damaged_files_are_read_or_refused_in_one_line(reader: Reader, tmp_path: Path) -> None:
    path = tmp_path / reader.file
    reader.make(path)
    reader.read(path)  # the sound one is no error
    content = path.read_bytes()

    @settings(
        max_examples=max(1, round(EXAMPLES * reader.share)),
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(random=st.randoms(use_true_random=False))
    def check(random: Random) -> None:
        path.write_bytes(damaged(content, reader.kind, random, tmp_path))
        assert failure(reader, path) is None

    check()
