from .gizmo import Gizmo as Gizmo
from .key_commands import selection_calls as selection_calls
from .object_drags import ObjectDrags as ObjectDrags
from .picking import Picking as Picking
