"""How much the looks of scenes vary: a part of documents that say how a data set is made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

from burg_drake.core.documents import Ranges, require_ranges, require_rising

Pattern = Literal["wood", "cloth", "stone", "plain"]
PATTERNS: tuple[Pattern, ...] = get_args(Pattern)

MOST_LIGHTS = 4
MOST_DISTRACTORS = 50


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
        "lights": (1, MOST_LIGHTS),
        "light_elevation_deg": (5.0, 90.0),
        "temperature": (1000.0, 20_000.0),
        "exposure": (-5.0, 5.0),
        "gamma": (0.2, 5.0),
        "blur": (0.0, 20.0),
        "electrons": (50.0, 1e6),
        "distractors": (0, MOST_DISTRACTORS),
    }

    lights: tuple[int, int] | None = (1, 3)
    light_elevation_deg: tuple[float, float] = (35.0, 85.0)
    temperature: tuple[float, float] | None = (3200.0, 7500.0)
    shadows: float = 0.5
    room: float = 0.9
    room_light: float = 0.3
    table: tuple[Pattern, ...] = PATTERNS
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
        for name in self.RANGES:
            if isinstance(pair := getattr(self, name), tuple):
                require_rising(pair, name)
