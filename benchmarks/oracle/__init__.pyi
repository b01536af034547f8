from .arrays import (
    Array as Array,
    inverse as inverse,
    pose as pose,
    rotation as rotation,
    rotation_angle as rotation_angle,
)
from .blocks import blocks as blocks, graded as graded
from .catalogue import (
    HELD_OUT as HELD_OUT,
    SPACING as SPACING,
    TUNED as TUNED,
    Thing as Thing,
    thing as thing,
)
from .compiled import compiled as compiled, unsigned as unsigned
from .foundation import ROWS as ROWS, press_pad as press_pad, press_table as press_table
from .grasps import draw_grasps as draw_grasps
from .hand import (
    DEFAULT_PHASES as DEFAULT_PHASES,
    FINGER_PARTS as FINGER_PARTS,
    GRAVITY as GRAVITY,
    OPEN as OPEN,
    PAD as PAD,
    PAD_CENTER_Z as PAD_CENTER_Z,
    PAD_STIFFNESS as PAD_STIFFNESS,
    PADS as PADS,
    PALM as PALM,
    Phases as Phases,
)
from .lathe import (
    arc as arc,
    bent as bent,
    hexagonal as hexagonal,
    lathe as lathe,
    line as line,
    polyline as polyline,
    stretched as stretched,
)
from .motion import State as State, World as World
from .solid import (
    MassProperties as MassProperties,
    Solid as Solid,
    mass_properties as mass_properties,
)
from .trial import (
    DEFAULT_NUMERICS as DEFAULT_NUMERICS,
    Grip as Grip,
    Numerics as Numerics,
    Trial as Trial,
    Verdict as Verdict,
    first_touch as first_touch,
)
