from .calibration_report import write_calibration_report as write_calibration_report
from .charts import (
    HistogramSeries as HistogramSeries,
    Limit as Limit,
    RankedShare as RankedShare,
    bars_of_counts_file as bars_of_counts_file,
    histogram_file as histogram_file,
    interval_mark as interval_mark,
    mirrored_histogram as mirrored_histogram,
    nice_step as nice_step,
    ranked_chart as ranked_chart,
)
from .colors import (
    COLOR_BINS as COLOR_BINS,
    OTHERS_COLOR as OTHERS_COLOR,
    OUTCOME_GROUPS as OUTCOME_GROUPS,
    UNJUDGED_GROUP as UNJUDGED_GROUP,
    UNKNOWN_COLOR as UNKNOWN_COLOR,
    VIRIDIS_COLORS as VIRIDIS_COLORS,
    ColorScale as ColorScale,
    color_scale as color_scale,
    contrast_ratio as contrast_ratio,
    hex_color as hex_color,
    linear_light as linear_light,
    map_colors as map_colors,
    outcome_group as outcome_group,
)
from .contact_sheet import (
    contact_name as contact_name,
    mass_text as mass_text,
    percent_text as percent_text,
    pose_note as pose_note,
    surface_notes as surface_notes,
    write_contact_sheet as write_contact_sheet,
)
from .frame_gallery import (
    FORMAT_TRIAD as FORMAT_TRIAD,
    FRAMES_PATH as FRAMES_PATH,
    show_frames as show_frames,
)
from .gallery_layout import (
    GALLERY_ELEVATION as GALLERY_ELEVATION,
    GalleryItem as GalleryItem,
    GalleryLayout as GalleryLayout,
    GalleryRow as GalleryRow,
    layout_gallery as layout_gallery,
)
from .gltf import gltf_mesh as gltf_mesh, label_mesh as label_mesh, picture_mesh as picture_mesh
from .grasp_view import (
    BAR_RADIUS as BAR_RADIUS,
    FINGER_LENGTH as FINGER_LENGTH,
    GRASPS_PATH as GRASPS_PATH,
    STEM_LENGTH as STEM_LENGTH,
    GraspGroup as GraspGroup,
    color_grasps_by as color_grasps_by,
    column_title as column_title,
    default_color_column as default_color_column,
    draw_grasps as draw_grasps,
    grasp_corners as grasp_corners,
    grasp_group_entries as grasp_group_entries,
    grasp_path as grasp_path,
    grasp_strokes as grasp_strokes,
    grasp_triangles as grasp_triangles,
    group_by_name as group_by_name,
    group_by_number as group_by_number,
    group_by_outcome as group_by_outcome,
    single_group as single_group,
)
from .hand_visual import (
    GRIPPER_PATH as GRIPPER_PATH,
    GripperView as GripperView,
    HandVisual as HandVisual,
    hand_visuals as hand_visuals,
)
from .html_page import (
    Child as Child,
    Html as Html,
    PageTable as PageTable,
    element as element,
    join as join,
    page_style as page_style,
    render_page as render_page,
    svg_line as svg_line,
    svg_text as svg_text,
)
from .hydroelastic_mesh import (
    HydroelasticMesh as HydroelasticMesh,
    boundary_faces as boundary_faces,
    convex_depth as convex_depth,
    cut_open as cut_open,
    hydroelastic_meshes as hydroelastic_meshes,
    pressure_colors as pressure_colors,
)
from .legend import (
    BAR_MARGIN as BAR_MARGIN,
    BAR_WIDTH as BAR_WIDTH,
    HISTOGRAM_HEIGHT as HISTOGRAM_HEIGHT,
    ColorBar as ColorBar,
    LegendEntry as LegendEntry,
)
from .library_gallery import (
    show_library as show_library,
    show_objects_for_grasps as show_objects_for_grasps,
)
from .meshcat_drawing import (
    AXIS_COLORS as AXIS_COLORS,
    TriadStyle as TriadStyle,
    aim_at as aim_at,
    camera_rotation_along as camera_rotation_along,
    draw_triad as draw_triad,
)
from .meshcat_page import (
    GraspPicker as GraspPicker,
    page_panel as page_panel,
    save_html as save_html,
)
from .object_drawing import (
    PIXELS_PER_UNIT as PIXELS_PER_UNIT,
    TONE_COUNT as TONE_COUNT,
    FlatView as FlatView,
    SolidMesh as SolidMesh,
    best_yaw as best_yaw,
    camera_rotation as camera_rotation,
    fit_camera as fit_camera,
    fit_view as fit_view,
    footprint as footprint,
    object_surface as object_surface,
    painted_shadow as painted_shadow,
    path_data as path_data,
    project_to_ground as project_to_ground,
    shaded_outline as shaded_outline,
    upright_rotation as upright_rotation,
)
from .reachability_map import (
    CHART_TITLE_HEIGHT as CHART_TITLE_HEIGHT,
    CHART_WIDTH as CHART_WIDTH,
    object_outlines as object_outlines,
    reach_image as reach_image,
    reachability_chart as reachability_chart,
    reachability_key as reachability_key,
)
from .scene_view import (
    aim_camera as aim_camera,
    draw_board as draw_board,
    open_meshcat as open_meshcat,
    scene_points as scene_points,
    show_scene as show_scene,
)
from .station_view import (
    MAP_PATH as MAP_PATH,
    REACHABILITY_BINS as REACHABILITY_BINS,
    show_station as show_station,
    tile_triangles as tile_triangles,
)
from .thumbnails import (
    MAX_FILLED_SHARE as MAX_FILLED_SHARE,
    THUMBNAIL_BACKGROUND as THUMBNAIL_BACKGROUND,
    ObjectRenderer as ObjectRenderer,
    Thumbnail as Thumbnail,
    explosion_offsets as explosion_offsets,
)
from .trial_replay import (
    PREFERRED_HEADING as PREFERRED_HEADING,
    SIGHT_CLEARANCE as SIGHT_CLEARANCE,
    camera_offset as camera_offset,
    describe_trial as describe_trial,
    record_arm_trial as record_arm_trial,
    record_trial as record_trial,
)
