from .balancing import next_round as next_round
from .completeness import require_judged as require_judged
from .many_scenes import evaluate_scenes as evaluate_scenes
from .preparation import (
    extend_run as extend_run,
    finish_run as finish_run,
    open_grasps as open_grasps,
    open_run as open_run,
    require_sound as require_sound,
)
from .request import (
    GraspsLike as GraspsLike,
    Request as Request,
)
from .scene_judging import is_finished as is_finished
