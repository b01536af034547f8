"""Draw a scene's objects over a camera image of the board."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.frame_source import require_rgb
from burg_drake.cameras.intrinsics import FieldOfView, Intrinsics
from burg_drake.cameras.placement.document import ExtraObject, Placement, PlacementCheck
from burg_drake.cameras.scene_mesh import SceneMesh, build_scene_mesh, object_footprints
from burg_drake.cameras.scene_projection import (
    NO_OWNER,
    OUTLINE_KIND,
    SurfaceCamera,
    SurfaceImage,
    VisibleLines,
    clip_lines,
    visible_lines,
)
from burg_drake.cameras.text_tags import TEXT_COLOR, draw_notice, draw_tags, render_tag
from burg_drake.core import (
    CATEGORY_COLORS,
    Array,
    Booleans,
    Bytes,
    Indices,
    InvalidInputError,
    Units,
    distinct_colors,
    inverse,
    setting,
    transform_points,
)
from burg_drake.scene import SceneLike, as_scene


@dataclass(frozen=True, kw_only=True)
class OverlayStyle:
    """Style of the objects of a scene that are drawn over an image.

    Attributes:
        opacity: of the objects' surfaces, 0 (outlines alone) to 1.
        outline_width: of the outlines [pixels]; inner lines are thinner.
        names: write each object's name.
        footprints: draw where objects touch the board.
        errors: draw how far each object stands from its place, where a placement check is given.
        tolerance: displacement up to which an object counts as placed [m].
        angle_tolerance: turn up to which an object counts as placed [rad].
        shown: instances that are drawn, as if there were no others; all if None.
    """

    opacity: float = setting(
        0.45,
        "opacity of the drawn objects, 0 (outlines) to 1",
        metavar="X",
        low=0,
        high=1,
        noun="a number",
    )
    outline_width: float = 2.0
    names: bool = True
    footprints: bool = True
    errors: bool = True
    tolerance: float = setting(
        1e-3,
        "objects within this distance of their target are green",
        unit=Units.millimetres,
        metavar="X",
        above=0,
    )
    angle_tolerance: float = setting(
        math.radians(1.0),
        "objects within this angle of their target are green",
        unit=Units.degrees,
        name="tolerance_deg",
        metavar="X",
        above=0,
    )
    shown: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        if not 0.0 <= self.opacity <= 1.0:
            raise InvalidInputError(f"opacity {self.opacity:g} of an overlay must be 0 to 1")
        if not 0.0 <= self.outline_width <= 20.0:
            raise InvalidInputError(
                f"outline_width {self.outline_width:g} of an overlay must be 0 to 20 pixels"
            )
        if min(self.tolerance, self.angle_tolerance) < 0.0:
            raise InvalidInputError("tolerances of an overlay must be at least 0")


LIGHT_DIRECTION = np.array([0.35, -0.45, 0.82])
"""Direction to the light, in the sheet's frame S."""
RIM_OPACITY = 0.65  # Opacity of the dark rim of outlines and arrows.
INNER_RIM_OPACITY = 0.25  # Opacity of the dark rim of inner lines and footprints.
ARROW_HEAD_LENGTH = 0.010  # Metres.
ARC_ANGLE = math.radians(80.0)  # Radians.
ARC_SEGMENTS = 12  # Straight lines of an arc.


@dataclass(frozen=True, eq=False)
class _DrawState:
    """State of one call of `draw`."""

    shape: SceneMesh
    X_CS: Array
    lines: VisibleLines
    surface: SurfaceImage
    marks: dict[str, CorrectionMark]


class Overlay:
    """Draws the objects of a scene over images of one camera.

    Attributes:
        scene: scene to draw.
        intrinsics: of the camera.
        style: style of `draw` without one of its own; may be replaced at any time.
    """

    def __init__(
        self, scene: SceneLike, intrinsics: Intrinsics, style: OverlayStyle | None = None
    ) -> None:
        """Loads the objects' surfaces.

        Args:
            scene: scene to draw.
            intrinsics: of the camera.
            style: the default one if None.

        Raises:
            UnknownNameError: a mesh file of the library is missing.
        """
        scene = as_scene(scene)
        self.scene, self.intrinsics = scene, intrinsics
        self.style = style or OverlayStyle()
        self._view = FieldOfView(intrinsics)
        self._full_mesh = build_scene_mesh(scene)
        self._shown: dict[tuple[str, ...] | None, tuple[SurfaceCamera, Array, Indices]] = {}
        self._colors = {name: _instance_color(i) for i, name in enumerate(self._full_mesh.names)}

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
            placement: deviations of the objects from their targets, if known.
            style: replaces the overlay's own.

        Returns:
            (H, W, 3) a new image.

        Raises:
            InvalidInputError: the image has the wrong size or type.
            UnknownNameError: `style.shown` names an instance that the scene does not have.
        """
        style = style or self.style
        drawn = self._checked_copy(image)
        camera, standing, standing_owner = self._surface_camera(style.shown)
        shape = camera.shape
        if not shape.names:
            return drawn
        lines = visible_lines(shape, self._view, X_SC)
        surface = camera.render(X_SC, lines, _face_brightness(shape))
        marks = _correction_marks(shape, placement, style)
        state = _DrawState(shape, inverse(X_SC), lines, surface, marks)
        colors = np.array([self._colors[name] for name in shape.names], dtype=float)
        blend_surfaces(drawn, surface, colors, style.opacity)
        bright = _brighten(colors)
        line_sets = [_outline_lines(state, bright, style.outline_width)]
        line_sets += [self._project_mark(m.lines, m.verdict, state.X_CS) for m in marks.values()]
        if placement is not None and style.errors:
            circles = map(circle_extra_object, placement.extra)
            line_sets += [self._project_mark(circle, "off", state.X_CS) for circle in circles]
        if style.footprints:
            line_sets.append(self._project_footprints(state, standing, standing_owner, bright))
        blend_lines(drawn, line_sets)
        if style.names or marks:
            self._write_tags(drawn, state, style.names)
        return drawn

    def notice(self, image: Bytes, text: str) -> Bytes:
        """Draws a line of text over the image, such as why there is no overlay.

        Args:
            image: (H, W, 3) red, green, blue.
            text: one line.
        """
        return draw_notice(self._checked_copy(image), text)

    def _checked_copy(self, image: Bytes) -> Bytes:
        require_rgb(image)
        self.intrinsics.require_size(image.shape[1], image.shape[0], "image")
        return np.array(image, order="C")

    def _surface_camera(
        self, shown: tuple[str, ...] | None
    ) -> tuple[SurfaceCamera, Array, Indices]:
        """Surface camera for the shown instances; (N, 2, 3) lines of their footprints; and (N,) the
        numbers of the lines' instances.
        """
        if shown not in self._shown:
            shape = self._full_mesh.select(shown)
            self._shown[shown] = (SurfaceCamera(shape, self._view), *object_footprints(shape))
        return self._shown[shown]

    def _project_footprints(
        self, state: _DrawState, lines: Array, owner: Indices, colors: Array
    ) -> LineSet:
        """Projects the lines (N, 2, 3) of the footprints that no other object hides."""
        ends, line = clip_lines(transform_points(state.X_CS, lines), self._view)
        pixels, owner = self.intrinsics.project(ends), owner[line]
        height, width = state.surface.owner.shape
        x, y = np.round(pixels.mean(axis=1)).astype(int).T
        at = np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)
        shown_owner = state.surface.owner[at]
        seen = (shown_owner == owner) | (shown_owner == NO_OWNER)
        return _line_set(pixels[seen], colors[owner[seen]], 1.2, 0.7, INNER_RIM_OPACITY)

    def _project_mark(self, lines: Array, verdict: PlacementVerdict, X_CS: Array) -> LineSet:
        """Projects lines (N, 2, 3) of a mark in S, in the colour of its verdict."""
        ends, _ = clip_lines(transform_points(X_CS, lines), self._view)
        colors = np.tile(np.array(VERDICT_COLORS[verdict], dtype=float), (len(ends), 1))
        return _line_set(self.intrinsics.project(ends), colors, 3.0, 1.0, RIM_OPACITY)

    def _write_tags(self, drawn: Bytes, state: _DrawState, names: bool) -> None:
        """Writes names of visible objects, and their corrections."""
        owner = state.surface.owner
        seen = np.bincount(owner[owner != NO_OWNER], minlength=len(state.shape.names))
        boxes, tags = [], []
        for number in np.flatnonzero(seen >= 12):  # Visible pixels of an instance with a name tag.
            ends = state.lines.ends[state.lines.owner == number].reshape(-1, 2)
            name = state.shape.names[number]
            mark = state.marks.get(name)
            words = [name] * names + ([mark.text] if mark else [])
            if len(ends) and words:
                size = self.intrinsics.width - 1, self.intrinsics.height - 1
                boxes.append(np.clip([ends.min(axis=0), ends.max(axis=0)], 0, size))
                color = VERDICT_COLORS[mark.verdict] if mark else TEXT_COLOR
                # Fraction of the image's height.
                tags.append(render_tag("  ".join(words), color, round(0.028 * len(drawn))))
        if tags:
            draw_tags(drawn, np.array(boxes), tags, owner != NO_OWNER)


def instance_labels(scene: SceneLike, intrinsics: Intrinsics, X_SC: Array) -> NDArray[np.int16]:
    """Labels each pixel with the instance that it shows.

    Args:
        scene: scene with the objects at their targets; as loaded, or a reference for `load_scene`.
        intrinsics: of the camera.
        X_SC: (4, 4) camera's optical frame in the scene frame.

    Returns:
        (H, W) numbers of the instances, in the order of `scene.instances` and then
        `scene.background`; -1 for none.
    """
    shape, view = build_scene_mesh(as_scene(scene)), FieldOfView(intrinsics)
    lines = visible_lines(shape, view, X_SC)
    return SurfaceCamera(shape, view).render(X_SC, lines, _face_brightness(shape)).owner


def _correction_marks(
    shape: SceneMesh, placement: PlacementCheck | None, style: OverlayStyle
) -> dict[str, CorrectionMark]:
    """Correction marks by instance."""
    if placement is None or not style.errors:
        return {}
    return {
        name: correction_mark(placement.instances[name], style, float(box[1, 2]))
        for name, box in zip(shape.names, shape.boxes, strict=True)
        if name in placement.instances
    }


def _outline_lines(state: _DrawState, colors: Array, width: float) -> LineSet:
    """Outlines and inner lines. An outline's colour shows the placement; outlines of uncertain
    placements are dashed.
    """
    lines, rims = state.lines, np.array(colors)
    for number, name in enumerate(state.shape.names):
        if name in state.marks:
            rims[number] = VERDICT_COLORS[state.marks[name].verdict]
    outer = lines.kind == OUTLINE_KIND
    chosen = np.where(outer[:, None], rims[lines.owner], colors[lines.owner])
    widths = width * np.where(outer, 1.0, 0.6)  # Inner lines are thinner.
    for number, name in enumerate(state.shape.names):
        if name in state.marks and state.marks[name].verdict == "uncertain":
            dashed = outer & (lines.owner == number)
            widths[dashed] *= _dash_mask(lines.ends[dashed])
    rim_opacity = np.where(outer, RIM_OPACITY, INNER_RIM_OPACITY)
    return _line_set(lines.ends, chosen, widths, 1.0, rim_opacity)


def _dash_mask(ends: Array) -> Booleans:
    """(N,) True for the short lines (N, 2, 2) around an object [pixels] that belong to a dash:
    dashes are sectors about the object's middle, as lines are not ordered along the outline.
    """
    arms = ends.mean(axis=1) - ends.mean(axis=(0, 1))
    around = 2 * np.pi * np.linalg.norm(arms, axis=1).mean() if len(arms) else 0.0
    dashes = max(round(around / 14.0), 4)  # Pixels. Approximate period of dashes.
    share = np.arctan2(arms[:, 1], arms[:, 0]) / (2 * np.pi) % 1.0
    return np.asarray((share * dashes) % 1.0 < 0.6)


def _line_set(
    ends: Array, colors: Array, width: float | Array, opacity: float, rim: float | Array
) -> LineSet:
    values = [np.broadcast_to(np.asarray(v, dtype=float), len(ends)) for v in (width, opacity, rim)]
    return LineSet(ends, colors, *values)


def _instance_color(number: int) -> tuple[int, int, int]:
    """Colour of an instance by its index in the scene; the first ones are safe for colour
    blindness.
    """
    rest = number - len(CATEGORY_COLORS)
    rgb = CATEGORY_COLORS[number][:3] if rest < 0 else distinct_colors(rest + 1)[rest]
    r, g, b = (round(255 * c) for c in rgb)
    return r, g, b


def _brighten(colors: Array) -> Array:
    return colors + 0.4 * (255.0 - colors)  # Fraction of the difference to white.


def _face_brightness(shape: SceneMesh) -> Bytes:
    """(F,) brightness of faces, lit from above."""
    ambient = 0.4  # Brightness of faces that the light does not reach.
    light = LIGHT_DIRECTION / np.linalg.norm(LIGHT_DIRECTION)
    diffuse = np.clip(shape.outline.normals @ light, 0.0, 1.0)
    return np.asarray(np.round(255 * (ambient + (1.0 - ambient) * diffuse)), np.uint8)


PlacementVerdict = Literal["placed", "off", "uncertain", "not_seen"]

VERDICT_COLORS: dict[PlacementVerdict, tuple[int, int, int]] = {
    "placed": (70, 230, 120),
    "off": (255, 110, 70),
    "uncertain": (255, 205, 70),
    "not_seen": (190, 195, 200),
}
"""RGB of outlines, arrows and texts."""


@dataclass(frozen=True, eq=False)
class CorrectionMark:
    """Text and arrows for one object.

    Attributes:
        verdict: state of the placement.
        text: correction as text; empty if there is none.
        lines: (N, 2, 3) arrows in S [m].
    """

    verdict: PlacementVerdict
    text: str
    lines: Array


def correction_mark(placement: Placement, style: OverlayStyle, height: float) -> CorrectionMark:
    """Builds the mark for the remaining correction of an object.

    Args:
        placement: of the object.
        style: style with the tolerances.
        height: z of the arrows in S [m].
    """
    nothing = np.empty((0, 2, 3))
    uncertain = placement.status == "uncertain"
    if placement.displacement is None:
        if uncertain:
            return CorrectionMark("uncertain", "?", nothing)
        return CorrectionMark("not_seen", "not seen", nothing)
    move = -np.array(placement.displacement)
    turn = -(placement.angle or 0.0)
    is_far, is_turned = math.hypot(*move) > style.tolerance, abs(turn) > style.angle_tolerance
    verdict: PlacementVerdict = "off" if is_far or is_turned else "placed"
    if uncertain:
        verdict = "uncertain"
    target = (placement.target.matrix() @ (*(placement.reference or (0.0, 0.0, 0.0)), 1.0))[:3]
    target[2] = height
    lines = [nothing]
    if is_far:
        lines.append(_arrow_lines(target, np.array([*move, 0.0])))
    if is_turned:
        lines.append(_turn_arrow_lines(target, turn))
    return CorrectionMark(verdict, _correction_text(placement, uncertain), np.concatenate(lines))


def circle_extra_object(extra: ExtraObject) -> Array:
    """(N, 2, 3) lines of a circle on the board around an extra object, in S [m]."""
    around = np.linspace(0.0, 2.0 * np.pi, 2 * ARC_SEGMENTS + 1)
    radius = max(0.6 * extra.width, ARROW_HEAD_LENGTH)
    x, y = extra.position
    points = np.zeros((len(around), 3))
    points[:, 0], points[:, 1] = x + radius * np.cos(around), y + radius * np.sin(around)
    return np.stack([points[:-1], points[1:]], axis=1)


def _correction_text(placement: Placement, uncertain: bool) -> str:
    """Distance and angle; with a question mark and standard deviations if uncertain."""
    far_sd = placement.displacement_sd if uncertain else None
    turn_sd = placement.angle_sd if uncertain else None
    millimetres = 1e3 * math.hypot(*(placement.displacement or (0.0, 0.0)))
    text = (
        _format_number(millimetres, None if far_sd is None else 1e3 * math.hypot(*far_sd)) + " mm"
    )
    if placement.angle is not None:
        turn = abs(math.degrees(placement.angle))
        text += f" {_format_number(turn, None if turn_sd is None else math.degrees(turn_sd))}°"
    return f"? {text}" if uncertain else text


def _format_number(value: float, sd: float | None) -> str:
    text = f"{value:.1f}" if value < 9.95 else f"{value:.0f}"
    return text if sd is None else f"{text}±{_format_number(sd, None)}"


def _arrow_lines(target: Array, move: Array) -> Array:
    """Lines of an arrow that ends at the target; short moves are drawn longer."""
    length = float(np.linalg.norm(move))
    drawn = max(length, 0.035)  # Metres. Arrows for shorter corrections are drawn this long.
    along = move / length
    head = _arrow_head_lines(target, along, 0.4 * drawn)
    return np.concatenate([[[target - drawn * along, target]], head])


def _turn_arrow_lines(center: Array, angle: float) -> Array:
    """Lines of an arc about the vertical, with an arrow head."""
    share = np.linspace(-ARC_ANGLE / 2, ARC_ANGLE / 2, ARC_SEGMENTS + 1)
    around = math.copysign(1.0, angle) * share - math.pi / 2
    radial = np.column_stack([np.cos(around), np.sin(around), np.zeros_like(around)])
    points = center + 0.030 * radial  # Radius of the arc in metres.
    lines = np.stack([points[:-1], points[1:]], axis=1)
    along = points[-1] - points[-2]
    head = _arrow_head_lines(points[-1], along / np.linalg.norm(along), ARROW_HEAD_LENGTH)
    return np.concatenate([lines, head])


def _arrow_head_lines(tip: Array, along: Array, length: float) -> Array:
    across = np.array([-along[1], along[0], 0.0])
    length = min(length, ARROW_HEAD_LENGTH)
    back = tip - length * along
    return np.array([[back + 0.6 * length * across, tip], [back - 0.6 * length * across, tip]])


def blend_surfaces(image: Bytes, surface: SurfaceImage, colors: Array, opacity: float) -> None:
    """Blends surfaces into an image (H, W, 3), in place.

    Args:
        image: image to draw into.
        surface: instance and shade of each pixel.
        colors: (N, 3) of the instances, 0 to 255.
        opacity: 0 to 1.
    """
    at = np.flatnonzero(surface.owner.ravel() != NO_OWNER)
    if not len(at) or opacity == 0.0:
        return
    weight = round(256 * opacity)
    # Table of weighted colours; its row is 256 times the instance plus the shade.
    shaded = colors[:, None, :] * np.arange(256)[None, :, None] / 255.0
    table = np.round(weight * shaded).astype(np.uint16).reshape(-1, 3)
    row = surface.owner.ravel()[at].astype(np.int32) * 256 + surface.shade.ravel()[at]
    flat = image.reshape(-1, 3)
    mixed = np.take(flat, at, axis=0) * np.uint16(256 - weight)
    mixed += np.take(table, row, axis=0)
    mixed >>= 8
    flat[at] = mixed


@dataclass(frozen=True, eq=False)
class LineSet:
    """Lines to draw.

    Attributes:
        ends: (N, 2, 2) ends of short lines [pixels].
        colors: (N, 3), 0 to 255.
        width: (N,) [pixels].
        opacity: (N,) 0 to 1.
        rim: (N,) opacity of the dark rim, 0 to 1.
    """

    ends: Array
    colors: Array
    width: Array
    opacity: Array
    rim: Array


def blend_lines(image: Bytes, line_sets: Sequence[LineSet]) -> None:
    """Draws lines into an image (H, W, 3), in place; each pixel takes the nearest line."""
    rim_width = 1.2  # Pixels. Dark rim on both sides of a line, for contrast with white paper.
    ends, colors, width, opacity, rim = (
        np.concatenate([getattr(line_set, field.name) for line_set in line_sets])
        for field in fields(LineSet)
    )
    kept = width > 0.0
    ends, colors, width = ends[kept], colors[kept], width[kept]
    if not len(ends):
        return
    pixels = rasterize_lines(ends, 0.5 * width, rim_width + 0.5, (image.shape[1], image.shape[0]))
    flat = image.reshape(-1, 3)
    dark = rim[kept][pixels.line] * pixels.cover(rim_width)
    under = np.take(flat, pixels.at, axis=0) * (1.0 - dark[:, None])
    core = (opacity[kept][pixels.line] * pixels.cover())[:, None]
    flat[pixels.at] = np.round(under + core * (colors[pixels.line] - under)).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class LinePixels:
    """Pixels near lines.

    Attributes:
        at: (P,) indices into the flattened image.
        distance: (P,) distance to the line's rim, negative inside the line [pixels].
        line: (P,) index of the nearest line.
    """

    at: Indices
    distance: Array
    line: Indices

    def cover(self, wider: float = 0.0) -> Array:
        """(P,) coverage of each pixel by the line, widened by `wider` on both sides."""
        return np.clip(0.5 + wider - self.distance, 0.0, 1.0)


def rasterize_lines(
    ends: Array, half_width: Array, reach: float, size: tuple[int, int]
) -> LinePixels:
    """Finds the pixels near lines.

    Args:
        ends: (N, 2, 2) ends of the lines [pixels], short ones.
        half_width: (N,) [pixels].
        reach: largest distance of the pixels from a line's rim [pixels].
        size: width and height of the image [pixels].
    """
    steps_per_pixel = 1 << 10  # Resolution of the distances.
    unreached = np.iinfo(np.int64).max  # Value of pixels without a line.
    width, height = size
    nearest = np.full(width * height, unreached)
    if len(ends):
        at, distance, line = _pixels_near_lines(ends, half_width + reach, size)
        shifted = distance - half_width[line] + float(half_width.max())  # at least 0
        np.minimum.at(nearest, at, (shifted * steps_per_pixel).astype(np.int64) * len(ends) + line)
    at = np.flatnonzero(nearest != unreached)
    steps, line = np.divmod(nearest[at], max(len(ends), 1))
    return LinePixels(at, (steps + 0.5) / steps_per_pixel - half_width.max(initial=0.0), line)


def _pixels_near_lines(
    ends: Array, limit: Array, size: tuple[int, int]
) -> tuple[Indices, Array, Indices]:
    """Pixels within each line's limit: their indices, distances and lines."""
    width, height = size
    center = np.round(ends.mean(axis=1)).astype(np.int64)
    half = 0.5 * float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max())
    around = int(half + float(limit.max()) + 0.5)
    offset = np.arange(-around, around + 1)
    # Coordinates about the lines' middles, for which single precision suffices.
    (ax, ay), (bx, by) = (ends - center[:, None]).astype(np.float32).transpose(1, 2, 0)
    ex, ey = bx - ax, by - ay
    square = np.maximum(ex * ex + ey * ey, np.float32(1e-12))
    x = offset.astype(np.float32) - ax[:, None]
    y = offset.astype(np.float32) - ay[:, None]
    along = (x * (ex / square)[:, None])[:, None, :] + (y * (ey / square)[:, None])[:, :, None]
    np.clip(along, 0.0, 1.0, out=along)
    dx = x[:, None, :] - along * ex[:, None, None]
    dy = y[:, :, None] - np.multiply(along, ey[:, None, None], out=along)
    square_distance = np.multiply(dx, dx, out=dx)
    square_distance += np.multiply(dy, dy, out=dy)
    close = square_distance < (limit * limit).astype(np.float32)[:, None, None]
    columns, rows = center[:, :1] + offset, center[:, 1:] + offset
    close &= ((columns >= 0) & (columns < width))[:, None, :]
    close &= ((rows >= 0) & (rows < height))[:, :, None]
    found = np.flatnonzero(close)
    line, place = np.divmod(found, len(offset) ** 2)
    shift = (offset[:, None] * width + offset).ravel()
    at = (center[:, 1] * width + center[:, 0])[line] + shift[place]
    return at, np.sqrt(square_distance.ravel()[found]), line
