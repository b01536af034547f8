"""A Meshcat view as one self-contained HTML file, with title, legend and a list of grasps."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import groupby
from pathlib import Path

import numpy as np
from pydrake.geometry import Meshcat

from burg_drake.core import Array, atomic_write
from burg_drake.visualization.grasp_view import FINGER_LENGTH, STEM_LENGTH, GraspGroup, grasp_path
from burg_drake.visualization.hand_visual import GRIPPER_PATH, GripperView
from burg_drake.visualization.html_page import Html, element, join
from burg_drake.visualization.legend import (
    LEGEND_SCRIPT,
    LEGEND_STYLE,
    ColorBar,
    LegendEntry,
    legend_html,
)
from burg_drake.visualization.meshcat_drawing import VIEW_ASPECT

MATRIX_DECIMALS = 6
"""Decimals of poses in the page."""


@dataclass(frozen=True, eq=False)
class GraspPicker:
    """Control of a page that shows the gripper at any of the drawn grasps.

    Attributes:
        gripper: drawn in the same Meshcat.
        X_WG: (N, 4, 4) the grasps.
        width: (N,) between the pads [m].
        holder: (N,) the object of each; grasps of one object follow each other.
        label: (N,) text of each in the list.
        title: heading of the list.
        groups: as they are drawn.
        selected: shown when the page is opened; none if None.
    """

    gripper: GripperView
    X_WG: Array
    width: Array
    holder: Sequence[str]
    label: Sequence[str]
    title: str
    groups: Sequence[GraspGroup]
    selected: int | None = None

    def html(self) -> Html:
        """The list."""

        def option(k: int | None) -> Html:
            text, value = ("no gripper", -1) if k is None else (self.label[k], k)
            selected = "selected" if k == self.selected else None
            return element("option", text, value=value, selected=selected)

        options = [
            element("optgroup", *map(option, members), label=name)
            for name, members in groupby(range(len(self.label)), key=lambda k: self.holder[k])
        ]
        return join(
            element("p", "click a grasp, here or in the view", class_="title"),
            element("p", self.title),
            element("select", option(None), *options, id="grasps", size=12, aria_label="grasps"),
        )

    def script_html(self) -> str:
        """Style, data and script of the list; to be put after the script of the legend."""
        return (
            f"<style>{PICKER_STYLE}</style>"
            f'<script type="application/json" id="picker">{self._script_data()}</script>'
            f"<script>{PICKER_SCRIPT}</script>"
        )

    def add_slider(self, meshcat: Meshcat) -> None:
        """Adds the control of a live view: 0 for no gripper, else the number of a grasp."""
        start = 0 if self.selected is None else self.selected + 1
        meshcat.AddSlider("grasp", 0, len(self.label), 1, start, "ArrowLeft", "ArrowRight")

    def follow_slider(self, meshcat: Meshcat) -> None:
        """Puts the gripper where the slider says."""
        k = round(meshcat.GetSliderValue("grasp")) - 1
        if k >= 0:
            self.gripper.place(self.X_WG[k], float(self.width[k]))
        elif self.gripper.shown:
            self.gripper.hide()

    def _script_data(self) -> str:
        """Data for the script, as JSON; `</` would end its element."""
        groups = np.full(len(self.label), -1)
        for g, group in enumerate(self.groups):
            groups[group.members] = g
        X_WH = self.gripper.hand.X_AH(self.X_WG)
        data = {
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
        return json.dumps(data, separators=(",", ":")).replace("</", "<\\/")


def _column_major(X: Array) -> list[float]:
    """A pose (4, 4) as three.js has it: column by column."""
    return (np.round(X.T.reshape(-1), MATRIX_DECIMALS) + 0.0).tolist()


PICKER_STYLE = """
#burg select { width: 100%; font: 12px/1.4 ui-monospace, monospace; }
"""

PICKER_SCRIPT = """
const picker = JSON.parse(document.getElementById("picker").textContent);
const chooser = document.getElementById("grasps");
const steps = path => path.split("/").filter(Boolean);
function showGripper() {
  const grasp = picker.grasps[+chooser.value];
  show(picker.path, Boolean(grasp));
  if (!grasp) return;
  viewer.set_transform(steps(picker.path), grasp.H);
  for (const [path, slide] of picker.slides) {
    const [x, y, z] = slide.map(s => s * grasp.closed);
    viewer.set_transform(steps(path), [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1]);
  }
  viewer.set_dirty();
}
chooser.addEventListener("input", showGripper);
function strokes(grasp, place) {
  const matrix = new MeshCat.THREE.Matrix4().fromArray(grasp.G);
  const at = (x, z) => place(new MeshCat.THREE.Vector3(x, 0, z).applyMatrix4(matrix));
  const half = grasp.width / 2, palm = -picker.finger;
  const [a, b, c, d] = [at(half, 0), at(half, palm), at(-half, palm), at(-half, 0)];
  return [[a, b], [b, c], [c, d], [at(0, palm), at(0, palm - picker.stem)]];
}
function away([a, b], x, y) {
  const [u, v] = [b.x - a.x, b.y - a.y];
  const t = Math.max(0, Math.min(1, ((x - a.x) * u + (y - a.y) * v) / (u * u + v * v || 1)));
  return Math.hypot(a.x + t * u - x, a.y + t * v - y);
}
function nearestGrasp(x, y) {
  const root = viewer.scene_tree.find(["drake"]).object;
  root.updateWorldMatrix(true, false);
  viewer.camera.updateMatrixWorld();
  const place = point => {
    const seen = root.localToWorld(point).project(viewer.camera);
    return {x: (1 + seen.x) / 2 * pane.offsetWidth, y: (1 - seen.y) / 2 * pane.offsetHeight,
      depth: seen.z};
  };
  const visible = picker.groups.map(
    path => viewer.scene_tree.find(steps(path)).object.visible);
  let best = -1, rank = Infinity;
  picker.grasps.forEach((grasp, k) => {
    if (!visible[grasp.group]) return;
    const lines = strokes(grasp, place);
    const far = Math.min(...lines.map(line => away(line, x, y)));
    if (far > 8) return;
    const cost = far > 3 ? 10 + far : lines[1][0].depth;
    if (cost < rank) [best, rank] = [k, cost];
  });
  return best;
}
let pressed = [0, 0];
pane.addEventListener("pointerdown", event => { pressed = [event.clientX, event.clientY]; });
pane.addEventListener("pointerup", event => {
  if (Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4) return;
  const edge = pane.getBoundingClientRect();
  const k = nearestGrasp(event.clientX - edge.left, event.clientY - edge.top);
  if (k < 0) return;
  chooser.value = k;
  chooser.selectedOptions[0].scrollIntoView({block: "nearest"});
  showGripper();
});
"""


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
        title: of the page.
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
    """HTML of the panel, and how page and view behave."""
    lines = "".join(f"<p>{escape(line)}</p>" for line in caption)
    more = "" if controls is None else controls.html()
    return (
        f'<style>{_PAGE_STYLE}{LEGEND_STYLE}</style><details id="burg" open>'
        f"<summary>{escape(title)}</summary>{lines}{legend_html(legend)}{more}</details><script>{_PAGE_SCRIPT}{LEGEND_SCRIPT}</script>"
        f"{'' if controls is None else controls.script_html()}"
    )


_PAGE_STYLE = """
body { display: flex; width: 100vw; height: 100vh; height: 100dvh; overflow: hidden; }
#view { position: relative; flex: 1; order: 1; min-width: 0; min-height: 0; overflow: hidden; }
#view #meshcat-pane { position: absolute; inset: 0; width: 100%; height: 100%; }
#view .dg.main { max-width: 100%; }
#view .dg.main > ul { max-height: 48vh; overflow-x: hidden; overflow-y: auto; }
#burg { box-sizing: border-box; flex: none; width: 312px; max-width: 40vw; padding: 10px 14px;
  overflow: auto; font: 14px/1.45 system-ui, sans-serif; color: #222; background: #fff;
  border-right: 1px solid #c5cad0; }
#burg:not([open]) { width: auto; }
#burg summary { font-size: 16px; font-weight: bold; cursor: pointer; overflow-wrap: anywhere; }
#burg p { margin: 4px 0; overflow-wrap: anywhere; }
#burg label { display: block; margin: 2px 0; padding-left: 40px; text-indent: -40px;
  cursor: pointer; }
#burg input { margin: 0 6px 0 0; vertical-align: middle; }
#burg i { display: inline-block; width: 12px; height: 12px; margin-right: 6px;
  border-radius: 2px; vertical-align: -1px; }
@media (orientation: portrait) {
  body { flex-direction: column; }
  #burg, #burg:not([open]) { order: 2; width: 100%; max-width: none; max-height: 45%;
    border-right: none; border-top: 1px solid #c5cad0; }
}
"""

_PAGE_SCRIPT = f"""
const pane = document.getElementById("meshcat-pane");
function fit() {{
  if (!pane.offsetWidth || !pane.offsetHeight) return;
  viewer.camera.zoom = Math.min(1, pane.offsetWidth / pane.offsetHeight / {VIEW_ASPECT});
  viewer.set_3d_pane_size();
}}
new ResizeObserver(fit).observe(pane);
"""
