"""A Meshcat view as one self-contained HTML file, with title, legend and a list of grasps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat

from burg_drake.core import Array, atomic_write
from burg_drake.visualization.grasp_view import FINGER_LENGTH, STEM_LENGTH, GraspGroup, grasp_path
from burg_drake.visualization.hand_visual import GRIPPER_PATH, GripperView
from burg_drake.visualization.html_page import render_page
from burg_drake.visualization.legend import ColorBar, LegendEntry
from burg_drake.visualization.meshcat_drawing import VIEW_ASPECT

MATRIX_DECIMALS = 6
"""Decimals of poses in the page."""


@dataclass(frozen=True, eq=False)
class GraspPicker:
    """Control of a page that shows the gripper at any of the drawn grasps.

    Attributes:
        gripper: gripper in the same Meshcat.
        X_WG: (N, 4, 4) grasps.
        width: (N,) distance between the pads [m].
        holder: (N,) object of each grasp; grasps of one object are consecutive.
        label: (N,) text of each grasp in the list.
        title: heading of the list.
        groups: groups of the drawn grasps.
        selected: grasp that is shown when the page is opened; none if None.
    """

    gripper: GripperView
    X_WG: Array
    width: Array
    holder: Sequence[str]
    label: Sequence[str]
    title: str
    groups: Sequence[GraspGroup]
    selected: int | None = None

    def members(self) -> list[tuple[str, list[int]]]:
        """Objects and indices of their grasps."""
        indices = range(len(self.label))
        return [(name, list(own)) for name, own in groupby(indices, key=lambda k: self.holder[k])]

    def add_slider(self, meshcat: Meshcat) -> None:
        """Adds the control of a live view: 0 for no gripper, else the number of a grasp."""
        start = 0 if self.selected is None else self.selected + 1
        meshcat.AddSlider("grasp", 0, len(self.label), 1, start, "ArrowLeft", "ArrowRight")

    def follow_slider(self, meshcat: Meshcat) -> None:
        """Moves the gripper to the grasp selected by the slider."""
        k = round(meshcat.GetSliderValue("grasp")) - 1
        if k >= 0:
            self.gripper.place(self.X_WG[k], float(self.width[k]))
        elif self.gripper.shown:
            self.gripper.hide()

    def script_data(self) -> dict[str, Any]:
        """Data for the script of the page."""
        groups = np.full(len(self.label), -1)
        for g, group in enumerate(self.groups):
            groups[group.members] = g
        X_WH = self.gripper.hand.X_AH(self.X_WG)
        return {
            "path": GRIPPER_PATH,
            "finger": FINGER_LENGTH,
            "stem": STEM_LENGTH,
            "slides": [[path, slide.tolist()] for path, slide in self.gripper.slides.items()],
            "groups": [grasp_path(group.key) for group in self.groups],
            "grasps": [
                {
                    "G": _column_major(self.X_WG[k]),
                    "H": _column_major(X_WH[k]),
                    "width": round(float(self.width[k]), MATRIX_DECIMALS),
                    "closed": round(self.gripper.closing_distance(self.width[k]), MATRIX_DECIMALS),
                    "group": int(groups[k]),
                }
                for k in range(len(self.label))
            ],
        }


def _column_major(X: Array) -> list[float]:
    """A pose (4, 4) in three.js' order: column by column."""
    return (np.round(X.T.reshape(-1), MATRIX_DECIMALS) + 0.0).tolist()


def save_html(
    meshcat: Meshcat,
    path: str | Path,
    *,
    title: str,
    caption: Sequence[str] = (),
    legend: Sequence[LegendEntry | ColorBar] = (),
    controls: GraspPicker | None = None,
) -> None:
    """Writes what Meshcat shows, with its animation, as a page that needs no network.

    Args:
        meshcat: the view.
        path: file to write.
        title: title of the page.
        caption: lines below the title.
        legend: colours and what they stand for.
        controls: further ones, below the legend.

    Raises:
        InvalidInputError: the file cannot be written.
    """
    # Opens Meshcat's element for the view, which ends before a script.
    pane_tag = '<div id="meshcat-pane">'
    viewport = '<meta name="viewport" content="width=device-width, initial-scale=1">'
    page = meshcat.StaticHtml()
    page = page.replace("<title>Drake MeshCat</title>", f"<title>{escape(title)}</title>", 1)
    page = page.replace("<head>", f"<head>{viewport}", 1)
    # Meshcat puts its controls beside its pane, so that they are in the view's element, too
    before, opening, after = page.partition(pane_tag)
    inside, closing, after = after.partition("</div>")
    page = f'{before}<div id="view">{opening}{inside}{closing}</div>{after}'
    head, body, tail = page.rpartition("</body>")
    atomic_write(path, head + page_panel(title, caption, legend, controls) + body + tail)


def page_panel(
    title: str,
    caption: Sequence[str],
    legend: Sequence[LegendEntry | ColorBar],
    controls: GraspPicker | None = None,
) -> str:
    """HTML of the panel, with the style and the script of the page."""
    values = {"title": title, "caption": caption, "legend": legend, "picker": controls}
    return render_page("visualization/meshcat_panel.html.jinja", aspect=VIEW_ASPECT, **values)
