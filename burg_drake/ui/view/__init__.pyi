from .annotations import (
    GhostView as GhostView,
    HeightView as HeightView,
)
from .board import (
    BoardLayers as BoardLayers,
    BoardOverlay as BoardOverlay,
    BoardView as BoardView,
)
from .live_picture import (
    CAMERA_RELEASE_TIMEOUT as CAMERA_RELEASE_TIMEOUT,
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
