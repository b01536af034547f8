"""Names of instances as a format allows them."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from burg_drake.export.layout import Layout

_RESERVED = re.compile(r"world|__.*__|(?:World|Default)ModelInstance")
"""Of SDFormat and Drake; MuJoCo calls the world `world`, too."""


def model_name(name: str) -> str:
    """A name that SDFormat, Drake and MuJoCo have no use for themselves."""
    return f"{name}_1" if _RESERVED.fullmatch(name) else name


@dataclass(frozen=True)
class LegalNames:
    """Names in a format by the names of instances and boxes.

    Attributes:
        by_name: the same where the format allows that.
    """

    by_name: dict[str, str]

    def __getitem__(self, name: str) -> str:
        return self.by_name[name]

    @property
    def notes(self) -> tuple[str, ...]:
        """Which names are others, one sentence each."""
        return tuple(
            f"{name!r} is called {legal!r} in the export, as the format does not allow the name"
            for name, legal in self.by_name.items()
            if legal != name
        )

    @classmethod
    def of_sdf(cls, layout: Layout) -> LegalNames:
        """Names of models in SDFormat and in Drake; those of bodies in MJCF are the same."""
        return cls._unique(layout, model_name)

    @classmethod
    def of_usd(cls, layout: Layout) -> LegalNames:
        """Names of prims in USD: letters, digits and `_`, no digit in front."""
        return cls._unique(layout, lambda name: re.sub(r"^(?=\d)|[^A-Za-z0-9_]", "_", name))

    @classmethod
    def _unique(cls, layout: Layout, legal: Callable[[str], str]) -> LegalNames:
        """Legal names stay; the others get one that none has."""
        names = [*(placed.name for placed in layout.objects), *layout.boxes]
        by_name = {name: name for name in names if legal(name) == name}
        for name in names:
            if name in by_name:
                continue
            base, candidate, number = legal(name), legal(name), 1
            while candidate in by_name.values():
                number += 1
                candidate = f"{base}_{number}"
            by_name[name] = candidate
        return cls({name: by_name[name] for name in names})
