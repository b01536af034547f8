"""Options of verbs that show something in a browser."""

from __future__ import annotations

from typing import Any

from burg_drake.apps.options.arguments import Parser
from burg_drake.apps.options.values import port


def add_view(parser: Parser) -> None:
    """The options of verbs that show something."""
    parser.add_argument(
        "--html", metavar="FILE", help="write one self-contained page instead of a live view"
    )
    parser.add_argument(
        "--port", type=port, metavar="N", help="where the live view listens (default: first free)"
    )
    parser.add_argument(
        "--no-wait", action="store_true", help="do not keep the live view open until Ctrl-C"
    )


def add_page(parser: Any, network: str) -> None:
    """The options of verbs that serve a page of their own.

    Args:
        parser: gets them.
        network: who can do what with it if it is not for this computer alone, after "with 0.0.0.0".
    """
    parser.add_argument(
        "--port", type=port, metavar="N", help="where the page is served (default: first free)"
    )
    parser.add_argument(
        "--host",
        metavar="ADDRESS",
        default="127.0.0.1",
        help="address to serve it on. The default is for this computer alone; with 0.0.0.0"
        f" {network}",
    )
    parser.add_argument("--open", action="store_true", help="open the page in the browser")
