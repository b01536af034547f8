"""One trial on the protocol: its picture, its grasp in words, boxes to tick, lines to fill in."""

from __future__ import annotations

import base64

from burg_drake.core.grasps import RealOutcome
from burg_drake.experiment.pages.trial_pictures import SIZE
from burg_drake.experiment.pages.tried_runs import TriedRuns
from burg_drake.experiment.pages.words import (
    SHORT_LIST,
    approach_text,
    closing_text,
    day_and_time,
    outcome_label,
    point_text,
)
from burg_drake.experiment.trials import RealTrial
from burg_drake.visualization.style import Html, element

TICK = "✕"


def trial_card(trial: RealTrial, runs: TriedRuns, picture: bytes, show_simulated: bool) -> Html:
    """The card of a trial.

    Args:
        trial: as it stands in the file.
        runs: of the file.
        picture: JPEG of its grasp.
        show_simulated: whether it tells what was simulated.
    """
    address = f"data:image/jpeg;base64,{base64.b64encode(picture).decode()}"
    width, height = SIZE
    alt = f"the hand at the grasp of trial {trial.number}, on {trial.instance}"
    name = trial.instance
    if trial.object != trial.instance:
        name = f"{trial.instance} ({trial.object})"
    return element(
        "article",
        element("figure", element("img", src=address, alt=alt, width=width, height=height)),
        element(
            "div",
            element("h3", element("b", trial.number), name),
            _grasp(trial, runs, show_simulated),
            _boxes(trial.outcome),
            _lines(trial),
        ),
        id=f"trial-{trial.number}",
    )


def _grasp(trial: RealTrial, runs: TriedRuns, show_simulated: bool) -> Html:
    X_SG, hand = runs.X_SG(trial), runs.of(trial).station.hand
    width = f"{1e3 * runs.width(trial):.0f} mm (the hand opens {1e3 * hand.opening[1]:.0f} mm)"
    rows = [
        ("approach", approach_text(X_SG)),
        ("fingers", f"{closing_text(X_SG)}; width {width}"),
        ("grasp at", point_text(X_SG)),
    ]
    if show_simulated:
        rows.append(("simulated", trial.simulated.value.replace("_", " ")))
    cells = [cell for name, text in rows for cell in (element("dt", name), element("dd", text))]
    id_row = (element("dt", "grasp"), element("dd", trial.grasp, class_="id"))
    return element("dl", *cells, *id_row)


def _boxes(outcome: RealOutcome | None) -> Html:
    """A box for each outcome of the short list, and a line for others."""
    items = []
    for known, (label, _) in SHORT_LIST.items():
        chosen = known is outcome
        box = element("i", TICK if chosen else "")
        items.append(element("li", box, label, class_="chosen" if chosen else None))
    other = outcome is not None and outcome not in SHORT_LIST
    text = outcome_label(outcome) if other and outcome is not None else ""
    line = element("span", text, class_="line")
    items.append(element("li", element("i", TICK if other else ""), "other:", line, class_="other"))
    return element("ul", *items, class_="boxes")


def _lines(trial: RealTrial) -> Html:
    robot = trial.robot
    width = "" if robot is None or robot.width_mm is None else f"{robot.width_mm:g}"
    lines = (
        ("note", trial.note, "note"),
        ("width [mm]", width, None),
        ("time", day_and_time(trial.time), None),
        ("operator", trial.operator, None),
    )
    return element(
        "div",
        *(
            element("span", name, element("b", text, class_="line"), class_=kind)
            for name, text, kind in lines
        ),
        class_="fill",
    )
