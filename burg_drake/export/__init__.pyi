from .layout import (
    Layout as Layout,
    PlacedObject as PlacedObject,
    lay_out as lay_out,
)
from .scene_export import (
    FORMATS as FORMATS,
    Exported as Exported,
    export_scene as export_scene,
)
