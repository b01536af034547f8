"""A scene's objects at their places, drawn over a camera's image of the board."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.optics import FieldOfView, Intrinsics
from burg_drake.cameras.overlay.corrections import COLORS, Mark, PlacementVerdict, mark, ring
from burg_drake.cameras.overlay.painting import Ink, fill, stroke
from burg_drake.cameras.overlay.style import OverlayStyle
from burg_drake.cameras.overlay.tag_layout import write_tags
from burg_drake.cameras.overlay.text_tags import WHITE, notice, tag
from burg_drake.cameras.placement import PlacementCheck
from burg_drake.cameras.projection import (
    NOTHING,
    OUTLINE,
    SceneMesh,
    SurfaceCamera,
    SurfaceImage,
    VisibleLines,
    build_scene_mesh,
    clip_lines,
    footprints,
    visible_lines,
)
from burg_drake.core import Array, Bytes, Indices, InvalidInputError, inverse, transform_points
from burg_drake.core.terminal import CATEGORIES, distinct_colors
from burg_drake.scene.document import SceneLike, as_scene

LIGHT = np.array([0.35, -0.45, 0.82])
"""Where the light comes from, in S: from above, and a little from the front and the right."""
AMBIENT = 0.4
"""Brightness of what the light does not reach."""
INNER_WIDTH = 0.6
"""Width of inner lines, as a share of that of outlines."""
RIM, INNER_RIM = 0.65, 0.25
"""Opacity of the dark rims of outlines and of inner lines."""
BRIGHT = 0.4
"""How much brighter than surfaces lines are: share of what is left to white."""
FOOTPRINT_WIDTH, ARROW_WIDTH = 1.2, 3.0
"""[pixels]."""
FOOTPRINT_OPACITY = 0.7
DASH = 7.0
"""About half the distance of dashes along the outline of an uncertain object [pixels]."""
LETTERS = 0.028
"""Height of the font, as a share of the image's."""
SEEN = 12
"""Instances that show fewer pixels than this have no name written to them."""


@dataclass(frozen=True, eq=False)
class _DrawState:
    """What one `draw` works with."""

    shape: SceneMesh
    X_CS: Array
    lines: VisibleLines
    surface: SurfaceImage
    marks: dict[str, Mark]


class Overlay:
    """Draws the objects of a scene over images of one camera.

    Attributes:
        scene: whose objects.
        intrinsics: of the camera.
        style: used where `draw` is given none; may be replaced at any time.
    """

    def __init__(
        self, scene: SceneLike, intrinsics: Intrinsics, style: OverlayStyle | None = None
    ) -> None:
        """Loads the objects' surfaces.

        Args:
            scene: whose objects.
            intrinsics: of the camera.
            style: the default one if None.

        Raises:
            UnknownNameError: a mesh file of the library is missing.
        """
        scene = as_scene(scene)
        self.scene, self.intrinsics = scene, intrinsics
        self.style = style or OverlayStyle()
        self._view = FieldOfView(intrinsics)
        self._whole = build_scene_mesh(scene)
        self._shown: dict[tuple[str, ...] | None, tuple[SurfaceCamera, Array, Indices]] = {}
        self._colors = {name: _color(i) for i, name in enumerate(self._whole.names)}

    def draw(
        self,
        image: Bytes,
        X_SC: Array,
        *,
        placement: PlacementCheck | None = None,
        style: OverlayStyle | None = None,
    ) -> Bytes:
        """The image with the objects drawn over it.

        Args:
            image: (H, W, 3) red, green, blue.
            X_SC: (4, 4) camera's optical frame in the scene frame.
            placement: how far the objects stand from their places, if that is known.
            style: instead of the overlay's own.

        Returns:
            (H, W, 3) another image; the given one stays as it is.

        Raises:
            InvalidInputError: the image is of another size or kind than the camera's.
            UnknownNameError: `style.shown` names an instance that the scene does not have.
        """
        style = style or self.style
        drawn = self._copy(image)
        camera, standing, standing_owner = self._camera(style.shown)
        shape = camera.shape
        if not shape.names:
            return drawn
        lines = visible_lines(shape, self._view, X_SC)
        surface = camera.render(X_SC, lines, _shades(shape))
        marks = _marks(shape, placement, style)
        state = _DrawState(shape, inverse(X_SC), lines, surface, marks)
        colors = np.array([self._colors[name] for name in shape.names], dtype=float)
        fill(drawn, surface, colors, style.opacity)
        inks = [_outlines(state, _bright(colors), style.outline_width), *self._arrows(state)]
        if placement is not None and style.errors:
            inks += [self._lines(ring(extra), "off", state.X_CS) for extra in placement.extra]
        if style.footprints:
            inks.append(self._footprints(state, standing, standing_owner, _bright(colors)))
        stroke(drawn, inks)
        if style.names or marks:
            self._write(drawn, state, style.names)
        return drawn

    def notice(self, image: Bytes, text: str) -> Bytes:
        """The plain image with a line of text, such as why nothing is drawn over it.

        Args:
            image: (H, W, 3) red, green, blue.
            text: one line.
        """
        return notice(self._copy(image), text)

    def _copy(self, image: Bytes) -> Bytes:
        if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
            raise InvalidInputError(
                f"the image has shape {image.shape} and type {image.dtype}; expected RGB, (H, W,"
                " 3) uint8"
            )
        self.intrinsics.require_size(image.shape[1], image.shape[0], "image")
        return np.array(image, order="C")

    def _camera(self, shown: tuple[str, ...] | None) -> tuple[SurfaceCamera, Array, Indices]:
        """What looks at the instances shown, and their footprints with the instances' numbers."""
        if shown not in self._shown:
            shape = self._whole.of(shown)
            self._shown[shown] = (SurfaceCamera(shape, self._view), *footprints(shape))
        return self._shown[shown]

    def _footprints(self, state: _DrawState, lines: Array, owner: Indices, colors: Array) -> Ink:
        """Where objects stand, as far as no other object is seen there."""
        ends, line = clip_lines(transform_points(state.X_CS, lines), self._view)
        pixels, owner = self.intrinsics.project(ends), owner[line]
        height, width = state.surface.owner.shape
        x, y = np.round(pixels.mean(axis=1)).astype(int).T
        at = np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)
        there = state.surface.owner[at]
        seen = (there == owner) | (there == NOTHING)
        return _ink(
            pixels[seen], colors[owner[seen]], FOOTPRINT_WIDTH, FOOTPRINT_OPACITY, INNER_RIM
        )

    def _arrows(self, state: _DrawState) -> list[Ink]:
        return [self._lines(note.lines, note.verdict, state.X_CS) for note in state.marks.values()]

    def _lines(self, lines: Array, verdict: PlacementVerdict, X_CS: Array) -> Ink:
        """Lines (N, 2, 3) in S, in the color of what they say."""
        ends, _ = clip_lines(transform_points(X_CS, lines), self._view)
        colors = np.tile(np.array(COLORS[verdict], dtype=float), (len(ends), 1))
        return _ink(self.intrinsics.project(ends), colors, ARROW_WIDTH, 1.0, RIM)

    def _write(self, drawn: Bytes, state: _DrawState, names: bool) -> None:
        """Names of what can be seen, and how it stands."""
        owner = state.surface.owner
        seen = np.bincount(owner[owner != NOTHING], minlength=len(state.shape.names))
        boxes, plates = [], []
        for number in np.flatnonzero(seen >= SEEN):
            ends = state.lines.ends[state.lines.owner == number].reshape(-1, 2)
            name = state.shape.names[number]
            note = state.marks.get(name)
            words = [name] * names + ([note.text] if note else [])
            if len(ends) and words:
                size = self.intrinsics.width - 1, self.intrinsics.height - 1
                boxes.append(np.clip([ends.min(axis=0), ends.max(axis=0)], 0, size))
                color = COLORS[note.verdict] if note else WHITE
                plates.append(tag("  ".join(words), color, round(LETTERS * len(drawn))))
        if plates:
            write_tags(drawn, np.array(boxes), plates, owner != NOTHING)


def instance_labels(scene: SceneLike, intrinsics: Intrinsics, X_SC: Array) -> NDArray[np.int16]:
    """Which instance each pixel shows.

    Args:
        scene: whose objects, at their places; as loaded, or a reference for `load_scene`.
        intrinsics: of the camera.
        X_SC: (4, 4) camera's optical frame in the scene frame.

    Returns:
        (H, W) numbers of the instances, in the order of `scene.instances` and then
        `scene.background`; -1 where there is none.
    """
    shape, view = build_scene_mesh(as_scene(scene)), FieldOfView(intrinsics)
    lines = visible_lines(shape, view, X_SC)
    return SurfaceCamera(shape, view).render(X_SC, lines, _shades(shape)).owner


def _marks(
    shape: SceneMesh, placement: PlacementCheck | None, style: OverlayStyle
) -> dict[str, Mark]:
    """By instance, what is left to do."""
    if placement is None or not style.errors:
        return {}
    return {
        name: mark(placement.instances[name], style, float(box[1, 2]))
        for name, box in zip(shape.names, shape.boxes, strict=True)
        if name in placement.instances
    }


def _outlines(state: _DrawState, colors: Array, width: float) -> Ink:
    """Outlines and inner lines; the former say by their colour how an object stands, and are dashed
    where that is uncertain."""
    lines, rims = state.lines, np.array(colors)
    for number, name in enumerate(state.shape.names):
        if name in state.marks:
            rims[number] = COLORS[state.marks[name].verdict]
    outer = lines.kind == OUTLINE
    chosen = np.where(outer[:, None], rims[lines.owner], colors[lines.owner])
    widths = width * np.where(outer, 1.0, INNER_WIDTH)
    for number, name in enumerate(state.shape.names):
        if name in state.marks and state.marks[name].verdict == "uncertain":
            dashed = outer & (lines.owner == number)
            widths[dashed] *= _dashes(lines.ends[dashed])
    return _ink(lines.ends, chosen, widths, 1.0, np.where(outer, RIM, INNER_RIM))


def _dashes(ends: Array) -> NDArray[np.bool_]:
    """(N,) which of the short lines (N, 2, 2) around an object [pixels] belong to a dash: those in
    every other sector about its middle, as lines do not come in the order of the outline."""
    arms = ends.mean(axis=1) - ends.mean(axis=(0, 1))
    around = 2 * np.pi * np.linalg.norm(arms, axis=1).mean() if len(arms) else 0.0
    dashes = max(round(around / (2 * DASH)), 4)
    share = np.arctan2(arms[:, 1], arms[:, 0]) / (2 * np.pi) % 1.0
    return np.asarray((share * dashes) % 1.0 < 0.6)


def _ink(
    ends: Array, colors: Array, width: float | Array, opacity: float, rim: float | Array
) -> Ink:
    values = [np.broadcast_to(np.asarray(v, dtype=float), len(ends)) for v in (width, opacity, rim)]
    return Ink(ends, colors, *values)


def _color(number: int) -> tuple[int, int, int]:
    """Of an instance by its place in the scene: the first ones' stay apart for all eyes."""
    rest = number - len(CATEGORIES)
    rgb = CATEGORIES[number][:3] if rest < 0 else distinct_colors(rest + 1)[rest]
    r, g, b = (round(255 * c) for c in rgb)
    return r, g, b


def _bright(colors: Array) -> Array:
    return colors + BRIGHT * (255.0 - colors)


def _shades(shape: SceneMesh) -> Bytes:
    """(F,) brightness of faces, lit from above."""
    lit = np.clip(shape.outline.normals @ (LIGHT / np.linalg.norm(LIGHT)), 0.0, 1.0)
    return np.asarray(np.round(255 * (AMBIENT + (1.0 - AMBIENT) * lit)), np.uint8)
