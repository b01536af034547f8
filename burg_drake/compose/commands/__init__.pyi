from .arranging import (
    Align as Align,
    Distribute as Distribute,
)
from .board import (
    BOARD_SIZES as BOARD_SIZES,
    SetBoard as SetBoard,
    board_size as board_size,
    board_size_name as board_size_name,
)
from .command import (
    Command as Command,
    label_of as label_of,
)
from .contact import (
    Direction as Direction,
    PutDown as PutDown,
    SnapToContact as SnapToContact,
)
from .moving import (
    MoveObjects as MoveObjects,
    SetPose as SetPose,
    SnapToGrid as SnapToGrid,
    Turn as Turn,
)
from .placing import (
    AddObject as AddObject,
    Clear as Clear,
    Delete as Delete,
    Duplicate as Duplicate,
    Rename as Rename,
    SetFixed as SetFixed,
)
from .random_configuration import (
    MAX_OBJECTS as MAX_OBJECTS,
    RandomConfiguration as RandomConfiguration,
)
