from .builder import (
    Robot as Robot,
    StationDiagram as StationDiagram,
    build_station_diagram as build_station_diagram,
    instance_pose as instance_pose,
)
from .floating_hand import FloatingHand as FloatingHand
from .hand_handle import HandHandle as HandHandle
from .leaning import (
    soften as soften,
    touching as touching,
)
from .mounted_hand import MountedHand as MountedHand
