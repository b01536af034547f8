from .antipodal import (
    NO_APPROACH as NO_APPROACH,
    Accept as Accept,
    AntipodalSettings as AntipodalSettings,
    sample_antipodal as sample_antipodal,
)
from .approach import ApproachCone as ApproachCone
from .contact_pairs import (
    NO_ROOM as NO_ROOM,
    SLANTED as SLANTED,
    TOO_LONG as TOO_LONG,
)
