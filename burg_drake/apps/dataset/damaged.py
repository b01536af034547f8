"""Tells what is damaged in a data set, and left out."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from burg_drake.dataset.samples import ReadableSamples


def warn_of_damage(samples: ReadableSamples) -> bool:
    """Whether samples were left out; a line on stderr then names each damaged shard or file."""
    for message, count in samples.damaged.items():
        left_out = f"{count} sample{'s are' if count > 1 else ' is'} left out"
        print(f"burg-drake: warning: {left_out}: {message}", file=sys.stderr)
    return bool(samples.damaged)
