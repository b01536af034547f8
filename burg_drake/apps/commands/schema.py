"""`burg-drake schema`: JSON Schemas by which editors complete and check YAML documents."""

from __future__ import annotations

import argparse

from burg_drake.apps.options.arguments import Parser, add_output, examples_text


def add_schema_options(parser: Parser) -> None:
    """Adds the options of `burg-drake schema`."""
    from burg_drake.core import DOCUMENT_KINDS

    parser.epilog = examples_text(
        "burg-drake schema", "burg-drake schema scene -o scene.json", "burg-drake schema -o schemas"
    )
    parser.add_argument(
        "document",
        metavar="DOCUMENT",
        nargs="?",
        choices=list(DOCUMENT_KINDS),
        help=f"one kind of document: {', '.join(DOCUMENT_KINDS)}",
    )
    add_output(
        parser,
        "PATH",
        "file for the schema of one kind, which is printed otherwise; without DOCUMENT, a"
        " folder for the schemas of all kinds",
        required=False,
    )


def run_schema(arguments: argparse.Namespace) -> int:
    """Lists the kinds of documents, or writes or prints schemas."""
    from burg_drake.core import atomic_write, schema_text, write_schemas

    kind, output = arguments.document, arguments.output
    if kind is None and output is None:
        _print_kinds()
    elif kind is None:
        print(f"wrote {len(write_schemas(output))} schemas to {output}")
    elif output is None:
        print(schema_text(kind), end="")
    else:
        atomic_write(output, schema_text(kind))
    return 0


def _print_kinds() -> None:
    from burg_drake.core import DOCUMENT_KINDS, TextTable, json_schema

    table = TextTable().names("document").texts("what it is")
    for kind in DOCUMENT_KINDS:
        table.row(kind, json_schema(kind)["description"].partition(". ")[0].rstrip("."))
    table.show()
