"""`burg-drake hand`: list the hands that there are, check one of your own."""

from __future__ import annotations

import argparse
from typing import Any

from burg_drake.apps.options import add_group, add_verb


def add_to(verbs: Any) -> None:
    """Adds the verbs."""
    group = add_group(verbs, "hand", "list and check hands")
    add_verb(group, "list", run_list, "list the built-in hands", "burg-drake hand list")
    check = add_verb(
        group,
        "check",
        run_check,
        "check a hand file against its model",
        "burg-drake hand check wsg_50",
        "burg-drake hand check my_hand.yaml",
    )
    check.add_argument(
        "hand",
        metavar="HAND",
        help="hand file, or built-in name (burg-drake hand list)",
    )


def run_list(arguments: argparse.Namespace) -> int:
    """Prints name and description of each built-in hand."""
    from burg_drake.core.paths import builtin_names
    from burg_drake.core.terminal import TextTable
    from burg_drake.station.document import load_hand

    hands = [load_hand(name) for name in builtin_names("models/hands")]
    table = TextTable().texts("hand", "description")
    for hand in hands:
        table.row(hand.name, hand.description)
    table.show()
    return 0


def run_check(arguments: argparse.Namespace) -> int:
    """Prints what a hand does and measures; what does not fit is an error."""
    from burg_drake.station.document import locate_hand
    from burg_drake.station.world import check_hand

    hand, model, path = locate_hand(arguments.hand)
    figures = check_hand(hand, model, path)
    low, high = (round(1e3 * width, 1) + 0.0 for width in figures.opening)
    thickness, *face = (1e3 * extent for extent in figures.pad_size)
    x, y, z = hand.X_HG.translation
    print(f"{hand.name}: the document agrees with {model}")
    print(f"  opening        {low:.1f} to {high:.1f} mm, measured between the pads")
    print(f"  pads           {face[0]:.1f} x {face[1]:.1f} mm, {thickness:.1f} mm thick")
    print(f"  grasp frame    at ({1e3 * x:g}, {1e3 * y:g}, {1e3 * z:g}) mm of {hand.body}")
    print(f"  force          {hand.force:g} N a finger")
    print(f"  closing speed  {1e3 * hand.closing_speed:g} mm/s a finger")
    print(f"  fingers        {'coupled' if hand.coupled else 'independent'}")
    return 0
