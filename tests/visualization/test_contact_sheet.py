"""The contact sheet: what is on it, and that it needs nothing else."""

from __future__ import annotations

import base64
import dataclasses
import io
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from PIL import Image

from burg_drake.core import Pose
from burg_drake.objects import (
    ContactGeometry,
    Fit,
    ObjectLibrary,
    Primitive,
    StablePose,
    load_library,
)
from burg_drake.system_libraries import missing_render_libraries
from burg_drake.visualization import (
    contact_name,
    mass_text,
    percent_text,
    pose_note,
    surface_notes,
    write_contact_sheet,
)

needs_renderer = pytest.mark.skipif(
    bool(missing_render_libraries()), reason="Drake cannot render here"
)


class Page(HTMLParser):
    """Collects pictures, cards, what would be loaded, and the text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.images: list[str] = []
        self.cards: list[str] = []
        self.loads: list[str] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if tag == "img":
            self.images.append(given["src"])
        if tag == "article":
            self.cards.append(given["id"])
        if tag in ("link", "script", "iframe") or given.get("href", "#")[0] != "#":
            self.loads.append(tag)

    def handle_data(self, data: str) -> None:
        self.text += f" {data}"


def sheet(library: ObjectLibrary, tmp_path: Path, **options: object) -> Page:
    path = tmp_path / "sheet.html"
    write_contact_sheet(library, path, **options)  # type: ignore[arg-type]
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"https?:", text)
    return Page(text)


@needs_renderer
def test_a_card_an_object_with_its_pictures(tmp_path: Path) -> None:
    library = load_library("household")
    names = ["mug", "marble"]
    page = sheet(library, tmp_path, names=names, remarks={"mug": ["<heavy> for a mug"]})
    assert page.cards == ["object-mug", "object-marble"]
    poses = sum(len(library.entry(name).stable_poses) for name in names)
    assert len(page.images) == 2 * len(names) + poses
    assert page.loads == []
    for source in page.images:
        head, data = source.split(",", 1)
        assert head == "data:image/png;base64"
        assert Image.open(io.BytesIO(base64.b64decode(data))).width in (320, 160)
    for text in ("<heavy> for a mug", "25 pieces", "118 × 81 × 81", "118 g", "1.9 mm"):
        assert text in page.text, text


@needs_renderer
def test_figures_of_a_fit_and_a_simulated_pose(tmp_path: Path) -> None:
    library = load_library("household")
    entry = library.entry("can")
    poses = (StablePose(probability=1.0, X_SO=Pose(), residual=0.01, rolls=True),)
    fit = Fit(volume_ratio=1.234, hausdorff=0.0056)
    primitive = Primitive(shape="cylinder", size=(0.034, 0.1019))
    contact = ContactGeometry(kind="primitive", primitive=primitive, fit=fit)
    can = dataclasses.replace(entry, stable_poses=poses, contact=contact)
    document = dataclasses.replace(library.document, objects={"can": can})
    page = sheet(ObjectLibrary(document, library.root), tmp_path)
    for text in ("1.23", "5.6 mm", "cylinder 34 x 102 mm", "100 %", "rolls, tilt 0.6°"):
        assert text in page.text, text
    assert "not measured" not in page.text


@pytest.mark.parametrize(
    ("probability", "text"), [(1.0, "100 %"), (0.0996, "10 %"), (0.0433, "4.3 %"), (0.001, "0.1 %")]
)
def test_shares(probability: float, text: str) -> None:
    assert percent_text(probability) == text


@pytest.mark.parametrize(
    ("mass", "text"), [(0.118, "118 g"), (0.0052, "5.20 g"), (1.5, "1.50 kg"), (12.34, "12.3 kg")]
)
def test_masses(mass: float, text: str) -> None:
    assert mass_text(mass) == text


def test_words() -> None:
    assert contact_name(ContactGeometry()) == "convex pieces, rigid"
    assert contact_name(ContactGeometry(kind="mesh", mesh="m.obj")) == "surface mesh, rigid"
    assert pose_note(StablePose(probability=1.0, X_SO=Pose())) == ""


def test_repairs_are_told_once() -> None:
    library = load_library("household")
    entry = library.entry("mug")
    repairs = ("dropped 2 faces", "closed 1 hole", "dropped 2 faces")
    source = dataclasses.replace(entry.source, repairs=repairs)
    document = dataclasses.replace(
        library.document, objects={"mug": dataclasses.replace(entry, source=source)}
    )
    told = surface_notes(ObjectLibrary(document, library.root), "mug")
    assert told == ["The surface is closed. Repairs: dropped 2 faces; closed 1 hole."]
    assert surface_notes(library, "mug") == ["The surface is closed. Nothing had to be repaired."]
