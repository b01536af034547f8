"""The protocol of trials for the lab: one HTML page that needs nothing else, and prints well.

What was simulated is left out, unless it is asked for, so that the operator does not know it.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import burg_drake
from burg_drake.core import transform_points
from burg_drake.experiment.pages.protocol_trial import trial_card
from burg_drake.experiment.pages.trial_pictures import SETUP_SIZE, TrialPictures
from burg_drake.experiment.pages.tried_runs import TriedRuns, TriedScene, in_blocks
from burg_drake.experiment.pages.words import SHORT_LIST
from burg_drake.experiment.trials import RealTrial
from burg_drake.scene.document import Scene
from burg_drake.visualization.style import Html, element, html_document, join, page_style

HOW = (
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


@dataclass(frozen=True, kw_only=True)
class SheetOptions:
    """What is on the page beside the trials.

    Attributes:
        show_simulated: what was simulated.
        printouts: by block, address of the printed board.
    """

    show_simulated: bool = False
    printouts: Mapping[int, str] | None = None


def sheet_page(
    runs: TriedRuns, pictures: TrialPictures, options: SheetOptions | None = None
) -> str:
    """The page.

    Args:
        runs: of the trials file.
        pictures: of its trials.
        options: the usual ones if None.
    """
    options = options or SheetOptions()
    blocks = in_blocks(runs.sheet)
    style = page_style("burg_drake.experiment.pages", "sheet_page.css")
    sections = [
        _block(runs, pictures, number, trials, options) for number, trials in blocks.items()
    ]
    return html_document(
        f"Trials on the robot: {runs.path.name}",
        style,
        _header(runs, blocks),
        *sections,
        element("footer", f"Written by burg_drake {burg_drake.__version__}."),
    )


def _header(runs: TriedRuns, blocks: Mapping[int, tuple[RealTrial, ...]]) -> Html:
    sheet, tried = runs.sheet, [runs.of(trials[0]) for trials in blocks.values()]
    robots = list(dict.fromkeys(_robot(one) for one in tried))
    scenes = list(dict.fromkeys(one.scene.name for one in tried))
    done = sum(trial.outcome is not None for trial in sheet.trials)
    count = len(sheet.trials)
    about = [f"{count} trials in {len(blocks)} block{'' if len(blocks) == 1 else 's'}"]
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
        element("ul", *(element("li", text) for text in HOW), class_="how"),
        _outcomes(),
    )


def _robot(tried: TriedScene) -> str:
    return f"{tried.station.name} ({tried.station.hand.name})"


def _outcomes() -> Html:
    rows = [
        element("tr", element("th", label, scope="row"), element("td", meaning))
        for label, meaning in SHORT_LIST.values()
    ]
    return element("table", element("tbody", *rows), class_="outcomes")


def _block(
    runs: TriedRuns,
    pictures: TrialPictures,
    number: int,
    trials: tuple[RealTrial, ...],
    options: SheetOptions,
) -> Html:
    scene = runs.of(trials[0]).scene
    first, last = trials[0].number, trials[-1].number
    which = f"trial {first}" if len(trials) == 1 else f"trials {first} to {last}"
    seen = pictures.setup(trials[0])
    figures = [
        _figure(picture, f"{scene.name} {where}", where)
        for picture, where in zip(seen, ("from above", "from the front"), strict=True)
    ]
    cards = [
        trial_card(trial, runs, pictures.grasp(trial), options.show_simulated) for trial in trials
    ]
    top = element(
        "div",
        element("h2", f"Block {number}: {scene.name}, {which}"),
        element("div", *figures, class_="setup"),
        _places(scene),
        _printout(scene, (options.printouts or {}).get(number)),
        class_="top",
    )
    return element("section", top, *cards, class_="block", id=f"block-{number}")


def _figure(data: bytes, alt: str, caption: str) -> Html:
    width, height = SETUP_SIZE
    address = f"data:image/jpeg;base64,{base64.b64encode(data).decode()}"
    image = element("img", src=address, alt=alt, width=width, height=height)
    return element("figure", image, element("figcaption", caption))


def _places(scene: Scene) -> Html:
    """Where each object stands."""
    heads = ("object", "x [mm]", "y [mm]", "turned [°]", "height [mm]")
    rows = []
    for name in (*scene.background, *scene.instances):
        X_SO, thing = scene.X_SO(name), scene.instance(name).object
        surface = scene.library.surface(thing)
        p_SQ = transform_points(X_SO, np.asarray(surface.vertices))
        x, y, _ = (p_SQ.min(axis=0) + p_SQ.max(axis=0)) / 2.0
        turn = math.degrees(math.atan2(X_SO[1, 0], X_SO[0, 0]))
        height = p_SQ[:, 2].max()
        cells = (1e3 * x, 1e3 * y, turn, 1e3 * height)
        text = name if name == thing else f"{name} ({thing})"
        numbers = (element("td", f"{value:.0f}", class_="number") for value in cells)
        rows.append(element("tr", element("th", text, scope="row"), *numbers))
    head = [
        element("th", text, scope="col", class_="number" if k else None)
        for k, text in enumerate(heads)
    ]
    body = join(element("thead", element("tr", *head)), element("tbody", *rows))
    return element("div", element("table", body, class_="places"), class_="scroll")


def _printout(scene: Scene, address: str | None) -> Html:
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
