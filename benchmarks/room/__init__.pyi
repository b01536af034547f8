from .covers import (
    Cover as Cover,
    hand as hand,
    nothing as nothing,
    shadow_below as shadow_below,
    things as things,
)
from .exposure import (
    PAPER as PAPER,
    SIDE as SIDE,
    Gloss as Gloss,
    Surface as Surface,
    no_gloss as no_gloss,
    radiance as radiance,
    table as table,
)
from .lens import Camera as Camera, corner_directions as corner_directions
from .light import (
    AROUND as AROUND,
    GRID as GRID,
    Light as Light,
    Map as Map,
    Shadow as Shadow,
    grid as grid,
    irradiance as irradiance,
    lamp_light as lamp_light,
    map_of as map_of,
)
from .objects import (
    Objects as Objects,
    Thing as Thing,
    arranged as arranged,
    household as household,
    photographed as photographed,
)
from .paper import (
    Array as Array,
    Board as Board,
    Image as Image,
    Page as Page,
    printed as printed,
    read_pages as read_pages,
)
from .rows import BOARD as BOARD, WEBCAM as WEBCAM, sheet as sheet
from .sensor import Sensor as Sensor, image_of as image_of
from .sheet import (
    AS_MEANT as AS_MEANT,
    COPY_SHARE as COPY_SHARE,
    Faults as Faults,
    Relief as Relief,
    Sheet as Sheet,
    Texture as Texture,
    assembled as assembled,
    flat as flat,
    glue as glue,
    with_copy as with_copy,
)
from .views import (
    look_at as look_at,
    moved as moved,
    random_view as random_view,
    seen_at as seen_at,
    shaken as shaken,
)
