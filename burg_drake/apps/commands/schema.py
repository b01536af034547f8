"""`burg-drake schema`: JSON Schemas by which editors complete and check YAML documents."""

from __future__ import annotations

import argparse

from burg_drake import core
from burg_drake.apps import options


def add_schema_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake schema`."""
    parser.epilog = options.examples_text(
        "burg-drake schema", "burg-drake schema scene -o scene.json", "burg-drake schema -o schemas"
    )
    parser.add_argument(
        "document",
        metavar="DOCUMENT",
        nargs="?",
        choices=list(core.DOCUMENT_KINDS),
        help=f"one kind of document: {', '.join(core.DOCUMENT_KINDS)}",
    )
    options.add_output(
        parser,
        "PATH",
        "file for the schema of one kind, which is printed otherwise; without DOCUMENT, a"
        " folder for the schemas of all kinds",
        required=False,
    )


def run_schema(arguments: argparse.Namespace) -> int:
    """Lists the kinds of documents, or writes or prints schemas."""
    kind, output = arguments.document, arguments.output
    if kind is None and output is None:
        _print_kinds()
    elif kind is None:
        print(f"wrote {len(core.write_schemas(output))} schemas to {output}")
    elif output is None:
        print(core.schema_text(kind), end="")
    else:
        core.atomic_write(output, core.schema_text(kind))
    return 0


def _print_kinds() -> None:
    table = core.TextTable().names("document").texts("what it is")
    for kind in core.DOCUMENT_KINDS:
        table.row(kind, core.json_schema(kind)["description"].partition(". ")[0].rstrip("."))
    table.show()
