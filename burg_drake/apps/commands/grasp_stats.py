"""`burg-drake grasps stats`: figures of a set of grasps, and its comparison with another set."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
from typing import TYPE_CHECKING, Any

from burg_drake import core, grasping
from burg_drake.apps import options

if TYPE_CHECKING:
    from burg_drake.formats import ImportedGrasps


def add_grasps_stats_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake grasps stats`."""
    parser.epilog = options.examples_text(
        "burg-drake grasps stats grasps.h5",
        "burg-drake grasps stats reference.h5 mine.h5 --translation-mm 10 --angle-deg 20",
        "burg-drake grasps stats reference.h5 mine.h5 --distance-mm 15 --angle-deg 180",
        "burg-drake grasps stats runs/first --ap outcome --json stats.json",
        "",
        "The two fingers count as equal. Only grasps of the same object are compared.",
    )
    parser.add_argument(
        "a",
        metavar="A",
        type=options.input_file,
        help="grasp file of any format, or folder of a run",
    )
    parser.add_argument(
        "b", metavar="B", type=options.input_file, nargs="?", help="another one, to compare with A"
    )
    options.add_reading_options(parser)
    options.add_hand(parser, default=None)
    options.add_renaming(parser)
    match = parser.add_argument_group("grasps of A and B match if all hold")
    options.add_settings_options(match, grasping.Tolerance, "translation", "angle", "distance")
    options.add_settings_options(parser, grasping.Tolerance, "lever")
    parser.add_argument(
        "--ap",
        metavar="COLUMN",
        help="average precision of the scores against a column: friction_needed, outcome, or one"
        " of 0 and 1",
    )
    parser.add_argument("--json", metavar="FILE", help="write all figures to this file")


def run_grasps_stats(arguments: argparse.Namespace) -> int:
    """Prints the figures of one set or of two sets."""
    from burg_drake.apps.commands.grasp_tables import print_comparison, print_ranking, print_summary
    from burg_drake.evaluation import read_input

    if arguments.json is not None:
        core.require_writable(arguments.json)
    tolerance, column = options.settings_from(arguments, grasping.Tolerance), arguments.ap
    paths = [arguments.a] if arguments.b is None else [arguments.a, arguments.b]
    given = arguments.hand or arguments.gripper_link
    gripper = options.gripper_from_options(arguments) if given else None
    sets = [read_input(path, arguments.source, gripper, arguments.correction) for path in paths]
    sets = _rename_objects(sets, dict(arguments.rename))
    _require_same_frames(paths, sets)
    summaries = [grasping.summarize(s.grasps, lever=tolerance.lever) for s in sets]
    rankings = [] if column is None else [grasping.rank_by(s.grasps, column) for s in sets]
    comparison = (
        grasping.compare_grasps(sets[0].grasps, sets[1].grasps, tolerance)
        if len(sets) == 2
        else None
    )
    for k, path in enumerate(paths):
        print_summary(path, summaries[k], sets[k].notes, sets[k].frame)
        if rankings:
            print_ranking(rankings[k])
    if comparison is not None:
        print_comparison(comparison)
    if arguments.json is not None:
        inputs = [{"file": p, "frame": s.frame} for p, s in zip(paths, sets, strict=True)]
        figures = {"sets": inputs, "summaries": summaries, "rankings": rankings}
        text = json.dumps(_json_value({**figures, "comparison": comparison}), indent=2)
        core.atomic_write(arguments.json, text + "\n")
        print(f"wrote {arguments.json}")
    return 0


def _rename_objects(sets: list[ImportedGrasps], names: dict[str, str]) -> list[ImportedGrasps]:
    """The sets with renamed objects; refuses a name that no set has."""
    from burg_drake.formats import with_objects_renamed

    known = [set(imported.grasps.object.tolist()) for imported in sets]
    everywhere = set().union(*known)
    found = []
    for imported, own in zip(sets, known, strict=True):
        others = everywhere - own  # may be in one set only
        own_names = {theirs: ours for theirs, ours in names.items() if theirs not in others}
        found.append(
            dataclasses.replace(imported, grasps=with_objects_renamed(imported.grasps, own_names))
        )
    return found


def _require_same_frames(paths: list[str], sets: list[ImportedGrasps]) -> None:
    if len({imported.frame for imported in sets}) > 1:
        frames = " and ".join(f"{p} ({s.frame})" for p, s in zip(paths, sets, strict=True))
        raise core.InvalidInputError(
            f"grasps are measured in different frames: {frames}; place them first with"
            " `burg-drake grasps convert --scene`"
        )


def _json_value(value: Any) -> Any:
    """The value for JSON: shares with their ratio, null for numbers that are not finite."""
    if isinstance(value, grasping.TopPrecision):
        figures = {"ap": value.ap, "attainable": value.attainable, "kept": len(value.kept)}
        by_criterion = value.by_criterion.tolist()
        return _json_value({**figures, "by_criterion": by_criterion, "version": value.version})
    if dataclasses.is_dataclass(value):
        fields = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
        return _json_value(
            {**fields, "share": value.value} if isinstance(value, grasping.Share) else fields
        )
    if isinstance(value, dict):
        return {str(key): _json_value(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_json_value(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
