from .clouds import (
    DepthCloud as DepthCloud,
    SurfaceCloud as SurfaceCloud,
    depth_cloud as depth_cloud,
    surface_cloud as surface_cloud,
)
from .exact_distance import exact_tsdf as exact_tsdf
from .grasp_volume import (
    GraspVolume as GraspVolume,
    VoxelTargets as VoxelTargets,
    volume_grasps as volume_grasps,
)
from .grasps import (
    grasps_of_run as grasps_of_run,
    sampled_grasps as sampled_grasps,
)
from .instance_label import (
    Box as Box,
    InstanceLabel as InstanceLabel,
    box_of_mask as box_of_mask,
)
from .instances import (
    label_instances as label_instances,
)
from .labelled_grasps import LabelledGrasps as LabelledGrasps
from .rectangles import (
    GraspRectangles as GraspRectangles,
    grasp_rectangles as grasp_rectangles,
)
from .run_length import (
    decode_mask as decode_mask,
    encode_mask as encode_mask,
)
from .scene_grasps import (
    SceneGrasps as SceneGrasps,
    label_grasps as label_grasps,
)
from .tsdf import (
    Tsdf as Tsdf,
    fuse_tsdf as fuse_tsdf,
)
