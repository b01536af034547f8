from . import page_frame as page_frame
from .board_printout import (
    Printout as Printout,
    PrintSettings as PrintSettings,
    print_board as print_board,
)
from .outlines import cell_outlines as cell_outlines
from .paper import (
    PAPERS as PAPERS,
    Paper as Paper,
    orientations as orientations,
)
from .pen import (
    BLACK as BLACK,
    BOLD as BOLD,
    INK as INK,
    POINT as POINT,
    Pen as Pen,
    rectangle as rectangle,
)
from .relief import (
    HeightMap as HeightMap,
    height_map as height_map,
)
from .sheet import frame_width as frame_width
from .tiling import (
    Tile as Tile,
    Tiling as Tiling,
)
