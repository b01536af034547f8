"""Stations: what their documents hold, and whether arm and hand are as stated."""

from burg_drake.core import Packages as Packages
from burg_drake.motion import (
    ArmFigures as ArmFigures,
    HomeClearance as HomeClearance,
    StationReport as StationReport,
    inspect_station as inspect_station,
)
from burg_drake.station import (
    Arm as Arm,
    ArmControl as ArmControl,
    Camera as Camera,
    ContactParts as ContactParts,
    Finger as Finger,
    FingerLink as FingerLink,
    FixedBox as FixedBox,
    FloatingHand as FloatingHand,
    Hand as Hand,
    HandDescription as HandDescription,
    HandFigures as HandFigures,
    HandHandle as HandHandle,
    HandLink as HandLink,
    HandShape as HandShape,
    MountedHand as MountedHand,
    Obstacle as Obstacle,
    PadFront as PadFront,
    StationDocument as StationDocument,
    Table as Table,
    read_hand as read_hand,
)
