"""Options of verbs that show something in a browser."""

from __future__ import annotations

from typing import Any

from burg_drake.apps.options.arguments import Parser
from burg_drake.apps.options.values import port


def add_view(parser: Parser) -> None:
    """The options of verbs that show something."""
    parser.add_argument("--html", metavar="FILE", help="write one web page instead of a live view")
    parser.add_argument(
        "--port", type=port, metavar="N", help="port of the live view (default: first free)"
    )
    parser.add_argument(
        "--no-wait", action="store_true", help="end at once instead of waiting for Ctrl-C"
    )


def add_page(parser: Any, network: str) -> None:
    """The options of verbs that serve a page of their own.

    Args:
        parser: gets them.
        network: who can do what with it if it is not for this computer alone, after "with 0.0.0.0".
    """
    parser.add_argument(
        "--port", type=port, metavar="N", help="port of the page (default: first free)"
    )
    parser.add_argument(
        "--host",
        metavar="ADDRESS",
        default="127.0.0.1",
        help="address to serve on (default: 127.0.0.1, this computer alone); with 0.0.0.0"
        f" {network}",
    )
    parser.add_argument("--open", action="store_true", help="open the page in the browser")
