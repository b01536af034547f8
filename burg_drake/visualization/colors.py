"""Colours of outcomes, names and numbers, also for grey print; scales of colour bars."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, InvalidInputError, Outcome, Rgba as Rgba
from burg_drake.visualization.charts import nice_step

VIRIDIS_COLORS = (
    *("#440154", "#481a6c", "#472f7d", "#414487", "#39568c", "#31688e", "#2a788e", "#23888e"),
    *("#1f988b", "#22a884", "#35b779", "#54c568", "#7ad151", "#a5db36", "#d2e21b", "#fde725"),
)
"""Entries 0, 17, 34, ... 255 of viridis (sRGB). Linear interpolation is within 0.03."""


def map_colors(share: ArrayLike) -> Array:
    """Colours of a colour map.

    Args:
        share: (...,) 0 for the lowest and 1 for the highest colour; clipped to this range.

    Returns:
        (..., 3) red, green, blue in [0, 1] (sRGB).
    """
    points = np.array([rgb_from_hex(color) for color in VIRIDIS_COLORS])
    place = np.clip(np.asarray(share, dtype=float), 0.0, 1.0) * (len(points) - 1)
    return np.stack(
        [np.interp(place, np.arange(len(points)), points[:, k]) for k in range(3)], axis=-1
    )


def hex_color(rgb: ArrayLike) -> str:
    """A colour (3,) as HTML has it."""
    return "#" + "".join(f"{round(255.0 * float(c)):02x}" for c in np.asarray(rgb))


def linear_light(color: ArrayLike) -> Array:
    """Linear light of sRGB values (...) in [0, 1] (IEC 61966-2-1)."""
    c = np.asarray(color, dtype=float)
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def contrast_ratio(one: str, other: str) -> float:
    """Contrast of two colours as HTML has them, 1 to 21 (WCAG 2: text needs 4.5)."""
    dark, light = sorted(
        float(linear_light(rgb_from_hex(color)) @ (0.2126, 0.7152, 0.0722))
        for color in (one, other)
    )
    return (light + 0.05) / (dark + 0.05)


def rgb_from_hex(color: str) -> tuple[float, float, float]:
    """Red, green and blue in [0, 1] of a colour as HTML has it."""
    r, g, b = (int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return r, g, b


COLOR_BINS = 32
"""Colours of a bar: steps of 2.5 in lightness, about the smallest that one can distinguish."""


@dataclass(frozen=True)
class ColorScale:
    """A range of numbers, divided into bins of one colour each.

    Attributes:
        lower, upper: lower end of the first bin and upper end of the last one.
    """

    lower: float
    upper: float

    def bins(self, values: ArrayLike) -> NDArray[np.int64]:
        """The bin (N,), 0 to `COLOR_BINS` - 1, of values (N,); -1 of NaN.

        Values outside the range, infinite ones included, are in the outermost bins.
        """
        numbers = np.asarray(values, dtype=float)
        known = ~np.isnan(numbers)
        share = (np.clip(numbers, self.lower, self.upper) - self.lower) / (self.upper - self.lower)
        index = np.minimum(
            (np.where(known, share, 0.0) * COLOR_BINS).astype(np.int64), COLOR_BINS - 1
        )
        return np.where(known, index, -1)

    def count_outside(self, values: ArrayLike) -> tuple[int, int]:
        """How many values (N,) are below and above the range."""
        numbers = np.asarray(values, dtype=float)
        return int((numbers < self.lower).sum()), int((numbers > self.upper).sum())

    def colors(self) -> Array:
        """(BINS, 3) colours of the bins."""
        return map_colors((np.arange(COLOR_BINS) + 0.5) / COLOR_BINS)

    def ticks(self) -> tuple[float, ...]:
        """Round numbers in the range, rising."""
        step = _axis_step(self.upper - self.lower)
        slack = 1e-9 * step
        first, last = np.ceil((self.lower - slack) / step), np.floor((self.upper + slack) / step)
        return tuple(float(k) * step for k in np.arange(first, last + 1.0))


def color_scale(values: ArrayLike, limits: tuple[float, float] | None = None) -> ColorScale:
    """Colour scale for values, without outliers, with round numbers as ends.

    Args:
        values: (N,), NaN and infinite values allowed.
        limits: lower and upper end of the scale; from the values if None.

    Raises:
        InvalidInputError: the limits do not rise, or are not finite.
    """
    max_number = 1e100  # Larger numbers count as infinite.
    min_span = 1e-300  # Minimum length of the range.
    if limits is not None:
        if not min_span < limits[1] - limits[0] < max_number:
            raise InvalidInputError(
                f"the range {limits[0]:g} to {limits[1]:g} does not rise from one finite number"
                " to another"
            )
        return ColorScale(*limits)
    numbers = np.asarray(values, dtype=float)
    numbers = numbers[np.abs(numbers) < max_number]
    if not len(numbers):
        return ColorScale(0.0, 1.0)
    lower, upper = range_without_outliers(numbers)
    # of a single value, the middle of the scale
    if not upper - lower > max(min_span, 1e-9 * max(abs(lower), abs(upper))):
        half = 0.5 * abs(lower) or 0.5
        return ColorScale(lower - half, upper + half)
    step = _axis_step(upper - lower)
    return ColorScale(
        float(np.floor(lower / step + 1e-9)) * step, float(np.ceil(upper / step - 1e-9)) * step
    )


def range_without_outliers(numbers: Array) -> tuple[float, float]:
    """Ends of the range of numbers (N,), N > 0: the extremes, or quantiles if those are far."""
    quantiles = (0.02, 0.98)  # The scale always includes the values between them.
    reach_share = 0.25  # Extremes that are this close to the quantiles are included.
    lower, upper = (float(q) for q in np.quantile(numbers, quantiles))
    reach = reach_share * (upper - lower)
    least, most = float(numbers.min()), float(numbers.max())
    if not upper > lower:  # nearly all values are equal; show the range of the others
        return least, most
    return (
        least if lower - least <= reach else lower,
        most if most - upper <= reach else upper,
    )


def _axis_step(span: float) -> float:
    """Smallest of 1, 2, 5, 10, 20 ... that divides a span into at most six parts."""
    return nice_step(span / (6 * 1.001))


@dataclass(frozen=True)
class OutcomeGroup:
    """Outcomes that share a colour.

    Attributes:
        name: name for legends.
        rgba: colour; grasps that ended early are fainter, as they are many.
        outcomes: the members.
    """

    name: str
    rgba: Rgba
    outcomes: tuple[Outcome, ...]

    @property
    def hex(self) -> str:
        """The colour as HTML has it, without its opacity."""
        return hex_color(self.rgba[:3])


OUTCOME_GROUPS = (
    OutcomeGroup("lifted", (0.0, 0.62, 0.45, 1.0), (Outcome.LIFTED,)),
    OutcomeGroup("lifted, others disturbed", (0.94, 0.89, 0.26, 1.0), (Outcome.LIFTED_DISTURBED,)),
    OutcomeGroup("held, turned in the hand", (0.84, 0.37, 0.0, 1.0), (Outcome.LIFTED_TURNED,)),
    OutcomeGroup(
        "lost during lift or hold",
        (0.90, 0.62, 0.0, 1.0),
        (Outcome.SLIPPED, Outcome.BLOCKED, Outcome.DROPPED),
    ),
    OutcomeGroup(
        "never held",
        (0.80, 0.47, 0.65, 1.0),
        (Outcome.NO_CONTACT, Outcome.ONE_FINGER, Outcome.CLOSED_EMPTY),
    ),
    OutcomeGroup("reachable, not tried", (0.60, 0.87, 0.62, 1.0), (Outcome.REACHABLE,)),
    OutcomeGroup(
        "arm has no path",
        (0.10, 0.20, 0.45, 0.6),
        (Outcome.APPROACH_LINE, Outcome.RETREAT_LINE, Outcome.LIFT_LINE, Outcome.NO_PATH),
    ),
    OutcomeGroup(
        "arm cannot reach",
        (0.0, 0.45, 0.70, 0.6),
        (Outcome.NO_IK, Outcome.JOINT_LIMIT, Outcome.ARM_COLLISION),
    ),
    OutcomeGroup(
        "hand collides on its path",
        (0.55, 0.32, 0.15, 0.5),
        (
            Outcome.HAND_COLLISION_APPROACH,
            Outcome.HAND_COLLISION_RETREAT,
            Outcome.HAND_COLLISION_LIFT,
        ),
    ),
    OutcomeGroup(
        "hand collides",
        (0.45, 0.45, 0.45, 0.4),
        (
            Outcome.COLLISION_TARGET,
            Outcome.COLLISION_TABLE,
            Outcome.COLLISION_CLUTTER,
            Outcome.COLLISION_BACKGROUND,
        ),
    ),
    OutcomeGroup("simulation failed", (0.0, 0.0, 0.0, 1.0), (Outcome.SIMULATION_FAILED,)),
)
"""All groups, best outcome first. Every outcome is in exactly one."""

UNJUDGED_GROUP = OutcomeGroup("not judged", (0.34, 0.71, 0.91, 1.0), ())
"""Group of grasps without an outcome."""
OTHERS_COLOR: Rgba = (0.35, 0.35, 0.35, 0.6)
"""Colour of all names beyond the `CATEGORY_COLORS`."""
UNKNOWN_COLOR: Rgba = (0.62, 0.62, 0.62, 0.6)
"""Colour of missing values."""


def outcome_group(outcome: Outcome | None) -> OutcomeGroup:
    """The group of an outcome; None for a grasp that was not judged."""
    if outcome is None:
        return UNJUDGED_GROUP
    return next((g for g in OUTCOME_GROUPS if outcome in g.outcomes), UNJUDGED_GROUP)
