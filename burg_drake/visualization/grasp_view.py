"""Grasps in Meshcat and in drawings: groups of one colour, glyphs as one mesh, and their legend."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Meshcat

from burg_drake.core import (
    CATEGORY_COLORS,
    DIMENSIONLESS,
    TEXT_UNIT,
    Array,
    GraspSet,
    InvalidInputError,
    Outcome,
    Rgba,
    count_with_noun,
    describe_column,
    transform_points,
)
from burg_drake.visualization.colors import (
    COLOR_BINS,
    OTHERS_COLOR,
    OUTCOME_GROUPS,
    UNJUDGED_GROUP,
    UNKNOWN_COLOR,
    ColorScale,
    color_scale,
    hex_color,
    outcome_group,
)
from burg_drake.visualization.legend import ColorBar, LegendEntry
from burg_drake.visualization.meshcat_drawing import draw_flat_triangles
from burg_drake.visualization.object_drawing import FlatView, path_data


@dataclass(frozen=True, eq=False)
class GraspGroup:
    """Grasps that are drawn as one mesh.

    Attributes:
        key: unique key of the group; part of its path in Meshcat.
        label: label in legends; groups with the same label share a line.
        rgba: colour.
        members: (M,) indices of the grasps.
    """

    key: str
    label: str
    rgba: Rgba
    members: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class NumberGroups:
    """Grasps grouped by a number.

    Attributes:
        scale: colour scale of the numbers.
        bins: (N,) bin of each grasp; -1 for an unknown number.
        outside: counts of numbers below and above the scale.
        groups: groups of the bins that are not empty, lowest first, then of unknown numbers.
    """

    scale: ColorScale
    bins: NDArray[np.int64]
    outside: tuple[int, int]
    groups: tuple[GraspGroup, ...]

    @property
    def counts(self) -> NDArray[np.int64]:
        """(BINS,) number of grasps in each bin."""
        return np.bincount(self.bins[self.bins >= 0], minlength=COLOR_BINS)


def group_by_number(values: ArrayLike, limits: tuple[float, float] | None = None) -> NumberGroups:
    """Groups grasps by numbers.

    Args:
        values: (N,) numbers; NaN if unknown.
        limits: ends of the colour scale; from the values if None.

    Raises:
        InvalidInputError: the limits do not rise.
    """
    numbers = np.asarray(values, dtype=float)
    scale = color_scale(numbers, limits)
    bins = scale.bins(numbers)
    colors = scale.colors()
    groups = [
        GraspGroup(bin_key(k), "", (*colors[k].tolist(), 1.0), np.flatnonzero(bins == k))
        for k in np.unique(bins[bins >= 0]).tolist()
    ]
    if (bins < 0).any():
        groups.append(GraspGroup("unknown", "not known", UNKNOWN_COLOR, np.flatnonzero(bins < 0)))
    return NumberGroups(scale, bins, scale.count_outside(numbers), tuple(groups))


def bin_key(bin: int) -> str:
    """The key of a bin's group."""
    return f"{bin:02d}"


def group_by_name(names: Sequence[str]) -> tuple[GraspGroup, ...]:
    """Groups grasps by names (N,), the most frequent first; an empty name is unknown.

    If all names are outcomes, they get the colours of outcomes.
    """
    texts = np.asarray(names, dtype=str)
    counts = Counter(texts[texts != ""].tolist())
    if counts and set(counts) <= {outcome.value for outcome in Outcome}:
        return group_by_outcome([Outcome(text) if text else None for text in texts.tolist()])
    ranked = sorted(counts, key=lambda name: (-counts[name], name))
    own = ranked[: len(CATEGORY_COLORS)]
    groups = [
        GraspGroup(f"name_{k}", name, rgba, np.flatnonzero(texts == name))
        for k, (name, rgba) in enumerate(zip(own, CATEGORY_COLORS, strict=False))
    ]
    rest = ranked[len(own) :]
    if rest:
        label = count_with_noun(len(rest), "other")
        groups.append(
            GraspGroup("others", label, OTHERS_COLOR, np.flatnonzero(np.isin(texts, rest)))
        )
    if (texts == "").any():
        groups.append(
            GraspGroup("unknown", "not known", UNKNOWN_COLOR, np.flatnonzero(texts == ""))
        )
    return tuple(groups)


def group_by_outcome(outcomes: Sequence[Outcome | None]) -> tuple[GraspGroup, ...]:
    """Groups grasps by outcomes (N,), best first; None for grasps that were not judged."""
    index: dict[Outcome | None, list[int]] = {}
    for i, outcome in enumerate(outcomes):
        index.setdefault(outcome, []).append(i)
    order = [outcome for group in OUTCOME_GROUPS for outcome in group.outcomes]
    return tuple(
        GraspGroup(
            outcome or "not_judged",
            outcome_group(outcome).name,
            outcome_group(outcome).rgba,
            np.array(index[outcome], dtype=np.int64),
        )
        for outcome in (*order, None)
        if outcome in index
    )


def single_group(count: int) -> tuple[GraspGroup, ...]:
    """All grasps in one group."""
    return (GraspGroup("all", "grasps", UNJUDGED_GROUP.rgba, np.arange(count)),) if count else ()


FINGER_LENGTH = 0.045
"""Length of a glyph's fingers, from its palm to the origin of the grasp frame, in metres."""
STEM_LENGTH = 0.03
"""Length of the stem behind a glyph's palm, in metres."""
BAR_RADIUS = 0.0013
"""Circumradius of a glyph's three-sided bars, in metres."""

GRASPS_PATH = "/drake/grasps"


def draw_grasps(
    meshcat: Meshcat, X_WG: ArrayLike, width: ArrayLike, groups: Iterable[GraspGroup]
) -> None:
    """Draws grasps in groups of one colour each; replaces the grasps drawn before.

    Args:
        meshcat: Meshcat to draw in, below `/drake/grasps`, one path per group.
        X_WG: (N, 4, 4) grasps in the world.
        width: (N,) distance between the pads [m]; finite.
        groups: groups of grasps; grasps without a group are not drawn.

    Raises:
        InvalidInputError: the lengths differ, or a width is unknown.
    """
    faint_radius = 0.0008  # Metres.
    poses = np.asarray(X_WG, dtype=float).reshape(-1, 4, 4)
    widths = np.asarray(width, dtype=float)
    if widths.shape != (len(poses),) or not np.isfinite(widths).all():
        known = np.count_nonzero(np.isfinite(widths))
        raise InvalidInputError(f"{known} known widths for {len(poses)} grasps; give one each")
    meshcat.Delete(GRASPS_PATH)
    for group in groups:
        radius = BAR_RADIUS if group.rgba[3] == 1.0 else faint_radius
        vertices, faces = grasp_triangles(poses[group.members], widths[group.members], radius)
        draw_flat_triangles(meshcat, grasp_path(group.key), vertices, faces, group.rgba)


def grasp_path(key: str) -> str:
    """Meshcat path of the group of grasps with a key."""
    return f"{GRASPS_PATH}/{key}"


def grasp_triangles(
    X_WG: Array, width: Array, radius: float = BAR_RADIUS
) -> tuple[Array, NDArray[np.int32]]:
    """Glyphs of many grasps as one mesh.

    Args:
        X_WG: (N, 4, 4) grasps.
        width: (N,) distance between the fingers [m].
        radius: radius of the bars [m].

    Returns:
        Vertices (3, V) in the world [m] and triangles (3, F).
    """
    corners = _glyph_corners(width)
    start, end = corners[:, [0, 3, 1, 4]], corners[:, [1, 2, 2, 5]]
    vertices, faces = _bar_triangles(start.reshape(-1, 3), end.reshape(-1, 3), radius)
    p_WV = transform_points(X_WG, vertices.reshape(len(X_WG), -1, 3))
    return np.asfortranarray(p_WV.reshape(-1, 3).T), np.asfortranarray(faces.T)


def _bar_triangles(start: Array, end: Array, radius: float) -> tuple[Array, NDArray[np.int32]]:
    """Three-sided bars (M, 6, 3) between points (M, 3) of planes y = const, and triangles."""
    along = end - start
    along = along / np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-12)
    u = np.broadcast_to([0.0, 1.0, 0.0], along.shape)
    v = np.cross(along, u)
    angle = 2 * np.pi * np.arange(3) / 3
    ring = radius * (
        np.cos(angle)[:, None] * u[:, None, :] + np.sin(angle)[:, None] * v[:, None, :]
    )
    vertices = np.concatenate([start[:, None] + ring, end[:, None] + ring], axis=1)
    sides = [(i, (i + 1) % 3, 3 + i) for i in range(3)]
    sides += [((i + 1) % 3, 3 + (i + 1) % 3, 3 + i) for i in range(3)]
    template = np.array([*sides, (0, 2, 1), (3, 4, 5)], dtype=np.int32)
    first = 6 * np.arange(len(start), dtype=np.int32)
    return vertices, (first[:, None, None] + template).reshape(-1, 3)


def color_grasps_by(
    grasps: GraspSet, column: str | None = None, limits: Sequence[float] | None = None
) -> tuple[tuple[GraspGroup, ...], list[ColorBar | LegendEntry]]:
    """Groups grasps by colour, with a legend.

    Args:
        grasps: (N,) grasps.
        column: column of the set; None for the outcome, or else the score, if there is one.
        limits: lower and upper end of the colour scale; from the numbers if None.

    Returns:
        The grasps in groups of one colour each, and the legend.

    Raises:
        UnknownNameError: there is no such column; the message names the nearest.
        InvalidInputError: the limits do not rise, or are given for a column of names.
    """
    name = column or default_color_column(grasps)
    values = None if name is None else grasps.column(name)
    if name is not None and values is not None and values.dtype.kind in "fiu":
        numbers = group_by_number(values, None if limits is None else (limits[0], limits[1]))
        return numbers.groups, number_legend(column_title(name), numbers)
    if limits is not None:
        what = "all grasps have one colour" if name is None else f"column {name!r} has names"
        raise InvalidInputError(f"a range of colours is for numbers; {what}")
    if values is None:
        groups = single_group(len(grasps))
    else:
        truths = values.dtype.kind == "b"
        groups = group_by_name((np.where(values, "yes", "no") if truths else values).tolist())
    return groups, [*grasp_group_entries(groups)]


def default_color_column(grasps: GraspSet) -> str | None:
    """Default column to colour grasps by; None if there is no such column."""
    if "outcome" in grasps.columns:
        return "outcome"
    return "score" if np.isfinite(grasps.score).any() else None


def column_title(name: str) -> str:
    """Readable name of a column, with its unit if known."""
    column = describe_column(name)
    if column is None or column.unit in (TEXT_UNIT, DIMENSIONLESS):
        return name
    return f"{name} [{column.unit.replace('m2', 'm²')}]"


def grasp_group_entries(groups: Iterable[GraspGroup]) -> list[LegendEntry]:
    """A legend switch for each label, with the number of grasps."""
    by_label: dict[str, list[GraspGroup]] = {}
    for group in groups:
        by_label.setdefault(group.label, []).append(group)
    return [
        LegendEntry(
            f"{label} ({sum(len(g.members) for g in members)})",
            hex_color(members[0].rgba[:3]),
            tuple(grasp_path(g.key) for g in members),
        )
        for label, members in by_label.items()
    ]


def number_legend(title: str, grouped: NumberGroups) -> list[ColorBar | LegendEntry]:
    """Colour bar of a number, and a switch for grasps with an unknown number.

    Args:
        title: name of the number.
        grouped: the grasps, grouped by the number.
    """
    below, above = grouped.outside
    notes = [f"{count} {side} the range" for count, side in ((below, "below"), (above, "above"))]
    bar = ColorBar(
        title=title,
        colors=tuple(hex_color(color) for color in grouped.scale.colors()),
        counts=tuple(int(count) for count in grouped.counts),
        ticks=_bar_ticks(grouped.scale, grouped.outside),
        paths=tuple(grasp_path(bin_key(k)) for k in range(COLOR_BINS)),
        note=", ".join(n for n, count in zip(notes, grouped.outside, strict=True) if count),
    )
    return [bar, *grasp_group_entries(g for g in grouped.groups if g.key == "unknown")]


def _bar_ticks(scale: ColorScale, outside: tuple[int, int]) -> tuple[tuple[float, str], ...]:
    """Ticks of a bar: both ends, and round numbers between them."""
    min_distance = 0.08  # From the bar's ends, as a share of it.
    span = scale.upper - scale.lower
    inner = [(t, (t - scale.lower) / span) for t in scale.ticks()]
    ticks = [
        (place, _tick_text(t, span))
        for t, place in inner
        if min_distance < place < 1 - min_distance
    ]
    ends = [_tick_text(scale.lower, span), _tick_text(scale.upper, span)]
    if outside[0]:
        ends[0] = f"≤ {ends[0]}"
    if outside[1]:
        ends[1] = f"≥ {ends[1]}"
    return ((0.0, ends[0]), *ticks, (1.0, ends[1]))


def _tick_text(value: float, span: float) -> str:
    """A number with enough digits to distinguish ticks of a bar of length `span`."""
    if abs(value) < 1e-9 * span:
        return "0"
    digits = max(4, int(np.ceil(np.log10(abs(value) / span))) + 2)
    return f"{value:.{min(digits, 15)}g}"


def grasp_corners(X_WG: Array, width: Array) -> Array:
    """(N, 6, 3) corners of grasp glyphs in the world [m]: tip, knuckle, knuckle and tip of the
    fingers, then both ends of the stem.

    Args:
        X_WG: (N, 4, 4) grasps.
        width: (N,) distance between the fingers [m].
    """
    return transform_points(np.asarray(X_WG).reshape(-1, 4, 4), _glyph_corners(width))


def _glyph_corners(width: Array) -> Array:
    """The corners of `grasp_corners` in the grasp frame G."""
    half = np.asarray(width, dtype=float)[:, None] / 2.0
    x = half * np.array([1.0, 1.0, -1.0, -1.0, 0.0, 0.0])
    palm, stem = -FINGER_LENGTH, -FINGER_LENGTH - STEM_LENGTH
    z = np.broadcast_to([0.0, palm, palm, 0.0, palm, stem], x.shape)
    return np.stack([x, np.zeros_like(x), z], axis=-1)


def grasp_strokes(corners: Array, view: FlatView) -> list[str]:
    """SVG path data `d` of each grasp, from `grasp_corners` (N, 6, 3)."""
    return [
        path_data(fork, closed=False) + path_data(stem, closed=False)
        for fork, stem in ((places[:4], places[4:]) for places in view.project(corners))
    ]
