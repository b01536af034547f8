from .candidates import (
    INSTANCE as INSTANCE,
    Candidate as Candidate,
    Candidates as Candidates,
    distinct as distinct,
    given_candidates as given_candidates,
    join_candidates as join_candidates,
    require_instances as require_instances,
)
from .instance_names import (
    InstanceNames as InstanceNames,
    are_of as are_of,
    chosen_instances as chosen_instances,
    on_chosen as on_chosen,
)
from .sampling import (
    sample_candidates as sample_candidates,
    sample_library as sample_library,
    sample_on_scene as sample_on_scene,
)
from .sampling_settings import (
    DEFAULT_APPROACH_ANGLE_DEG as DEFAULT_APPROACH_ANGLE_DEG,
    SamplingSettings as SamplingSettings,
)
from .sampling_shortfall import (
    SELF as SELF,
    TABLE as TABLE,
    shortfall as shortfall,
)
from .scene_frame import (
    Owners as Owners,
    by_instance as by_instance,
    held_instances as held_instances,
    in_frame as in_frame,
)
from .single_object import (
    ObjectGrasps as ObjectGrasps,
    object_grasps as object_grasps,
)
