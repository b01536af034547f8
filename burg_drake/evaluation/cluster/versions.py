"""What has to be the same on all machines, so that they come to the same verdicts and images."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path

import burg_drake
from burg_drake.core import JUDGING, ClusterError, content_hash, software_versions
from burg_drake.station.document import ENGINES

DECIDING = {
    **JUDGING,
    **{name: package for e in ENGINES.values() for name, package in e.packages.items()},
    "opencv": "opencv-python-headless",
}
"""Packages that decide about verdicts or images, as they are called and installed; those of all
engines, as any may be asked for."""
CODE = (".py", ".json")
"""Suffixes of files of the package that decide about them: modules, and curves of confidences."""


@functools.cache
def software() -> dict[str, str]:
    """Versions by name; of burg_drake also a hash of its code, as releases under way differ."""
    code = code_hash(Path(burg_drake.__file__).parent)
    return {**software_versions(DECIDING, with_platform=False), "code of burg_drake": code}


def code_hash(package: Path) -> str:
    """Hash of all files of an installed package that decide about results."""
    files = sorted(file for file in package.rglob("*") if file.suffix in CODE)
    names = [file.relative_to(package).as_posix() for file in files]
    return content_hash(names, files)[:12]


def require_same(workers: Mapping[str, Mapping[str, str] | BaseException]) -> None:
    """Refuses workers with other versions than ours.

    Args:
        workers: what `software` returned, by the worker's address; an error if it could not.

    Raises:
        ClusterError: names the first such worker, and how many there are.
    """
    ours = software()
    refused = []
    for address, theirs in workers.items():
        if isinstance(theirs, BaseException):
            refused.append(f"worker {address} cannot run burg_drake ({_words(theirs)})")
            continue
        other = [
            f"{name} {theirs.get(name, 'none')} (here {version})"
            for name, version in ours.items()
            if theirs.get(name) != version
        ]
        if other:
            refused.append(f"worker {address} has {', '.join(other)}")
    if refused:
        more = f", and {len(refused) - 1} more differ" if len(refused) > 1 else ""
        raise ClusterError(
            f"{refused[0]}{more}; results agree only if all machines have the same"
            " versions: install the same environment on all of them"
        )


def _words(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())
