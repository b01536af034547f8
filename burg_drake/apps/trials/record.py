"""`burg-drake trials record`: what became of a trial, with a photo of the scene before it."""

from __future__ import annotations

import argparse
import contextlib
import sys
from datetime import date, datetime
from typing import TYPE_CHECKING, Any, Literal

from burg_drake.apps.options import (
    add_depth_unit,
    add_intrinsics,
    add_measured_board,
    add_verb,
    not_negative,
    print_scale,
)
from burg_drake.apps.trials.arguments import add_moved, add_sheet
from burg_drake.core import InvalidInputError, quoted

if TYPE_CHECKING:
    from burg_drake.cameras.placement import PlacementCheck
    from burg_drake.experiment.trials import RealTrial, TrialBook, TrialSheet

OF_PHOTO = ("intrinsics", "depth", "depth_unit", "scene")
"""Options that are about a photo."""
LONGEST_NUMBER = 9
WORDS = ("note", "operator")


def add_to(group: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        group,
        "record",
        run_record,
        "record the outcome of a trial",
        "burg-drake trials record trials.yaml 17 --outcome lifted",
        "burg-drake trials record trials.yaml next --outcome slipped --note 'wet fingers'",
        "burg-drake trials record trials.yaml 17 --photo photo.png --intrinsics K.yaml",
        "burg-drake trials record trials.yaml 17 --outcome dropped --correct",
        "",
        "Only this trial changes in the file; a journal beside it keeps every entry. Exit code 1"
        " if a photo does not show the board; the rest is recorded.",
    )
    add_sheet(parser)
    parser.add_argument("number", metavar="NUMBER", help="number of the trial, or next")
    parser.add_argument(
        "--outcome", metavar="OUTCOME", help="outcome, such as lifted, slipped, no_ik"
    )
    for name, what in (("note", "a note"), ("operator", "name of the operator")):
        parser.add_argument(f"--{name}", metavar="TEXT", help=what)
    parser.add_argument(
        "--time",
        metavar="TIME",
        type=_time,
        help="time in ISO 8601, or a day (default: now)",
    )
    robot = parser.add_argument_group("what the robot measured at the end")
    robot.add_argument(
        "--width-mm", metavar="MM", type=not_negative, help="distance between the pads"
    )
    robot.add_argument("--effort-n", metavar="N", type=not_negative, help="gripping force")
    _add_photo(parser.add_argument_group("photo of the scene before the trial"))
    add_moved(parser)
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--correct", action="store_true", help="replace the entry")
    how.add_argument(
        "--again",
        action="store_true",
        help="the trial was repeated: replace all its entries",
    )


def _add_photo(group: Any) -> None:
    group.add_argument("--photo", metavar="FILE", help="photo, copied to photos/")
    add_intrinsics(group, "intrinsics of the camera; the placement of objects is then measured")
    group.add_argument("--depth", metavar="FILE", help="depth image of the same camera")
    add_depth_unit(group)
    group.add_argument("--scene", metavar="SCENE", help="scene file (default: the run's copy)")
    add_measured_board(group)
    group.add_argument(
        "--placement", metavar="FILE", help="placement file of `camera placement`, if there is one"
    )


def run_record(arguments: argparse.Namespace) -> int:
    """Measures and records; 1 if the photo has no board."""
    from burg_drake.experiment.trials import TrialBook, keep_evidence, object_places, real_outcome

    _require_sense(arguments)
    if arguments.outcome is not None:
        real_outcome(arguments.outcome)
    book = TrialBook(arguments.trials)
    sheet = book.sheet()
    trial = book.trial(_number(arguments.number, sheet))
    entry = _entry(arguments)
    book.require_open(trial, entry, correct=arguments.correct, again=arguments.again)
    check = _check(arguments, sheet, trial)
    found = check is not None and not check.reason
    if arguments.photo or check is not None:
        kept = check if found else None
        photo = keep_evidence(arguments.trials, trial.number, photo=arguments.photo, check=kept)
        entry |= {"photo": photo} if photo else {}
    if check is not None and found:
        entry["placement"] = object_places(check)
    recorded = _record(book, arguments, trial, entry)
    if arguments.photo and not (arguments.intrinsics or arguments.placement):
        print("no placement was measured: --intrinsics FILE of the camera is missing")
    _print_recorded(recorded, book.sheet(), check if found else None)
    if arguments.width_mm is not None:
        _warn_of_width(arguments, sheet, recorded)
    if check is not None and not found:
        print(
            f"burg-drake: {arguments.photo}: {check.reason}; recorded without placement",
            file=sys.stderr,
        )
    return 0 if check is None or found else 1


def _record(
    book: TrialBook, arguments: argparse.Namespace, trial: RealTrial, entry: dict[str, Any]
) -> RealTrial:
    """Records it. `next` is the first open trial at this very moment; but if there is evidence it
    is the one that the evidence is about, or none."""
    from burg_drake.experiment.trials import TrialChanged

    how = {"correct": arguments.correct, "again": arguments.again}
    if arguments.number != "next":
        return book.record(trial.number, **how, **entry)
    if not (arguments.photo or arguments.placement):
        return book.record("next", **how, **entry)
    try:
        return book.record(trial.number, expected=trial, **how, **entry)
    except TrialChanged as error:
        kept = f", but the photo is kept as {entry['photo']}" if "photo" in entry else ""
        raise InvalidInputError(
            f"{error}; nothing was recorded{kept}: give the number of its trial instead of next"
        ) from error


def _number(text: str, sheet: TrialSheet) -> int | Literal["next"]:
    if text == "next":
        return "next"
    if text.isascii() and text.isdecimal() and len(text) < LONGEST_NUMBER:
        return int(text)
    numbers = [trial.number for trial in sheet.trials]
    span = f", {min(numbers)} to {max(numbers)}," if numbers else ""
    raise InvalidInputError(f"{quoted(text)}: give the number of a trial{span} or next")


def _time(text: str) -> str:
    """A moment, with the zone of this place if there is none, or a day."""
    try:
        with contextlib.suppress(ValueError):
            return date.fromisoformat(text).isoformat()
        moment = datetime.fromisoformat(text)
        return (moment if moment.tzinfo else moment.astimezone()).isoformat()
    except (ValueError, OverflowError) as error:
        raise argparse.ArgumentTypeError(
            f"{quoted(text)} is not a time; give ISO 8601 such as 2026-05-04T16:30"
        ) from error


def _require_sense(arguments: argparse.Namespace) -> None:
    """Refuses options without those that they belong to, and calls that record nothing."""
    if not arguments.photo:
        for name in OF_PHOTO:
            if getattr(arguments, name) is not None:
                option = name.replace("_", "-")
                raise InvalidInputError(f"--{option} is for photos; add --photo FILE")
    elif arguments.depth and not arguments.intrinsics:
        raise InvalidInputError("--depth needs --intrinsics FILE of its camera")
    if arguments.placement and arguments.intrinsics:
        raise InvalidInputError(
            "--placement is already a measurement; leave out either it or --intrinsics"
        )
    if not (_entry(arguments) or arguments.photo or arguments.placement):
        raise InvalidInputError("nothing to record; give --outcome, --note or --photo, for example")


def _entry(arguments: argparse.Namespace) -> dict[str, Any]:
    """What the options tell, but for photo and placement."""
    names = ("outcome", "note", "operator", "time")
    entry = {name: getattr(arguments, name) for name in names}
    robot = {name: getattr(arguments, name) for name in ("width_mm", "effort_n")}
    known = {name: value for name, value in robot.items() if value is not None}
    given = {name: value for name, value in entry.items() if value is not None}
    if not arguments.correct:  # which may replace them by nothing
        given = {k: v for k, v in given.items() if k not in WORDS or v.strip()}
    return given | ({"robot": known} if known else {})


def _check(
    arguments: argparse.Namespace, sheet: TrialSheet, trial: RealTrial
) -> PlacementCheck | None:
    """The placement check, of a file or of the photo, if one is wanted."""
    from burg_drake.experiment.trials import measured, require_same_scene, require_scene

    if arguments.placement:
        from burg_drake.cameras.placement import load_placement

        check = load_placement(arguments.placement)
        require_scene(check, sheet, trial, arguments.placement)
        return check
    if not arguments.photo or not arguments.intrinsics:
        return None
    from burg_drake.scene.document import load_scene

    if arguments.scene:
        scene = load_scene(arguments.scene)
        require_same_scene(scene, sheet, trial)
    else:
        from burg_drake.experiment.trials import load_run_of

        run = load_run_of(sheet, arguments.trials, trial.run, moved=dict(arguments.moved))
        scene = run.scene()
    return measured(
        scene,
        arguments.photo,
        arguments.intrinsics,
        depth=arguments.depth,
        depth_unit=arguments.depth_unit,
        scale=print_scale(arguments),
    )


def _warn_of_width(arguments: argparse.Namespace, sheet: TrialSheet, trial: RealTrial) -> None:
    """Says that a width is beyond what the hand opens, where the run can tell."""
    from burg_drake.core import BurgError
    from burg_drake.experiment.trials import load_run_of

    with contextlib.suppress(BurgError):
        run = load_run_of(sheet, arguments.trials, trial.run, moved=dict(arguments.moved))
        hand = run.station().hand
        if arguments.width_mm > 1e3 * hand.opening[1]:
            print(
                f"burg-drake: --width-mm {arguments.width_mm:g} is recorded, but hand"
                f" {hand.name!r} opens {1e3 * hand.opening[1]:g} mm",
                file=sys.stderr,
            )


def _print_recorded(trial: RealTrial, sheet: TrialSheet, check: PlacementCheck | None) -> None:
    from burg_drake.apps.camera import placement_table

    if check is not None:
        placement_table(check.instances).show()
    outcome = "no outcome yet" if trial.outcome is None else trial.outcome.value
    print(f"trial {trial.number}: {outcome} ({trial.grasp})")
    left = sum(not other.carried_out for other in sheet.trials)
    if sheet.next is not None:
        print(
            f"{left} of {len(sheet.trials)} left; next is {sheet.next.number}: {sheet.next.grasp}"
        )
    else:
        print("all trials have an outcome")
