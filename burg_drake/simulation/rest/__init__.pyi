from .body_motions import MotionTracker as MotionTracker
from .criterion import (
    BodySpeed as BodySpeed,
    settle as settle,
)
from .displacement import (
    Displacement as Displacement,
    depth_in_table as depth_in_table,
    displacement_from_document as displacement_from_document,
)
from .drift import predict_drift as predict_drift
from .falling import fall as fall
from .neighbours import Neighbours as Neighbours
from .relaxation import (
    RELAXING as RELAXING,
    RELAXING_ON_TRIANGLES as RELAXING_ON_TRIANGLES,
    relax as relax,
)
from .still_check import (
    is_still as is_still,
    stillness as stillness,
)
