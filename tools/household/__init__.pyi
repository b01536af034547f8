from . import household_shapes as household_shapes
from .airplane import make_airplane as make_airplane
from .banana import make_banana as make_banana
from .bottle import make_bottle as make_bottle
from .bowl import make_bowl as make_bowl
from .box import make_box as make_box
from .can import make_can as make_can
from .colours import (
    BLUE as BLUE,
    BRICK as BRICK,
    BROWN as BROWN,
    CHARCOAL as CHARCOAL,
    GLASS as GLASS,
    IVORY as IVORY,
    OCHRE as OCHRE,
    ORANGE as ORANGE,
    PLUM as PLUM,
    SAGE as SAGE,
    STEEL as STEEL,
    TEAL as TEAL,
    YELLOW as YELLOW,
    Rgba as Rgba,
    as_bytes as as_bytes,
    painted as painted,
)
from .curves import (
    Array as Array,
    angles as angles,
    ellipse as ellipse,
    equal_area_factor as equal_area_factor,
    resampled as resampled,
    rounded as rounded,
    rounded_rectangle as rounded_rectangle,
    smooth as smooth,
)
from .marble import make_marble as make_marble
from .mug import make_mug as make_mug
from .rest import laid_down as laid_down
from .scissors import make_scissors as make_scissors
from .screwdriver import make_screwdriver as make_screwdriver
from .shape import Shape as Shape
from .solids import (
    canonical as canonical,
    circles as circles,
    ellipses as ellipses,
    hull as hull,
    hulls as hulls,
    moved as moved,
    rings_along as rings_along,
    sectors as sectors,
    tube as tube,
    union as union,
    widened as widened,
)
