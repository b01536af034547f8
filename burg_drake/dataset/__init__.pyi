from .appearance import (
    Appearance as Appearance,
    AppearanceSettings as AppearanceSettings,
    DirectedLight as DirectedLight,
    Distractor as Distractor,
    Photometry as Photometry,
    TableSurface as TableSurface,
    draw_appearance as draw_appearance,
)
from .exchange import (
    Samples as Samples,
    contact_sheet as contact_sheet,
    write_bop as write_bop,
    write_card as write_card,
    write_coco as write_coco,
    write_graspnet as write_graspnet,
    write_webdataset as write_webdataset,
)
from .generating import (
    DatasetRecipe as DatasetRecipe,
    GeneratedDataset as GeneratedDataset,
    check_generated as check_generated,
    sample_again as sample_again,
)
from .labels import (
    DepthCloud as DepthCloud,
    GraspRectangles as GraspRectangles,
    GraspVolume as GraspVolume,
    InstanceLabel as InstanceLabel,
    LabelledGrasps as LabelledGrasps,
    SceneGrasps as SceneGrasps,
    SurfaceCloud as SurfaceCloud,
    Tsdf as Tsdf,
    VoxelTargets as VoxelTargets,
    depth_cloud as depth_cloud,
    exact_tsdf as exact_tsdf,
    fuse_tsdf as fuse_tsdf,
    grasp_rectangles as grasp_rectangles,
    grasps_of_run as grasps_of_run,
    label_grasps as label_grasps,
    label_instances as label_instances,
    sampled_grasps as sampled_grasps,
    surface_cloud as surface_cloud,
    volume_grasps as volume_grasps,
)
from .rendering import (
    Images as Images,
    SceneRenderer as SceneRenderer,
    Silhouette as Silhouette,
)
from .samples import (
    Dataset as Dataset,
    DatasetDocument as DatasetDocument,
    DatasetFinding as DatasetFinding,
    ReadableSamples as ReadableSamples,
    Sample as Sample,
    ShardEntry as ShardEntry,
)
from .views import (
    PlacedBox as PlacedBox,
    View as View,
    ViewpointSettings as ViewpointSettings,
    ViewSampler as ViewSampler,
)
