"""The printable protocol of trials for the lab: one self-contained HTML page.

Simulated outcomes are left out by default, so that the operator does not know them.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import burg_drake
from burg_drake.core import RealOutcome, count_with_noun, outcome_label, transform_points
from burg_drake.experiment.lab.trial_pictures import (
    GRASP_PICTURE_SIZE,
    SETUP_PICTURE_SIZE,
    TrialPictures,
)
from burg_drake.experiment.lab.tried_grasps import (
    MAIN_OUTCOMES,
    TriedRuns,
    approach_text,
    closing_text,
    format_time,
    point_text,
    trials_by_block,
)
from burg_drake.experiment.trials.trial_sheet import RealTrial
from burg_drake.scene import Scene
from burg_drake.visualization import Html, element, join, page_style, render_page


def trial_card(trial: RealTrial, runs: TriedRuns, picture: bytes, show_simulated: bool) -> Html:
    """The card of a trial.

    Args:
        trial: the trial.
        runs: runs of the trials file.
        picture: JPEG of the trial's grasp.
        show_simulated: whether to show the simulated outcome.
    """
    alt = f"the hand at the grasp of trial {trial.number}, on {trial.instance}"
    name = trial.instance
    if trial.object != trial.instance:
        name = f"{trial.instance} ({trial.object})"
    return element(
        "article",
        element("figure", _image(picture, alt, GRASP_PICTURE_SIZE)),
        element(
            "div",
            element("h3", element("b", trial.number), name),
            _grasp_description(trial, runs, show_simulated),
            _outcome_boxes(trial.outcome),
            _entry_lines(trial),
        ),
        id=f"trial-{trial.number}",
    )


def _grasp_description(trial: RealTrial, runs: TriedRuns, show_simulated: bool) -> Html:
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


def _outcome_boxes(outcome: RealOutcome | None) -> Html:
    """Check boxes for the listed outcomes, and a line for others."""
    ticked, empty = element("i", "✕"), element("i", "")
    items = [
        element("li", ticked, label, class_="chosen")
        if known is outcome
        else element("li", empty, label)
        for known, (label, _) in MAIN_OUTCOMES.items()
    ]
    other = "" if outcome is None or outcome in MAIN_OUTCOMES else outcome_label(outcome)
    line = element("span", other, class_="line")
    items.append(element("li", ticked if other else empty, "other:", line, class_="other"))
    return element("ul", *items, class_="boxes")


def _entry_lines(trial: RealTrial) -> Html:
    robot = trial.robot
    width = "" if robot is None or robot.width_mm is None else f"{robot.width_mm:g}"
    lines = (
        ("note", trial.note, "note"),
        ("width [mm]", width, None),
        ("time", format_time(trial.time), None),
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


@dataclass(frozen=True, kw_only=True)
class ProtocolOptions:
    """Options of the protocol page.

    Attributes:
        show_simulated: whether to show simulated outcomes.
        printouts: address of the printed board by block.
    """

    show_simulated: bool = False
    printouts: Mapping[int, str] | None = None


def protocol_page(
    runs: TriedRuns, pictures: TrialPictures, options: ProtocolOptions | None = None
) -> str:
    """The protocol of the trials as an HTML page.

    Args:
        runs: runs of the trials file.
        pictures: pictures of the trials.
        options: options; the defaults if None.
    """
    options = options or ProtocolOptions()
    blocks = trials_by_block(runs.sheet)
    sections = [
        _block_section(runs, pictures, number, trials, options) for number, trials in blocks.items()
    ]
    footer = element("footer", f"Written by burg_drake {burg_drake.__version__}.")
    return render_page(
        "visualization/document.html.jinja",
        title=f"Trials on the robot: {runs.path.name}",
        style=page_style("burg_drake.experiment.lab", "protocol.css"),
        content=join(_header(runs, blocks), *sections, footer),
    )


def _header(runs: TriedRuns, blocks: Mapping[int, tuple[RealTrial, ...]]) -> Html:
    instructions = (
        "Carry out the trials in the order of their numbers. Each block has one scene: set"
        " it up on its printed board as the pictures show, and again after every trial.",
        "Tick one box for each trial when the robot has stopped. If none fits, write what"
        " happened next to “other”.",
        "Before a trial, compare with its picture: it shows the hand where the robot will"
        " close it, and the object to be gripped has an orange rim. Do not correct the scene"
        " or the robot because of it.",
        "If a person interfered or an object fell before the trial, tick “not attempted” and"
        " go on; repeat the trial at the end if there is time.",
    )
    sheet, setups = runs.sheet, [runs.of(trials[0]) for trials in blocks.values()]
    robots = list(dict.fromkeys(f"{one.station.name} ({one.station.hand.name})" for one in setups))
    scenes = list(dict.fromkeys(one.scene.name for one in setups))
    done = sum(trial.outcome is not None for trial in sheet.trials)
    trials_text = count_with_noun(len(sheet.trials), "trial")
    about = [f"{trials_text} in {count_with_noun(len(blocks), 'block')}"]
    about += [f"seed {sheet.selection.seed}", f"file {runs.path.name}"]
    about += [f"planned {sheet.created[:10]}"] if sheet.created else []
    about += [f"{done} carried out so far"] if done else []
    lines = [element("span", name) for name in ("date", "operator", "robot, gripper (serial no.)")]
    return element(
        "header",
        element("p", "Trials on the robot", class_="kind"),
        element("h1", f"{', '.join(scenes)} on {', '.join(robots)}"),
        element("p", "; ".join(about), class_="about"),
        element("div", *lines, class_="who"),
        element("ul", *(element("li", text) for text in instructions), class_="how"),
        _outcome_list(),
    )


def _outcome_list() -> Html:
    rows = [
        element("tr", element("th", label, scope="row"), element("td", meaning))
        for label, meaning in MAIN_OUTCOMES.values()
    ]
    return element("table", element("tbody", *rows), class_="outcomes")


def _block_section(
    runs: TriedRuns,
    pictures: TrialPictures,
    number: int,
    trials: tuple[RealTrial, ...],
    options: ProtocolOptions,
) -> Html:
    scene = runs.of(trials[0]).scene
    first, last = trials[0].number, trials[-1].number
    which = f"trial {first}" if len(trials) == 1 else f"trials {first} to {last}"
    seen = pictures.setup(trials[0])
    figures = [
        element(
            "figure",
            _image(picture, f"{scene.name} {where}", SETUP_PICTURE_SIZE),
            element("figcaption", where),
        )
        for picture, where in zip(seen, ("from above", "from the front"), strict=True)
    ]
    cards = [
        trial_card(trial, runs, pictures.grasp(trial), options.show_simulated) for trial in trials
    ]
    top = element(
        "div",
        element("h2", f"Block {number}: {scene.name}, {which}"),
        element("div", *figures, class_="setup"),
        _placement_table(scene),
        _printout_paragraph(scene, (options.printouts or {}).get(number)),
        class_="top",
    )
    return element("section", top, *cards, class_="block", id=f"block-{number}")


def _image(data: bytes, alt: str, size: tuple[int, int]) -> Html:
    address = f"data:image/jpeg;base64,{base64.b64encode(data).decode()}"
    return element("img", src=address, alt=alt, width=size[0], height=size[1])


def _placement_table(scene: Scene) -> Html:
    """Table of the objects' poses on the board."""
    rows = []
    for name in (*scene.background, *scene.instances):
        X_SO, thing = scene.X_SO(name), scene.instance(name).object
        surface = scene.library.surface(thing)
        p_SQ = transform_points(X_SO, np.asarray(surface.vertices))
        x, y, _ = (p_SQ.min(axis=0) + p_SQ.max(axis=0)) / 2.0
        turn = math.degrees(math.atan2(X_SO[1, 0], X_SO[0, 0]))
        cells = (1e3 * x, 1e3 * y, turn, 1e3 * p_SQ[:, 2].max())
        text = name if name == thing else f"{name} ({thing})"
        numbers = (element("td", f"{value:.0f}", class_="number") for value in cells)
        rows.append(element("tr", element("th", text, scope="row"), *numbers))
    head = [
        element("th", text, scope="col", class_="number" if k else None)
        for k, text in enumerate(("object", "x [mm]", "y [mm]", "turned [°]", "height [mm]"))
    ]
    body = join(element("thead", element("tr", *head)), element("tbody", *rows))
    return element("div", element("table", body, class_="places"), class_="scroll")


def _printout_paragraph(scene: Scene, address: str | None) -> Html:
    width, height = (round(1e3 * side) for side in scene.board.size)
    board = (
        f"The board ({width} x {height} mm) shows where everything stands; x and y are"
        " those of the middle of each object. "
    )
    if address:
        link = element("a", address, href=address)
        return element("p", board, "Print it at 100\u00a0%: ", link, ".", class_="print")
    code = element("code", "burg-drake printout RUN/scene.yaml -o board.pdf")
    return element("p", board, "To print it: ", code, class_="print")
