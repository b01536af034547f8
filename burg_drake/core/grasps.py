"""`GraspSet`: grasps as a struct of arrays, with lossless storage."""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core.content import content_hash
from burg_drake.core.errors import InvalidInputError
from burg_drake.core.files import atomic_write
from burg_drake.core.frames import Array, check_pose

FORMAT = "burg_drake.grasps"
VERSION = 1
ID_DIGITS = 12
"""Hexadecimal digits of an identifier; among 100,000 grasps two share one with chance 2e-5."""

COLUMNS = ("X_OG", "width", "id", "object", "score")


@dataclass(frozen=True, eq=False)
class GraspSet:
    """N grasps, possibly of several objects.

    Attributes:
        X_OG: (N, 4, 4) grasp poses in the object frame.
        width: (N,) distance between the contacts along the closing direction [m]; NaN if unknown.
        id: (N,) identifiers that follow from object, pose and width.
        object: (N,) names of the library objects.
        score: (N,) quality, higher is better; NaN if unknown.
        provenance: how the set was made (sampler, parameters, seeds, hashes); JSON values.
    """

    X_OG: Array
    width: Array
    id: NDArray[np.str_]
    object: NDArray[np.str_]
    score: Array
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.X_OG.ndim != 3 or self.X_OG.shape[1:] != (4, 4):
            raise InvalidInputError(
                f"GraspSet.X_OG has shape {self.X_OG.shape}; expected (N, 4, 4)"
            )
        n = len(self.X_OG)
        for name in ("width", "id", "object", "score"):
            if getattr(self, name).shape != (n,):
                raise InvalidInputError(
                    f"GraspSet.{name} has shape {getattr(self, name).shape}; expected ({n},)"
                )

    @classmethod
    def create(
        cls,
        X_OG: ArrayLike,
        *,
        object: str | ArrayLike,
        width: ArrayLike | None = None,
        score: ArrayLike | None = None,
        provenance: Mapping[str, Any] | None = None,
    ) -> GraspSet:
        """Checks the poses, fills what is not given and computes the identifiers.

        Args:
            X_OG: (N, 4, 4) or (4, 4) grasp poses in the object frame.
            object: one name for all, or (N,) names.
            width: (N,) or scalar [m]; NaN if None.
            score: (N,) or scalar; NaN if None.
            provenance: JSON-compatible mapping.

        Raises:
            InvalidInputError: a pose is not a finite rigid transform, shapes do not fit, or the
                provenance is not JSON-compatible.
        """
        poses = check_pose(X_OG, "X_OG") + 0.0  # a copy without negative zeros: equal, equal id
        poses = poses.reshape(-1, 4, 4)
        n = len(poses)
        names = _column("object", np.asarray(object, dtype=str), n)
        widths = _column("width", np.asarray(np.nan if width is None else width, float), n) + 0.0
        scores = _column("score", np.asarray(np.nan if score is None else score, float), n)
        ids = [
            content_hash(str(o), X, w)[:ID_DIGITS]
            for o, X, w in zip(names, poses, widths, strict=True)
        ]
        try:
            plain = json.loads(json.dumps(dict(provenance or {})))
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"provenance has to consist of JSON values: {error}") from error
        return cls(poses, widths, np.array(ids, dtype=f"<U{ID_DIGITS}"), names, scores, plain)

    def __len__(self) -> int:
        return len(self.X_OG)

    def select(self, index: ArrayLike) -> GraspSet:
        """Subset by boolean mask, integer array or slice; the provenance is kept."""
        i = index if isinstance(index, slice) else np.atleast_1d(np.asarray(index))
        if not isinstance(i, slice) and i.size == 0 and i.dtype != bool:
            i = i.astype(int)  # an empty list is an array of floats
        return GraspSet(
            self.X_OG[i], self.width[i], self.id[i], self.object[i], self.score[i], self.provenance
        )

    @staticmethod
    def concatenate(sets: Iterable[GraspSet]) -> GraspSet:
        """One set of all; the provenances are listed under `parts`.

        Raises:
            InvalidInputError: there is no set to join.
        """
        parts = list(sets)
        if not parts:
            raise InvalidInputError("cannot concatenate zero grasp sets; give at least one")
        return GraspSet(
            np.concatenate([s.X_OG for s in parts]),
            np.concatenate([s.width for s in parts]),
            np.concatenate([s.id for s in parts]),
            np.concatenate([s.object for s in parts]),
            np.concatenate([s.score for s in parts]),
            {"parts": [dict(s.provenance) for s in parts]},
        )

    def save(self, path: str | Path) -> None:
        """Writes a `.npz` file that `load` restores bit for bit."""
        header = {"format": FORMAT, "version": VERSION, "provenance": dict(self.provenance)}
        buffer = io.BytesIO()
        columns = {name: getattr(self, name) for name in COLUMNS}
        np.savez_compressed(buffer, header=np.array(json.dumps(header)), **columns)
        atomic_write(path, buffer.getvalue())

    @classmethod
    def load(cls, path: str | Path) -> GraspSet:
        """Reads a file written by `save`.

        Raises:
            InvalidInputError: not such a file, or of a newer version.
        """
        try:
            with zipfile.ZipFile(path):  # np.load takes other kinds of file as well
                pass
            with np.load(path, allow_pickle=False) as data:
                header = json.loads(str(data["header"]))
                if (header["format"], header["version"]) != (FORMAT, VERSION):
                    raise InvalidInputError(
                        f"{path} has format {header['format']!r} version {header['version']!r};"
                        f" this release reads {FORMAT!r} version {VERSION}"
                    )
                X_OG, width, id, object, score = (data[name] for name in COLUMNS)
                return cls(X_OG, width, id, object, score, header["provenance"])
        except InvalidInputError:
            raise
        except OSError as error:
            raise InvalidInputError(f"cannot read {path}: {error.strerror or error}") from error
        except (ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, zlib.error) as error:
            reason = str(error) or type(error).__name__
            raise InvalidInputError(
                f"{path} is not a grasp set written by burg_drake: {reason}"
            ) from error


def _column(name: str, values: NDArray[Any], n: int) -> NDArray[Any]:
    """A copy of (n,) values, or of a scalar n times."""
    if values.shape not in ((), (n,)):
        raise InvalidInputError(f"{name} has shape {values.shape}; expected ({n},) or one value")
    return np.array(np.broadcast_to(values, (n,)))
