"""A Meshcat view as one self-contained HTML file, with title, caption and legend in a panel.

The panel is beside the view, or below it in a window that is higher than wide: neither ever covers
the other, nor Meshcat's own controls, which are in a corner of the view. Everything that fits into
a view of `VIEW_ASPECT` stays in narrower ones, as the page then zooms out.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

from pydrake.geometry import Meshcat

from burg_drake.core.files import atomic_write
from burg_drake.visualization.grasps import GraspPicker
from burg_drake.visualization.meshcat import VIEW_ASPECT
from burg_drake.visualization.style import SCRIPT, STYLE, ColorBar, LegendEntry, legend_html

PANE = '<div id="meshcat-pane">'
"""How Meshcat's element for the view begins in its page; what is in it ends before a script."""


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
    page = meshcat.StaticHtml()
    page = page.replace("<title>Drake MeshCat</title>", f"<title>{escape(title)}</title>", 1)
    page = page.replace("<head>", f"<head>{_VIEWPORT}", 1)
    # Meshcat puts its controls beside its pane, so that they are in the view's element, too
    before, opening, after = page.partition(PANE)
    inside, closing, after = after.partition("</div>")
    page = f'{before}<div id="view">{opening}{inside}{closing}</div>{after}'
    head, body, tail = page.rpartition("</body>")
    atomic_write(path, head + panel(title, caption, legend, controls) + body + tail)


def panel(
    title: str,
    caption: Sequence[str],
    legend: Sequence[LegendEntry | ColorBar],
    controls: GraspPicker | None = None,
) -> str:
    """HTML of the panel, and how page and view behave."""
    lines = "".join(f"<p>{escape(line)}</p>" for line in caption)
    more = "" if controls is None else controls.html()
    return (
        f'<style>{_STYLE}{STYLE}</style><details id="burg" open><summary>{escape(title)}</summary>'
        f"{lines}{legend_html(legend)}{more}</details><script>{_SCRIPT}{SCRIPT}</script>"
        f"{'' if controls is None else controls.behaviour()}"
    )


_VIEWPORT = '<meta name="viewport" content="width=device-width, initial-scale=1">'

_STYLE = """
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

_SCRIPT = f"""
const pane = document.getElementById("meshcat-pane");
function fit() {{
  if (!pane.offsetWidth || !pane.offsetHeight) return;
  viewer.camera.zoom = Math.min(1, pane.offsetWidth / pane.offsetHeight / {VIEW_ASPECT});
  viewer.set_3d_pane_size();
}}
new ResizeObserver(fit).observe(pane);
"""
