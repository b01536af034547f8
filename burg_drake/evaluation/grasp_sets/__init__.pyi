from .candidate_files import (
    GivenGrasps as GivenGrasps,
    MisplacedGraspsError as MisplacedGraspsError,
    NoSceneIdsError as NoSceneIdsError,
    by_names as by_names,
    read_grasps as read_grasps,
)
from .exchange import (
    IN_WORDS as IN_WORDS,
    SeenScene as SeenScene,
    read_in_frame as read_in_frame,
)
from .input import (
    format_name as format_name,
    hand_reference as hand_reference,
    read_input as read_input,
    station_reference as station_reference,
)
from .mistake_search import (
    campaign_hints as campaign_hints,
    find_mistake as find_mistake,
    given_hints as given_hints,
    mistake_notes as mistake_notes,
)
from .near_objects import require_near as require_near
from .pose_mistakes import (
    FileReading as FileReading,
    Mistake as Mistake,
    MistakeFound as MistakeFound,
    correction_of as correction_of,
)
from .provenance import set_documents as set_documents
from .run_set import (
    column_called as column_called,
    run_grasps as run_grasps,
)
from .sampled import sampled_set as sampled_set
from .scored import scored_set as scored_set
