"""Generator of the default object library: ten household objects made by code.

The meshes are watertight, in metres and z up; hollow things are hollow, and the convex pieces
for contact are made together with the shape. Run `python -m tools.household -o models/household`.
"""

from __future__ import annotations

from .airplane import make_airplane
from .banana import make_banana
from .bottle import make_bottle
from .bowl import make_bowl
from .box import make_box
from .can import make_can
from .marble import make_marble
from .mug import make_mug
from .scissors import make_scissors
from .screwdriver import make_screwdriver
from .shape import Shape as Shape

GENERATORS = (
    make_mug,
    make_bowl,
    make_bottle,
    make_can,
    make_box,
    make_banana,
    make_screwdriver,
    make_scissors,
    make_marble,
    make_airplane,
)


def household_shapes() -> tuple[Shape, ...]:
    """Generate every object of the library, always in the same order."""
    return tuple(make() for make in GENERATORS)
