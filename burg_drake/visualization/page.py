"""A Meshcat view as one self-contained HTML file, with title, caption and legend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from pydrake.geometry import Meshcat

from burg_drake.core.files import atomic_write


@dataclass(frozen=True)
class LegendEntry:
    """A line of the legend that switches what it names on and off.

    Attributes:
        label: what the colour stands for.
        color: as CSS has it.
        paths: Meshcat paths that the entry shows and hides.
    """

    label: str
    color: str
    paths: tuple[str, ...] = ()


def save_html(
    meshcat: Meshcat,
    path: str | Path,
    *,
    title: str,
    caption: Sequence[str] = (),
    legend: Sequence[LegendEntry] = (),
) -> None:
    """Writes what Meshcat shows, with its animation, as a page that needs no network.

    Args:
        meshcat: the view.
        path: file to write.
        title: of the page.
        caption: lines below the title.
        legend: colours and what they stand for.

    Raises:
        InvalidInputError: the file cannot be written.
    """
    page = meshcat.StaticHtml()
    page = page.replace("<title>Drake MeshCat</title>", f"<title>{escape(title)}</title>", 1)
    head, body, tail = page.rpartition("</body>")
    atomic_write(path, head + overlay(title, caption, legend) + body + tail)


def overlay(title: str, caption: Sequence[str], legend: Sequence[LegendEntry]) -> str:
    """HTML of the box in the page's upper left corner."""
    lines = "".join(f"<p>{escape(line)}</p>" for line in caption)
    entries = "".join(
        f'<label><input type="checkbox" checked data-paths="{escape(" ".join(e.paths))}">'
        f'<i style="background:{escape(e.color)}"></i>{escape(e.label)}</label>'
        for e in legend
    )
    return f'{_STYLE}<div id="burg"><h1>{escape(title)}</h1>{lines}{entries}</div>{_SCRIPT}'


_STYLE = """<style>
#burg { position: fixed; top: 12px; left: 12px; max-width: 30em; padding: 10px 14px;
  font: 14px/1.45 system-ui, sans-serif; color: #222; background: rgba(255, 255, 255, 0.88);
  border-radius: 6px; box-shadow: 0 1px 4px rgba(0, 0, 0, 0.25); }
#burg h1 { margin: 0; font-size: 16px; }
#burg p { margin: 2px 0; }
#burg label { display: block; cursor: pointer; white-space: nowrap; }
#burg input { margin: 0 6px 0 0; vertical-align: middle; }
#burg i { display: inline-block; width: 12px; height: 12px; margin-right: 6px;
  border-radius: 2px; vertical-align: -1px; }
</style>
"""

_SCRIPT = """<script>
for (const box of document.querySelectorAll("#burg input")) {
  box.addEventListener("change", () => {
    for (const path of box.dataset.paths.split(" ").filter(Boolean))
      viewer.set_property(path.split("/").filter(Boolean), "visible", box.checked);
  });
}
</script>
"""
