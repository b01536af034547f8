"""Settings of a printed board. Options of the command line read them without the drawing code."""

from __future__ import annotations

from dataclasses import dataclass

from burg_drake.core import InvalidInputError, Units, setting


@dataclass(frozen=True, kw_only=True)
class PrintSettings:
    """How a board is printed.

    Attributes:
        page: name of a paper, or `WxH` in millimetres; see `printout.paper_size`.
        margin: that the printer leaves white on all sides of a page [m].
        measured: what the rulers of 100 mm along x and y of the page measured on paper [m]; all is
            drawn larger by as much as that is too little.
        height_map: draw the objects.
        names: write their names beside them, on every page that shows a part of them.
        instructions: begin with a page that shows how the board is printed, assembled and used.
    """

    page: str = setting(
        "A4", "paper: A4 to A0, letter, legal, tabloid, or WxH in mm", metavar="PAGE"
    )
    margin: float = setting(
        5e-3, "unprintable margin of the printer", unit=Units.millimetres, low=0
    )
    measured: tuple[float, float] = (0.1, 0.1)
    height_map: bool = setting(
        True, "print only markers, not where objects stand", name="no_height_map"
    )
    names: bool = setting(True, "do not print names of objects", name="no_names")
    instructions: bool = False

    def __post_init__(self) -> None:
        # Metres of a printed ruler of 100 mm; otherwise it was read in another unit.
        ruler_range = (0.080, 0.125)
        if not 0.0 <= self.margin <= 0.05:
            raise InvalidInputError(f"margin is {1e3 * self.margin:g} mm; it must be 0 to 50 mm")
        for value in self.measured:
            if not ruler_range[0] <= value <= ruler_range[1]:
                raise InvalidInputError(
                    f"the measured length of the 100 mm ruler is {1e3 * value:g} mm; it must be"
                    f" {1e3 * ruler_range[0]:g} to {1e3 * ruler_range[1]:g} mm"
                )
