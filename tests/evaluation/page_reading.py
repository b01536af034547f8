"""Reading reports back: what a browser would fetch, whether elements nest, what stands where."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from html.parser import HTMLParser

VOID = {"meta", "br", "hr"}


@dataclass(eq=False)
class Node:
    """An element with its children and texts."""

    tag: str
    attributes: dict[str, str]
    children: list[Node | str] = field(default_factory=list)

    @property
    def style(self) -> list[str]:
        return self.attributes.get("class", "").split()

    @property
    def text(self) -> str:
        parts = (c if isinstance(c, str) else c.text for c in self.children)
        return " ".join(" ".join(parts).split())

    def find(self, tag: str = "", style: str = "") -> list[Node]:
        """Elements below this one, by tag or class, in the order of the page."""
        found = []
        for child in self.children:
            if isinstance(child, Node):
                if tag in ("", child.tag) and (not style or style in child.style):
                    found.append(child)
                found += child.find(tag, style)
        return found


class Reader(HTMLParser):
    """Makes a tree of a page and refuses elements that do not nest."""

    def __init__(self) -> None:
        super().__init__()
        self.root = Node("", {})
        self.open = [self.root]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        node = Node(tag, {key: value or "" for key, value in attrs})
        self.open[-1].children.append(node)
        if tag not in VOID:
            self.open.append(node)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open[-1].children.append(Node(tag, {key: value or "" for key, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop().tag == tag

    def handle_data(self, data: str) -> None:
        self.open[-1].children.append(data)


def read_page(page: str, links: tuple[str, ...] = ()) -> Node:
    """The tree of a page that fetches nothing and links to nothing but `links`."""
    reader = Reader()
    reader.feed(page)
    assert reader.open == [reader.root]
    found = [
        value
        for node in reader.root.find()
        for key, value in node.attributes.items()
        if key in ("src", "href", "srcset", "data")
    ]
    assert sorted(found) == sorted(links)
    assert "@import" not in page and "url(" not in page and "<script" not in page
    assert not re.search(r"https?://", page)
    for picture in reader.root.find("svg"):
        if picture.attributes.get("role") == "img":
            assert picture.attributes["aria-label"]
    return reader.root


def part(root: Node, title: str) -> Node:
    """The section under a heading."""
    return next(s for s in root.find("section") if s.find("h2")[0].text == title)
