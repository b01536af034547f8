from .aligner import (
    Aligner as Aligner,
    Alignment as Alignment,
    differ as differ,
)
from .background import empty_board as empty_board
from .depth_aligner import (
    DepthAligner as DepthAligner,
    check_depth as check_depth,
)
from .pinhole import (
    PinholeView as PinholeView,
    sample_nearest as sample_nearest,
    window_slices as window_slices,
)
from .shape import (
    TargetShape as TargetShape,
    target_shapes as target_shapes,
)
from .silhouette_aligner import SilhouetteAligner as SilhouetteAligner
from .window import Window as Window
