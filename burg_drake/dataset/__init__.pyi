from .appearance import (
    Appearance as Appearance,
    AppearanceSettings as AppearanceSettings,
    DirectedLight as DirectedLight,
    Distractor as Distractor,
    Photometry as Photometry,
    TableSurface as TableSurface,
    read_appearance as read_appearance,
)
from .appearance_rendering import (
    apply_appearance as apply_appearance,
    environment_file as environment_file,
    render_parameters as render_parameters,
)
from .appearance_sampling import (
    distractor_boxes as distractor_boxes,
    draw_appearance as draw_appearance,
)
from .blender_process import (
    BLENDER_ENVIRONMENT_VARIABLE as BLENDER_ENVIRONMENT_VARIABLE,
    Blender as Blender,
    blender_command as blender_command,
)
from .blender_scene import (
    BlenderScene as BlenderScene,
    Lamp as Lamp,
    Material as Material,
    PaintedSurface as PaintedSurface,
    make_blender_scene as make_blender_scene,
    painted_surfaces as painted_surfaces,
)
from .bop import diameter as diameter, write_bop as write_bop
from .checks import DatasetFinding as DatasetFinding, check_dataset as check_dataset
from .coco import write_coco as write_coco
from .dataset_card import write_card as write_card
from .dataset_generation import (
    GeneratedDataset as GeneratedDataset,
    catalogue_scene as catalogue_scene,
    check_generated as check_generated,
    generate_dataset as generate_dataset,
    sample_again as sample_again,
    scene_maker as scene_maker,
)
from .document import (
    DATASET_FILE as DATASET_FILE,
    DatasetDocument as DatasetDocument,
    load_dataset_document as load_dataset_document,
    save_dataset_document as save_dataset_document,
    write_index as write_index,
)
from .export_common import Samples as Samples
from .grasp_labels import (
    MAX_APPROACH_ANGLE as MAX_APPROACH_ANGLE,
    GraspRectangles as GraspRectangles,
    GraspVolume as GraspVolume,
    VoxelTargets as VoxelTargets,
    grasp_rectangles as grasp_rectangles,
    volume_grasps as volume_grasps,
)
from .graspnet import grasp_scores as grasp_scores, write_graspnet as write_graspnet
from .model_files import find_symmetries as find_symmetries, visual_model as visual_model
from .photometry import apply_photometry as apply_photometry
from .point_clouds import (
    DepthCloud as DepthCloud,
    SurfaceCloud as SurfaceCloud,
    depth_cloud as depth_cloud,
    surface_cloud as surface_cloud,
)
from .ray_casting import RayScene as RayScene, RaySurface as RaySurface, Silhouette as Silhouette
from .reader import (
    Dataset as Dataset,
    ReadableSamples as ReadableSamples,
    load_dataset as load_dataset,
)
from .recipe import DatasetRecipe as DatasetRecipe, portable_recipe as portable_recipe
from .room import (
    BACKGROUND_GREY as BACKGROUND_GREY,
    NO_APPEARANCE_COLOR as NO_APPEARANCE_COLOR,
    blend_over_background as blend_over_background,
    environment_map as environment_map,
    fill_background as fill_background,
)
from .sample import (
    Images as Images,
    InstanceLabel as InstanceLabel,
    LabelledGrasps as LabelledGrasps,
    Sample as Sample,
)
from .sample_encoding import (
    decode_grasps as decode_grasps,
    decode_image_of as decode_image_of,
    decode_mask as decode_mask,
    depth_unit_of as depth_unit_of,
    encode_grasps as encode_grasps,
    encode_image as encode_image,
    encode_mask as encode_mask,
)
from .sample_files import (
    encode_sample as encode_sample,
    parse_record as parse_record,
    record_text as record_text,
)
from .sample_sheet import (
    contact_sheet as contact_sheet,
    evenly_spaced_indices as evenly_spaced_indices,
    place_name_tag as place_name_tag,
    sample_caption as sample_caption,
)
from .sample_view import show_sample as show_sample
from .scene_grasps import (
    SceneGrasps as SceneGrasps,
    grasps_of_run as grasps_of_run,
    label_grasps as label_grasps,
    sampled_grasps as sampled_grasps,
)
from .scene_renderer import (
    ImageKind as ImageKind,
    SceneRenderer as SceneRenderer,
    label_instances as label_instances,
    render as render,
    station_view as station_view,
)
from .scene_samples import (
    SampleTask as SampleTask,
    SceneWork as SceneWork,
    make_scene as make_scene,
    run_sample_task as run_sample_task,
)
from .shards import ShardEntry as ShardEntry, write_shard as write_shard
from .textures import table_texture as table_texture
from .tsdf import (
    Tsdf as Tsdf,
    exact_tsdf as exact_tsdf,
    fuse_tsdf as fuse_tsdf,
    mesh_distance as mesh_distance,
)
from .view_sampler import PlacedBox as PlacedBox, ViewSampler as ViewSampler
from .views import (
    View as View,
    ViewpointSettings as ViewpointSettings,
    camera_looking_at as camera_looking_at,
)
from .webdataset import write_webdataset as write_webdataset
from .writer import DatasetWriter as DatasetWriter, write_scene as write_scene
