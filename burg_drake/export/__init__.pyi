from .layout import (
    Layout as Layout,
    PlacedObject as PlacedObject,
)
from .scene_export import (
    FORMATS as FORMATS,
    Exported as Exported,
    export_scene as export_scene,
)
