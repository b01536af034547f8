from .layout import (
    Layout as Layout,
    PlacedObject as PlacedObject,
    lay_out as lay_out,
    model_names as model_names,
    prim_names as prim_names,
)
from .mjcf_hand import (
    HAND_CARRIER_BODY as HAND_CARRIER_BODY,
    HAND_SHAPE_PREFIX as HAND_SHAPE_PREFIX,
    PAD_BACKING_PREFIX as PAD_BACKING_PREFIX,
    PAD_SPHERE_PREFIX as PAD_SPHERE_PREFIX,
    link_name as link_name,
    pad_contact as pad_contact,
    pad_spheres as pad_spheres,
)
from .mjcf_scene import (
    LIFT_JOINT as LIFT_JOINT,
    MjcfBodyNames as MjcfBodyNames,
    trial_mjcf as trial_mjcf,
)
from .scene_export import (
    SCENE_FORMATS as SCENE_FORMATS,
    Exported as Exported,
    ExportRecord as ExportRecord,
    export_scene as export_scene,
    require_own_folder as require_own_folder,
    write_record as write_record,
)
from .sdf import MeshCopies as MeshCopies, object_sdf_model as object_sdf_model
