"""`burg-drake dataset export`: a data set in another project's format."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from burg_drake.apps.dataset.damaged import warn_of_damage
from burg_drake.apps.options import Parser, add_verb, positive

FORMATS = {
    "bop": ("sensor_depth", "depth_unit"),
    "coco": (),
    "graspnet": ("sensor_depth",),
    "webdataset": ("depth_unit",),
}
"""Formats, and which options of depth they take."""


def add_to(group: Any) -> None:
    """Adds the verb."""
    add_verb(
        group,
        "export",
        run_export,
        "convert to BOP, COCO, GraspNet or WebDataset",
        "burg-drake dataset export data --to bop -o data_bop",
        "burg-drake dataset export data --to graspnet --sensor-depth -o data_graspnet",
        "",
        "Damaged samples are named and left out; the exit code is then 1.",
        options=_add_options,
    )


def _add_options(parser: Parser) -> None:
    parser.add_argument("data", metavar="DATA", help="folder of the data set")
    parser.add_argument("--to", required=True, choices=tuple(FORMATS), help="format")
    parser.add_argument(
        "-o", "--output", metavar="FOLDER", required=True, help="folder to write, new or empty"
    )
    parser.add_argument(
        "--sensor-depth",
        action="store_true",
        help="write the depth of the imitated camera, not the exact one",
    )
    parser.add_argument(
        "--depth-unit",
        metavar="METRES",
        type=positive,
        help="unit of depth images (default: 0.0001; graspnet: 0.001)",
    )


def run_export(arguments: argparse.Namespace) -> int:
    """Writes a data set in another format; what that cannot carry goes to stderr. 1 if some
    samples are damaged, and left out."""
    from burg_drake.core import InvalidInputError
    from burg_drake.dataset.exchange import write_bop, write_coco, write_graspnet, write_webdataset
    from burg_drake.dataset.samples import ReadableSamples, load_dataset

    writers: dict[str, Any] = {
        "bop": write_bop,
        "coco": write_coco,
        "graspnet": write_graspnet,
        "webdataset": write_webdataset,
    }
    given = {"sensor_depth": arguments.sensor_depth or None, "depth_unit": arguments.depth_unit}
    options = {name: value for name, value in given.items() if value is not None}
    for name in options:
        if name not in FORMATS[arguments.to]:
            known = [one for one, taken in FORMATS.items() if name in taken]
            raise InvalidInputError(
                f"{arguments.to} takes no {name.replace('_', ' ')}, which"
                f" {' and '.join(known)} take"
            ).about(name)
    samples = ReadableSamples(load_dataset(arguments.data))
    for remark in writers[arguments.to](samples, arguments.output, **options):
        print(f"burg-drake: warning: {remark}", file=sys.stderr)
    damaged = warn_of_damage(samples)
    written = len(samples) - sum(samples.damaged.values())
    print(f"wrote {arguments.output}: {written} samples")
    return int(damaged)
