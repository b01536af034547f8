"""The option --cluster of verbs that can use other machines."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from burg_drake.evaluation.workers import Executor


def add_cluster(group: Any) -> None:
    """Adds the option.

    Args:
        group: of options that exclude each other, as the cluster has its own workers.
    """
    group.add_argument(
        "--cluster",
        metavar="WHERE",
        help="work on a cluster of Dask: tls://HOST:PORT of a scheduler, a cluster.yaml, or"
        " local:N for N workers on this machine (needs burg-drake[dask]; see"
        " https://burg-drake.github.io/burg_drake/tutorials/label_object_set.html)",
    )


@contextlib.contextmanager
def chosen_cluster(arguments: argparse.Namespace) -> Iterator[Executor | None]:
    """The cluster that is asked for, until the block is left; None for this machine's processes."""
    if arguments.cluster is None:
        yield None
        return
    from burg_drake.evaluation.cluster import connect_cluster

    with connect_cluster(arguments.cluster) as executor:
        yield executor
