from .builder import build_station_diagram as build_station_diagram
from .contact_pairs import separate_contact as separate_contact
from .floating_hand import FloatingHand as FloatingHand
from .hand_description import (
    FingerLink as FingerLink,
    HandDescription as HandDescription,
    HandLink as HandLink,
    HandShape as HandShape,
    read_hand as read_hand,
)
from .hand_handle import HandHandle as HandHandle
from .leaning import (
    GAP as GAP,
    soften as soften,
    touching as touching,
)
from .mesh_replacement import mesh_by_pieces as mesh_by_pieces
from .mounted_hand import MountedHand as MountedHand
from .pad_front import PadFront as PadFront
from .station_diagram import (
    StationDiagram as StationDiagram,
    instance_pose as instance_pose,
)
from .visible_triangles import (
    Triangles as Triangles,
    shape_triangles as shape_triangles,
    visible_surfaces as visible_surfaces,
)
