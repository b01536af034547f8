"""HTML and SVG in which every text is escaped: single elements, and pages made of templates."""

from __future__ import annotations

import base64
import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import burg_drake
from burg_drake.core import NO_VALUE, format_count, format_duration, format_number, format_percent

if TYPE_CHECKING:
    from jinja2 import Environment


class Html(str):
    """Markup that is already escaped."""

    def __html__(self) -> Html:
        """Itself; this tells templates not to escape it."""
        return self


Child = Html | str | int | float | None
Attribute = str | float | None


def element(name: str, /, *children: Child, **attributes: Attribute) -> Html:
    """An HTML or SVG element.

    Args:
        name: tag.
        children: elements, or texts, which are escaped; None is left out.
        attributes: attributes, whose values are escaped. Underscores stand for hyphens, a trailing
            one is dropped (`class_`); None leaves the attribute out.
    """
    html_void_elements = ("br", "hr", "meta", "img", "input")  # without an end tag
    svg_shapes = ("rect", "line", "path", "circle")
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(str(value))}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in html_void_elements and not children:
        return Html(f"<{name}{written}>")
    if name in svg_shapes and not children:
        return Html(f"<{name}{written}/>")
    return Html(f"<{name}{written}>{join(*children)}</{name}>")


def svg_line(
    x1: float,
    y1: float,
    x2: float,
    y2: float,
    css_class: str | None = None,
    **attributes: Attribute,
) -> Html:
    """A line of an SVG picture, in its units, styled by `css_class`."""
    ends = {"x1": x1, "y1": y1, "x2": x2, "y2": y2}
    return element("line", **_rounded(ends), class_=css_class, **attributes)


def svg_rectangle(
    x: float, y: float, width: float, height: float, *children: Child, **attributes: Attribute
) -> Html:
    """A rectangle of an SVG picture, in its units."""
    box = {"x": x, "y": y, "width": width, "height": height}
    return element("rect", *children, **_rounded(box), **attributes)


def svg_text(
    text: Child, x: float, y: float, css_class: str | None = None, **attributes: Attribute
) -> Html:
    """A text of an SVG picture, at a position in its units, styled by `css_class`."""
    return element("text", text, **_rounded({"x": x, "y": y}), class_=css_class, **attributes)


def _rounded(lengths: dict[str, float]) -> dict[str, float]:
    return {name: round(length, 2) for name, length in lengths.items()}


def join(*children: Child) -> Html:
    """Concatenates elements and texts; texts are escaped."""
    given = (child for child in children if child is not None)
    return Html("".join(c if isinstance(c, Html) else escape(str(c)) for c in given))


def page_style(package: str, name: str) -> Html:
    """Style sheet of a page, after the rules that all pages share.

    Args:
        package: package with the style sheet.
        name: file name of the style sheet.
    """
    sheets = ("burg_drake.visualization", "page.css"), (package, name)
    texts = ((files(where) / file).read_text(encoding="utf-8") for where, file in sheets)
    return Html("".join(texts))


@dataclass(frozen=True)
class PageTable:
    """A table of a page.

    Attributes:
        head: names of the columns.
        rows: cells of each row; the first cell names the row.
        numbers: indices of right-aligned columns.
        style: CSS class.
        total: whether the last row is the sum of the others.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[object]]
    numbers: Sequence[int] = ()
    style: str = ""
    total: bool = False


def render_page(template: str, **values: object) -> str:
    """Renders a page from a template.

    Args:
        template: path in the package, such as `evaluation/report/report.html.jinja`. A whole
            page starts with `{% extends "visualization/page.html.jinja" %}`, and can import the
            tables of `visualization/blocks.html.jinja`.
        values: values of the template by name. They are escaped, unless they are `Html`.
    """
    return _environment().get_template(template).render(values)


@functools.cache
def _environment() -> Environment:
    """The package's template environment; compiles each template once per process."""
    # Imported here, as processes that write no page need none of its 80 ms.
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(Path(burg_drake.__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":")}
    environment.globals["NO_VALUE"] = NO_VALUE
    environment.filters |= {
        "count": format_count,
        "degrees": math.degrees,
        "duration": format_duration,
        "number": format_number,
        "percent": format_percent,
        "png_uri": _png_uri,
    }
    return environment


def _png_uri(data: bytes) -> str:
    """A PNG file as a data URI."""
    return f"data:image/png;base64,{base64.b64encode(data).decode()}"
