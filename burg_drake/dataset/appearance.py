"""Appearance of one scene as plain data, and the ranges that appearances are drawn from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, get_args

from burg_drake.core import (
    MAX_DOCUMENT_SEED,
    FieldError,
    InvalidInputError,
    Pose,
    Ranges,
    Vector3,
    plain_data,
    read_plain_data,
    require_ascending,
    require_ranges,
)

Pattern = Literal["wood", "cloth", "stone", "plain"]


@dataclass(frozen=True, kw_only=True)
class AppearanceSettings:
    """Ranges from which the looks of scenes are drawn.

    Pairs are the smallest and the largest value.

    Attributes:
        lights: number of lights, besides a weak one at the camera; the usual lights if null.
        light_elevation_deg: elevation of the first light above the table [degrees]; the others come
            from anywhere above.
        temperature: colour temperature of the lights [K]; white if null.
        shadows: probability that the first light casts shadows, which doubles the rendering time.
        room: probability that a room is seen behind the table instead of an even grey.
        room_light: probability that the room, if there is one, lights the scene from all around.
        table: patterns of the table, each with the same probability; its own colour if empty.
        board: probability that the printed board is seen.
        exposure: exposure of the image [stops]; 0 if null.
        white_balance: largest deviation of the gains of red and blue from 1.
        gamma: exponent of the image; 1 if null.
        blur: standard deviation of blur [pixels]; none if null.
        electrons: electrons that a white pixel collects; fewer give more noise, null gives none.
        color_gain: largest change of the channels of each object's colour, as a share.
        distractors: number of other things on the table, without labels; fewer if there is no room.
        distractor_library: object library of these things: a folder, or the name of a built-in one.
        distractors_on_board: whether these things may stand on the board.

    Raises:
        FieldError: a value is out of its range, or a range falls.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    RANGES: ClassVar[Ranges] = {
        "shadows": (0.0, 1.0),
        "room": (0.0, 1.0),
        "room_light": (0.0, 1.0),
        "board": (0.0, 1.0),
        "white_balance": (0.0, 0.5),
        "color_gain": (0.0, 0.9),
        "lights": (1, 4),
        "light_elevation_deg": (5.0, 90.0),
        "temperature": (1000.0, 20_000.0),
        "exposure": (-5.0, 5.0),
        "gamma": (0.2, 5.0),
        "blur": (0.0, 20.0),
        "electrons": (50.0, 1e6),
        "distractors": (0, 50),
    }

    lights: tuple[int, int] | None = (1, 3)
    light_elevation_deg: tuple[float, float] = (35.0, 85.0)
    temperature: tuple[float, float] | None = (3200.0, 7500.0)
    shadows: float = 0.5
    room: float = 0.9
    room_light: float = 0.3
    table: tuple[Pattern, ...] = get_args(Pattern)
    board: float = 0.5
    exposure: tuple[float, float] | None = (-0.7, 0.3)
    white_balance: float = 0.06
    gamma: tuple[float, float] | None = (0.9, 1.1)
    blur: tuple[float, float] | None = (0.0, 0.8)
    electrons: tuple[float, float] | None = (1500.0, 20_000.0)
    color_gain: float = 0.1
    distractors: tuple[int, int] = (0, 4)
    distractor_library: str = "clutter"
    distractors_on_board: bool = False

    def __post_init__(self) -> None:
        require_ranges(self)
        require_ascending(self)


WHITE_LIGHT: Vector3 = (1.0, 1.0, 1.0)  # Red, green and blue of white light.
MAX_GAIN = 1e4
"""Maximum irradiance, gain or component of a colour; with 1 a white surface is white."""


def _require_gains(values: Vector3, name: str) -> None:
    if not all(0.0 <= value <= MAX_GAIN for value in values):
        raise FieldError(f"{name} is {list(values)}; each must be from 0 to {MAX_GAIN:g}", name)


def _require_seed(seed: int | None, name: str) -> None:
    if seed is not None and not 0 <= seed <= MAX_DOCUMENT_SEED:
        raise FieldError(f"{name} is {seed}; give a seed from 0 to {MAX_DOCUMENT_SEED}", name)


@dataclass(frozen=True, kw_only=True)
class DirectedLight:
    """A directional light.

    Attributes:
        direction: direction in which the light shines.
        frame: frame of the direction: the world, or the camera, with which the light moves.
        irradiance: irradiance of a surface that faces the light; 1 makes a white surface white in
            the image.
        color: linear red, green, blue.
        shadows: whether it casts shadows in Drake's renderer; in Blender lights in the world do.
    """

    RANGES: ClassVar[Ranges] = {"irradiance": (0.0, MAX_GAIN)}

    direction: Vector3
    frame: Literal["world", "camera"] = "world"
    irradiance: float
    color: Vector3 = WHITE_LIGHT
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
        pattern: kind of pattern.
        seed: seed of the pattern.
    """

    pattern: Pattern
    seed: int

    def __post_init__(self) -> None:
        _require_seed(self.seed, "seed")


@dataclass(frozen=True, kw_only=True)
class Photometry:
    """Response of a camera to light.

    Attributes:
        exposure: exposure [stops].
        white_balance: linear gains of red, green, blue.
        gamma: residual gamma: light is raised to the power of 1 / gamma.
        blur: standard deviation of the blur [pixels].
        electrons: electrons of a white pixel, for shot noise; no noise if None.
    """

    RANGES: ClassVar[Ranges] = {
        "exposure": (-20.0, 20.0),
        "gamma": (0.05, 20.0),
        "blur": (0.0, 100.0),
        "electrons": (1.0, 1e12),
    }
    """Allowed values of a camera, far beyond the ranges of `AppearanceSettings`."""

    exposure: float = 0.0
    white_balance: Vector3 = WHITE_LIGHT
    gamma: float = 1.0
    blur: float = 0.0
    electrons: float | None = None

    def __post_init__(self) -> None:
        require_ranges(self)
        _require_gains(self.white_balance, "white_balance")


@dataclass(frozen=True, kw_only=True)
class Distractor:
    """An unlabelled object on the table.

    Attributes:
        object: name in the library of distractors.
        X_SO: pose in the scene frame.
    """

    object: str
    X_SO: Pose


@dataclass(frozen=True, kw_only=True)
class Appearance:
    """Appearance of a scene. The default is that of simulated cameras.

    Attributes:
        lights: lights; the default lights if empty.
        room: seed of the room behind the table; a uniform grey if None.
        room_light: irradiance of the table by the room's environment map; not lit by it if 0.
        table: pattern of the table; its own colour if None.
        board: whether the printed board is visible.
        photometry: camera response.
        object_gains: linear gains of red, green and blue of each instance, in the order of labels;
            no change if empty.
        library: library of the distractors: a built-in name, or a folder.
        distractors: unlabelled objects on the table.
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
        """The appearance as dicts, lists, numbers and strings, for `read_appearance`."""
        found: dict[str, Any] = plain_data(self)
        return found


def read_appearance(data: Mapping[str, Any], name: str = "appearance") -> Appearance:
    """Reads an appearance from plain data.

    Args:
        data: data that `Appearance.plain` returned.
        name: source of the data, for messages.

    Raises:
        DocumentError: the data are invalid; the message names the key.
    """
    return read_plain_data(data, Appearance, name)
