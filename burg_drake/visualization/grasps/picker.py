"""A list of grasps in a page: what is chosen there, or clicked in the view, gets the gripper."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from pydrake.geometry import Meshcat

from burg_drake.core import Array
from burg_drake.visualization.grasps.groups import GraspGroup
from burg_drake.visualization.grasps.mesh import FINGER_LENGTH, STEM_LENGTH, grasp_path
from burg_drake.visualization.meshcat import GRIPPER_PATH, GripperView
from burg_drake.visualization.style import Html, element, join

SLIDER = "grasp"
"""Name of the live view's control."""
ROWS = 12
"""Of the list that are seen at once."""
DIGITS = 6
"""Decimals of matrices in the page."""


@dataclass(frozen=True, eq=False)
class GraspPicker:
    """What a page needs to show the gripper at any of the drawn grasps.

    Attributes:
        gripper: drawn in the same Meshcat.
        X_WG: (N, 4, 4) the grasps.
        width: (N,) between the pads [m].
        holder: (N,) the object of each; grasps of one follow each other.
        label: (N,) what the list says of each.
        title: what that is.
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
        options = [
            element(
                "optgroup",
                *(
                    element("option", self.label[k], value=k, **self._chosen(k))
                    for k in list(members)
                ),
                label=name,
            )
            for name, members in groupby(range(len(self.label)), key=lambda k: self.holder[k])
        ]
        none = element("option", "no gripper", value=-1, **self._chosen(None))
        return join(
            element("p", "click a grasp, here or in the view", class_="title"),
            element("p", self.title),
            element("select", none, *options, id="grasps", size=ROWS, aria_label="grasps"),
        )

    def behaviour(self) -> str:
        """What the list does: its look, its data, and the script; after that of the legend."""
        return (
            f"<style>{STYLE}</style>"
            f'<script type="application/json" id="picker">{self._data()}</script>'
            f"<script>{SCRIPT}</script>"
        )

    def add_slider(self, meshcat: Meshcat) -> None:
        """Adds the control of a live view: 0 for no gripper, else the number of a grasp."""
        start = 0 if self.selected is None else self.selected + 1
        meshcat.AddSlider(SLIDER, 0, len(self.label), 1, start, "ArrowLeft", "ArrowRight")

    def follow_slider(self, meshcat: Meshcat) -> None:
        """Puts the gripper where the slider says."""
        k = round(meshcat.GetSliderValue(SLIDER)) - 1
        if k >= 0:
            self.gripper.put(self.X_WG[k], float(self.width[k]))
        elif self.gripper.shown:
            self.gripper.hide()

    def _chosen(self, k: int | None) -> dict[str, str]:
        return {"selected": "selected"} if k == self.selected else {}

    def _data(self) -> str:
        """What the script reads; `</` would end its element."""
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
                    "G": _columns(self.X_WG[k]),
                    "H": _columns(X_WH[k]),
                    "width": round(float(self.width[k]), DIGITS),
                    "closed": round(self.gripper.closed_by(self.width[k]), DIGITS),
                    "group": int(groups[k]),
                }
                for k in range(len(self.label))
            ],
        }
        return json.dumps(data, separators=(",", ":")).replace("</", "<\\/")


def _columns(X: Array) -> list[float]:
    """A pose (4, 4) as three.js has it: column by column."""
    return (np.round(X.T.reshape(-1), DIGITS) + 0.0).tolist()


STYLE = """
#burg select { width: 100%; font: 12px/1.4 ui-monospace, monospace; }
"""

SCRIPT = """
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
