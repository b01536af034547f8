from .board_printout import (
    Printout as Printout,
    draw_rulers as draw_rulers,
    print_board as print_board,
)
from .object_drawings import (
    BT601_LUMA_WEIGHTS as BT601_LUMA_WEIGHTS,
    FIXED_TINT_COLOR as FIXED_TINT_COLOR,
    MIN_LUMA as MIN_LUMA,
    OUTLINE_RESOLUTION as OUTLINE_RESOLUTION,
    TINT_COLORS as TINT_COLORS,
    HeightMap as HeightMap,
    ObjectDrawing as ObjectDrawing,
    SheetGrid as SheetGrid,
    SheetLayer as SheetLayer,
    cell_outlines as cell_outlines,
    height_at as height_at,
    height_map as height_map,
    lowest_surface as lowest_surface,
    luma_at as luma_at,
    mask_outlines as mask_outlines,
    tint_colors as tint_colors,
    visible_layers as visible_layers,
)
from .page_tiling import (
    BLEED as BLEED,
    MAX_FLAP_WIDTH as MAX_FLAP_WIDTH,
    PAPER_SIZES as PAPER_SIZES,
    Paper as Paper,
    Tile as Tile,
    Tiling as Tiling,
    cut_axis as cut_axis,
    page_orientations as page_orientations,
    paper_size as paper_size,
    tile_board as tile_board,
)
from .print_settings import PrintSettings as PrintSettings
from .sheet import (
    BLACK_RGB as BLACK_RGB,
    BOLD_FONT as BOLD_FONT,
    METRES_PER_POINT as METRES_PER_POINT,
    TEXT_RGB as TEXT_RGB,
    FreeSpace as FreeSpace,
    Pen as Pen,
    Sheet as Sheet,
    draw_sheet as draw_sheet,
    frame_width as frame_width,
    rectangle as rectangle,
)
