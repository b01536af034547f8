"""Stations: what their documents hold, and whether arm and hand are as stated."""

from burg_drake.core.paths import (
    Packages as Packages,
)
from burg_drake.motion.collision import (
    HomeClearance as HomeClearance,
)
from burg_drake.motion.workspace import (
    ArmFigures as ArmFigures,
    StationReport as StationReport,
    inspect_station as inspect_station,
)
from burg_drake.station.diagram import (
    FingerLink as FingerLink,
    FloatingHand as FloatingHand,
    HandDescription as HandDescription,
    HandHandle as HandHandle,
    HandLink as HandLink,
    HandShape as HandShape,
    MountedHand as MountedHand,
    PadFront as PadFront,
    read_hand as read_hand,
)
from burg_drake.station.document import (
    Arm as Arm,
    ArmControl as ArmControl,
    Camera as Camera,
    Finger as Finger,
    Hand as Hand,
    Obstacle as Obstacle,
    StationDocument as StationDocument,
    Table as Table,
)
from burg_drake.station.world import (
    ContactParts as ContactParts,
    FixedBox as FixedBox,
    HandFigures as HandFigures,
)
