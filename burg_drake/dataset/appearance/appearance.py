"""How one scene looks: plain data, from which everything else follows."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from burg_drake.core import LARGEST_SEED, FieldError, InvalidInputError
from burg_drake.core.documents import (
    Pose,
    Ranges,
    Vector3,
    parse_document,
    plain_data,
    require_ranges,
)
from burg_drake.dataset.appearance.settings import Pattern

WHITE: Vector3 = (1.0, 1.0, 1.0)
MAX_GAIN = 1e4
"""Maximum irradiance, gain or component of a colour; with 1 a white surface is white."""


def _require_gains(values: Vector3, name: str) -> None:
    if not all(0.0 <= value <= MAX_GAIN for value in values):
        raise FieldError(f"{name} is {list(values)}; each must be from 0 to {MAX_GAIN:g}", name)


def _require_seed(seed: int | None, name: str) -> None:
    if seed is not None and not 0 <= seed <= LARGEST_SEED:
        raise FieldError(f"{name} is {seed}; give a seed from 0 to {LARGEST_SEED}", name)


@dataclass(frozen=True, kw_only=True)
class DirectedLight:
    """A light far away.

    Attributes:
        direction: that it shines in.
        frame: of the direction: the world, or that of the camera, with which the light goes.
        irradiance: of a surface that faces it: with 1, a white one is white in the image.
        color: red, green, blue, linear.
        shadows: whether it casts them with Drake's renderer; with Blender those of the world do.
    """

    RANGES: ClassVar[Ranges] = {"irradiance": (0.0, MAX_GAIN)}

    direction: Vector3
    frame: Literal["world", "camera"] = "world"
    irradiance: float
    color: Vector3 = WHITE
    shadows: bool = False

    def __post_init__(self) -> None:
        _require_gains(self.color, "color")
        if not any(self.direction) or not any(self.color):
            raise InvalidInputError(
                "a light needs a direction and a colour that are not zero; given are direction"
                f" {list(self.direction)} and color {list(self.color)}"
            )
        require_ranges(self)


@dataclass(frozen=True, kw_only=True)
class TableSurface:
    """The pattern on a table.

    Attributes:
        pattern: its kind.
        seed: of all that is random about it.
    """

    pattern: Pattern
    seed: int

    def __post_init__(self) -> None:
        _require_seed(self.seed, "seed")


@dataclass(frozen=True, kw_only=True)
class Photometry:
    """How a camera makes a picture of the light that falls on it.

    Attributes:
        exposure: [stops].
        white_balance: gains of red, green, blue, linear.
        gamma: exponent that is left in the picture: light to the power of 1 / gamma.
        blur: standard deviation [pixels].
        electrons: that a white pixel collects; no noise if None.
    """

    RANGES: ClassVar[Ranges] = {
        "exposure": (-20.0, 20.0),
        "gamma": (0.05, 20.0),
        "blur": (0.0, 100.0),
        "electrons": (1.0, 1e12),
    }
    """Allowed values of a camera, far beyond those that looks are sampled from."""

    exposure: float = 0.0
    white_balance: Vector3 = WHITE
    gamma: float = 1.0
    blur: float = 0.0
    electrons: float | None = None

    def __post_init__(self) -> None:
        require_ranges(self)
        _require_gains(self.white_balance, "white_balance")


@dataclass(frozen=True, kw_only=True)
class Distractor:
    """A thing on the table that has no label.

    Attributes:
        object: name in the library of distractors.
        X_SO: its pose in the scene frame.
    """

    object: str
    X_SO: Pose


@dataclass(frozen=True, kw_only=True)
class Appearance:
    """How a scene looks. Without anything it looks as simulated cameras always see it.

    Attributes:
        lights: the usual ones if there are none.
        room: seed of the room behind the table; an even grey if None.
        room_light: irradiance of the table by the room's picture, as of lights; none if 0.
        table: its pattern; its own colour if None.
        board: whether the printed board is seen.
        photometry: of the image.
        object_gains: of red, green and blue of each instance, linear, in the order of labels;
            nothing is changed if empty.
        library: that distractors are from: a built-in name, or a folder.
        distractors: on the table.
    """

    RANGES: ClassVar[Ranges] = {"room_light": (0.0, MAX_GAIN)}

    version: int = 1
    lights: tuple[DirectedLight, ...] = ()
    room: int | None = None
    room_light: float = 0.0
    table: TableSurface | None = None
    board: bool = True
    photometry: Photometry = Photometry()
    object_gains: tuple[Vector3, ...] = ()
    library: str = "household"
    distractors: tuple[Distractor, ...] = ()

    def __post_init__(self) -> None:
        _require_seed(self.room, "room")
        require_ranges(self)
        if self.room_light and self.room is None:
            raise FieldError(
                f"room_light is {self.room_light:g}, but there is no room; give a room, or"
                " room_light 0",
                "room_light",
            )
        for gains in self.object_gains:
            _require_gains(gains, "object_gains")

    def plain(self) -> dict[str, Any]:
        """As dicts, lists, numbers and texts, for JSON and YAML; `read_appearance` reads it."""
        found: dict[str, Any] = plain_data(self)
        return found


def read_appearance(data: Mapping[str, Any], name: str = "appearance") -> Appearance:
    """An appearance from plain data.

    Args:
        data: as `Appearance.plain` gives it.
        name: stands for the place that it is from in messages.

    Raises:
        DocumentError: it does not fit; the message names the key.
    """
    return parse_document(json.dumps(data), Appearance, name)
