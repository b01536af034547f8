"""Training data: views of scenes as images with labels, in the formats that people train on.

Read `scene_renderer` first, then `sample_files` and `shards`, which write samples and read them,
and `dataset_generation`.
"""

import lazy_loader

__getattr__, _, _ = lazy_loader.attach_stub(__name__, __file__)

__all__ = [
    "Appearance",
    "AppearanceSettings",
    "Dataset",
    "DatasetDocument",
    "DatasetFinding",
    "DatasetRecipe",
    "DepthCloud",
    "DirectedLight",
    "Distractor",
    "GeneratedDataset",
    "GraspRectangles",
    "GraspVolume",
    "Images",
    "InstanceLabel",
    "LabelledGrasps",
    "Photometry",
    "PlacedBox",
    "ReadableSamples",
    "Sample",
    "Samples",
    "SceneGrasps",
    "SceneRenderer",
    "ShardEntry",
    "Silhouette",
    "SurfaceCloud",
    "TableSurface",
    "Tsdf",
    "View",
    "ViewSampler",
    "ViewpointSettings",
    "VoxelTargets",
    "check_generated",
    "contact_sheet",
    "depth_cloud",
    "draw_appearance",
    "exact_tsdf",
    "fuse_tsdf",
    "grasp_rectangles",
    "grasps_of_run",
    "label_grasps",
    "label_instances",
    "sample_again",
    "sampled_grasps",
    "surface_cloud",
    "volume_grasps",
    "write_bop",
    "write_card",
    "write_coco",
    "write_graspnet",
    "write_webdataset",
]


def __dir__() -> list[str]:
    return __all__
