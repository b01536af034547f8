"""A share of a run: what one of several machines judges of it.

Which share a scene or a grasp belongs to follows from its place alone, so that machines need not
talk to each other; `merge` puts together what they find.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from burg_drake.core import InvalidInputError, quoted

Shared = TypeVar("Shared")
MOST = 1_000_000


@dataclass(frozen=True)
class Shard:
    """One of several shares.

    Attributes:
        number: of this one, from 1.
        count: how many there are.
    """

    number: int
    count: int

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.count <= MOST:
            raise InvalidInputError(
                f"there is no shard {self.number}/{self.count}; give K/N with K from 1 to"
                " N, such as 2/8"
            )

    @classmethod
    def parse(cls, text: str) -> Shard:
        """Reads `K/N`.

        Raises:
            InvalidInputError: it is something else.
        """
        found = re.fullmatch(r"(\d{1,7})/(\d{1,7})", text)
        if found is None:
            raise InvalidInputError(f"{quoted(text)} is not a shard; give K/N, such as 2/8")
        return cls(int(found[1]), int(found[2]))

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"

    def has(self, place: int) -> bool:
        """Whether what has this place, from 0, is in it."""
        return place % self.count == self.number - 1

    def divides_scenes(self, scenes: int) -> bool:
        """Whether scenes are shared out as wholes, as they are if there are enough; otherwise the
        grasps of each."""
        return scenes >= self.count


def as_shard(shard: Shard | str | None) -> Shard | None:
    """A shard, or what `K/N` says; none if there are no others.

    Raises:
        InvalidInputError: it does not exist.
    """
    found = Shard.parse(shard) if isinstance(shard, str) else shard
    return None if found is None or found.count == 1 else found


def share(items: Sequence[Shared], shard: Shard | str | None) -> Sequence[Shared]:
    """What of some items is in a shard; all of them without one."""
    found = as_shard(shard or None)
    return items if found is None else items[found.number - 1 :: found.count]
