"""Colours of the setup page: what is well, what collides, what leaves the board."""

from __future__ import annotations

from dataclasses import dataclass

Rgb8 = tuple[int, int, int]


@dataclass(frozen=True)
class StatusStyle:
    """How a status of an instance is shown.

    Attributes:
        color: red, green, blue as bytes.
        words: for people.
    """

    color: Rgb8
    words: str

    @property
    def hex(self) -> str:
        """The colour as HTML has it."""
        return hex_color(self.color)


STATUS_STYLES: dict[str, StatusStyle] = {
    "ok": StatusStyle((46, 160, 67), "ok"),
    "collision": StatusStyle((214, 40, 40), "in collision"),
    "out_of_bounds": StatusStyle((236, 90, 180), "out of bounds"),
    "in_ground": StatusStyle((140, 80, 30), "in the ground"),
    "hovering": StatusStyle((64, 140, 230), "hovering"),
    "sunken": StatusStyle((64, 140, 230), "sunk into the table"),
}
"""By status; green, red and pink as in the tool of the paper (Rudorfer et al., 2022);
blue are warnings."""

OTHER = StatusStyle((120, 120, 120), "not checked")
FIXED: Rgb8 = (150, 155, 162)
"""Of background objects and obstacles."""


def style_of(status: str) -> StatusStyle:
    """How a status is shown."""
    return STATUS_STYLES.get(status, OTHER)


def hex_color(color: Rgb8) -> str:
    """A colour as HTML has it."""
    return "#" + "".join(f"{channel:02x}" for channel in color)
