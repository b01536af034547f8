from .board import BoardView as BoardView
from .board_layers import (
    BoardLayers as BoardLayers,
    BoardOverlay as BoardOverlay,
)
from .ghosts import GhostView as GhostView
from .heights import HeightView as HeightView
from .live_picture import (
    LETS_GO as LETS_GO,
    LivePicture as LivePicture,
)
from .object_meshes import ObjectMeshes as ObjectMeshes
from .object_pictures import ObjectPictures as ObjectPictures
from .objects import (
    Coloring as Coloring,
    SceneView as SceneView,
    ShownInstance as ShownInstance,
)
from .viewpoints import PageViews as PageViews
