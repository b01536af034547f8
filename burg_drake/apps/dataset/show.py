"""`burg-drake dataset show`: a sample in 3D, or samples from all over on a sheet."""

from __future__ import annotations

import argparse
from typing import Any

from burg_drake.apps.dataset.damaged import warn_of_damage
from burg_drake.apps.options import Parser, add_verb, add_view, positive_int


def add_to(group: Any) -> None:
    """Adds the verb."""
    add_verb(
        group,
        "show",
        run_show,
        "show a sample in 3D, or many on a sheet",
        "burg-drake dataset show data",
        "burg-drake dataset show data --sample 000012_003 --html sample.html",
        "burg-drake dataset show data -o sheet.html",
        "burg-drake dataset show data -o sheet.png --rows 6",
        options=_add_options,
    )


def _add_options(parser: Parser) -> None:
    parser.add_argument("data", metavar="DATA", help="folder of the data set")
    parser.add_argument(
        "--sample",
        metavar="KEY",
        help="sample to show (default: the first)",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help="write a sheet of samples (.png, .html)",
    )
    parser.add_argument(
        "--rows", metavar="N", type=positive_int, default=4, help="rows of the sheet (default: 4)"
    )
    parser.add_argument(
        "--columns",
        metavar="N",
        type=positive_int,
        default=1,
        help="columns of the sheet (default: 1)",
    )
    add_view(parser)


def run_show(arguments: argparse.Namespace) -> int:
    """Shows a sample in 3D, or writes a sheet; those that are damaged are left out, and named."""
    from burg_drake.apps.terminal import open_view, present, print_legend
    from burg_drake.core import InvalidInputError
    from burg_drake.dataset.exchange import contact_sheet, sample_caption, show_sample, spread
    from burg_drake.dataset.samples import ReadableSamples, load_dataset

    dataset = load_dataset(arguments.data)
    if not len(dataset):
        raise InvalidInputError(f"{arguments.data} has no samples to show")
    samples, key = ReadableSamples(dataset), arguments.sample
    chosen = None if key is None else dataset[dataset.index(key)]
    rows, columns = arguments.rows, arguments.columns
    if arguments.output is not None:
        indices = spread(len(dataset), rows * columns)
        shown = [chosen] if chosen is not None else list(samples.read(indices))
        contact_sheet(shown, arguments.output, rows, columns, title=dataset.name)
        print(f"wrote {arguments.output}")
        if arguments.html is None:
            warn_of_damage(samples)
            return 0
    sample = chosen if chosen is not None else next(iter(samples))
    warn_of_damage(samples)
    scene, station = dataset.scene(sample.scene), dataset.station
    meshcat = open_view(arguments)
    legend = show_sample(sample, scene, station, meshcat)
    print_legend(legend)
    title = f"{dataset.name} {sample.key}"
    present(meshcat, arguments, title=title, caption=[sample_caption(sample)], legend=legend)
    return 0
