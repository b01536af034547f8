from .arm import (
    arm_section as arm_section,
    execution_section as execution_section,
)
from .bodies import (
    collision_section as collision_section,
    disturbed_section as disturbed_section,
)
from .campaign_pictures import object_pictures as object_pictures
from .cascade import cascade_section as cascade_section
from .causes import (
    MARGINS_ASKED as MARGINS_ASKED,
    CauseRows as CauseRows,
    causes_section as causes_section,
    rows_of_run as rows_of_run,
)
from .certainty import certainty_section as certainty_section
from .margins import (
    CHOSEN as CHOSEN,
    FURTHER as FURTHER,
    further_margins as further_margins,
    margin_section as margin_section,
    tried_margins as tried_margins,
)
from .opening import opening_section as opening_section
from .outcomes import (
    cost_section as cost_section,
    count_section as count_section,
    objects_section as objects_section,
)
from .pictures import (
    grasp_section as grasp_section,
    pictures_of as pictures_of,
    scene_picture as scene_picture,
)
from .reachability import reachability_section as reachability_section
from .reproduction import (
    campaign_facts as campaign_facts,
    provenance as provenance,
    repeat_campaign as repeat_campaign,
    repeat_section as repeat_section,
)
from .scenes import scenes_section as scenes_section
from .single_grasps import (
    best_section as best_section,
    failure_section as failure_section,
)
