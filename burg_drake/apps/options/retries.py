"""Trying again what could not be simulated: the option, and what is said about it."""

from __future__ import annotations

import argparse


def add_retry_failed(parser: argparse.ArgumentParser, what: str) -> None:
    """Adds --retry-failed.

    Args:
        parser: of the verb.
        what: is tried again, in the plural.
    """
    parser.add_argument(
        "--retry-failed",
        action="store_true",
        help=f"also retry {what} that could not be simulated",
    )


def how_to_retry(interrupted: int, failed: int) -> str:
    """What to do about failures, in one clause.

    Args:
        interrupted: of how many the worker process was ended from outside.
        failed: how many there are in all.
    """
    if not interrupted:
        return "--retry-failed tries them again"
    again = (
        f"{interrupted} of them because a worker process was ended from outside, as happens"
        " when memory runs out: the same command tries these again (fewer --workers need less)"
    )
    return again if interrupted == failed else f"{again}, --retry-failed all"
