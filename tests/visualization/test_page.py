"""Saved pages: complete, self-contained, and safe against odd names."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from pydrake.geometry import Box, Rgba

from burg_drake.core import InvalidInputError
from burg_drake.visualization import LegendEntry, open_meshcat, page_panel, save_html


class Resources(HTMLParser):
    """Collects what a page would load, its text and its tags."""

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.tags: list[str] = []
        self.titles: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        loading = {"src", "srcset", "poster", "data"} | ({"href"} if tag == "link" else set())
        self.loads += [value or "" for name, value in attrs if name in loading]

    def handle_data(self, data: str) -> None:
        if self.tags and self.tags[-1] == "title":
            self.titles.append(data.strip())


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    meshcat = open_meshcat()
    meshcat.SetObject("/drake/box", Box(0.1, 0.1, 0.1), Rgba(1, 0, 0, 1))
    path = tmp_path_factory.mktemp("page") / "view.html"
    save_html(
        meshcat,
        path,
        title="a < b & c",
        caption=["one", "<script>alert(1)</script>"],
        legend=[LegendEntry("lifted (3)", "#009e73", ("/drake/a", "/drake/b"))],
    )
    return path.read_text()


def test_nothing_is_loaded_from_elsewhere(page: str) -> None:
    resources = Resources()
    resources.feed(page)
    assert resources.loads == []
    assert not re.search(r"@import|url\(['\"]?https?:", page)


def test_title_and_caption_are_text(page: str) -> None:
    resources = Resources()
    resources.feed(page)
    assert "a < b & c" in resources.titles
    assert "<p>&lt;script&gt;alert(1)&lt;/script&gt;</p>" in page
    assert page.count("</body>") == 1


def test_the_panel_is_in_the_page_before_its_end(page: str) -> None:
    assert page.index('<details id="burg" open>') < page.rindex("</body>")
    assert 'data-paths="/drake/a /drake/b"' in page


def test_view_and_panel_are_beside_each_other(page: str) -> None:
    """Meshcat puts its controls into its pane's parent, which has to be the view's element."""
    (inside,) = re.findall(r'<div id="view">(.*?)<script', page, flags=re.DOTALL)
    pane = r'\s*<div id="meshcat-pane">\s*</div>\s*</div>\s*'
    assert re.fullmatch(pane, inside)
    assert page.index('id="view"') < page.index('<details id="burg"')
    (rule,) = re.findall(r"#burg \{[^}]*\}", page)
    assert "position" not in rule


def test_narrow_views_show_as_much_as_the_narrowest_that_cameras_are_aimed_for(page: str) -> None:
    assert 'data-aspect="1.2"' in page
    assert "Math.min(1, pane.offsetWidth / pane.offsetHeight / narrowestAspect)" in page


def test_legend_is_escaped() -> None:
    html = page_panel("t", [], [LegendEntry('<b>"', 'red"', ('/a"',))])
    assert "<b>" not in html
    assert 'red"' not in html


def test_unwritable(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match="cannot write"):
        save_html(open_meshcat(), tmp_path / "file" / "view.html", title="t")
