"""How a judge is built on another machine, without anything of it being imported on the way."""

from __future__ import annotations

import hashlib
import io
import pickle
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from burg_drake.evaluation.cluster.bundles.unpacked import bundle_folder
from burg_drake.evaluation.stages import Judge


@dataclass(frozen=True)
class Pickled:
    """A factory that is unpickled where it is called.

    Attributes:
        make_judge: a factory, pickled.
        folder: of the bundle, which what is pickled apart in the factory is told; None if it has
            nothing of the kind.
    """

    make_judge: bytes
    folder: Path | None = None

    def __call__(self) -> Judge:
        factory: Callable[[], Judge] = _Unpacker(self.make_judge, self.folder).load()
        return factory()


class _Unpacker(pickle.Unpickler):
    """The counterpart of `bundled_judge._Packer`."""

    def __init__(self, data: bytes, folder: Path | None) -> None:
        super().__init__(io.BytesIO(data))
        self._folder = folder

    def persistent_load(self, value: Any) -> Any:
        return replace(value, folder=self._folder)


@dataclass(frozen=True)
class JudgeRecipe:
    """How to build a judge.

    Attributes:
        make_judge: a factory, pickled.
        bundle: name of the bundle whose folder the factory is to be told; empty if it needs none.
    """

    make_judge: bytes
    bundle: str = ""

    @cached_property
    def key(self) -> str:
        """Names the judge."""
        return hashlib.sha256(self.make_judge).hexdigest()

    def load(self, place: Path) -> Pickled | None:
        """The factory for this machine; None if the bundle is not here yet.

        Args:
            place: see `unpacked.unpack`.
        """
        if not self.bundle:
            return Pickled(self.make_judge)
        folder = bundle_folder(place, self.bundle)
        return None if folder is None else Pickled(self.make_judge, folder)
