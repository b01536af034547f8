"""A Meshcat view as one self-contained HTML file, with title, caption and legend."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

from pydrake.geometry import Meshcat

from burg_drake.core.files import atomic_write
from burg_drake.visualization.legend import SCRIPT, STYLE, ColorBar, LegendEntry, legend_html


def save_html(
    meshcat: Meshcat,
    path: str | Path,
    *,
    title: str,
    caption: Sequence[str] = (),
    legend: Sequence[LegendEntry | ColorBar] = (),
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


def overlay(title: str, caption: Sequence[str], legend: Sequence[LegendEntry | ColorBar]) -> str:
    """HTML of the box in the page's upper left corner."""
    lines = "".join(f"<p>{escape(line)}</p>" for line in caption)
    return (
        f'<style>{_STYLE}{STYLE}</style><div id="burg"><h1>{escape(title)}</h1>{lines}'
        f"{legend_html(legend)}</div><script>{SCRIPT}</script>"
    )


_STYLE = """
#burg { position: fixed; top: 12px; left: 12px; max-width: 30em; padding: 10px 14px;
  font: 14px/1.45 system-ui, sans-serif; color: #222; background: rgba(255, 255, 255, 0.88);
  border-radius: 6px; box-shadow: 0 1px 4px rgba(0, 0, 0, 0.25); }
#burg h1 { margin: 0; font-size: 16px; }
#burg p { margin: 2px 0; }
#burg label { display: block; cursor: pointer; white-space: nowrap; }
#burg input { margin: 0 6px 0 0; vertical-align: middle; }
#burg i { display: inline-block; width: 12px; height: 12px; margin-right: 6px;
  border-radius: 2px; vertical-align: -1px; }
"""
