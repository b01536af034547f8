from .cameras.calibration.estimation import (
    calibrate as calibrate,
)
from .cameras.live.snapshot import (
    load_snapshot as load_snapshot,
)
from .cameras.optics.intrinsics import (
    Intrinsics as Intrinsics,
)
from .cameras.optics.intrinsics_file import (
    load_intrinsics as load_intrinsics,
)
from .cameras.overlay.renderer import (
    Overlay as Overlay,
)
from .cameras.overlay.style import (
    OverlayStyle as OverlayStyle,
)
from .cameras.placement.check import (
    check_placement as check_placement,
)
from .cameras.placement.document import (
    PlacementCheck as PlacementCheck,
    load_placement as load_placement,
)
from .cameras.pose.camera_location import (
    locate_camera as locate_camera,
)
from .cameras.pose.estimate import (
    BoardEstimate as BoardEstimate,
)
from .cameras.pose.estimator import (
    BoardPose as BoardPose,
    estimate_board as estimate_board,
)
from .cameras.projection.visibility import (
    visible_from as visible_from,
)
from .cameras.rectification.stream import (
    board_views as board_views,
)
from .cameras.rectification.top_view import (
    BoardPicture as BoardPicture,
    BoardRectifier as BoardRectifier,
    board_picture as board_picture,
)
from .cameras.sources.opening import (
    open_source as open_source,
)
from .cameras.systems.board_loop import (
    build_board_loop as build_board_loop,
)
from .cameras.systems.pose_estimator import (
    BoardPoseEstimator as BoardPoseEstimator,
)
from .cameras.systems.pose_filter import (
    PoseFilter as PoseFilter,
)
from .cameras.systems.scene_overlay import (
    SceneOverlay as SceneOverlay,
)
from .core.errors import (
    BurgError as BurgError,
)
from .core.grasps.grasp_set import (
    GraspSet as GraspSet,
)
from .core.grasps.outcome import (
    Outcome as Outcome,
    RealOutcome as RealOutcome,
    Stage as Stage,
)
from .evaluation.candidates.sampling_settings import (
    SamplingSettings as SamplingSettings,
)
from .evaluation.cascade import (
    evaluate as evaluate,
)
from .evaluation.cluster.dask_executor import (
    DaskExecutor as DaskExecutor,
    connect_cluster as connect_cluster,
)
from .evaluation.feasibility import (
    reach as reach,
)
from .evaluation.grasp_sets.candidate_files import (
    read_grasps as read_grasps,
)
from .evaluation.grasp_sets.sampled import (
    sample_grasps as sample_grasps,
)
from .evaluation.grasp_sets.scored import (
    scored_set as scored_set,
)
from .evaluation.merge.runs import (
    merge_runs as merge_runs,
)
from .evaluation.results.status import (
    read_status as read_status,
)
from .evaluation.robustness.assessment import (
    assess_robustness as assess_robustness,
)
from .evaluation.robustness.probes import (
    RobustnessSettings as RobustnessSettings,
)
from .evaluation.stages.counts import (
    GraspCount as GraspCount,
    count_grasps as count_grasps,
)
from .evaluation.stages.scene_acceptance import (
    clear_grasp_counts as clear_grasp_counts,
    within_reach as within_reach,
)
from .evaluation.store.campaign_folder import (
    Campaign as Campaign,
    load_campaign as load_campaign,
)
from .evaluation.store.loading import (
    load_runs as load_runs,
    read_results as read_results,
)
from .evaluation.store.run_folder import (
    Run as Run,
    load_run as load_run,
)
from .evaluation.workers.executor import (
    Executor as Executor,
    LocalExecutor as LocalExecutor,
)
from .experiment.comparison.comparison import (
    Comparison as Comparison,
    compare as compare,
)
from .experiment.gap.changes import (
    gap_changes as gap_changes,
)
from .experiment.gap.measurement import (
    measure_gap as measure_gap,
)
from .experiment.gap.placement_noise import (
    PlacementNoise as PlacementNoise,
)
from .experiment.gap.rejudging import (
    rejudge as rejudge,
)
from .experiment.planning.plan import (
    plan_trials as plan_trials,
)
from .experiment.trials.book import (
    TrialBook as TrialBook,
)
from .experiment.trials.sheet import (
    RealTrial as RealTrial,
    TrialSheet as TrialSheet,
    load_trials as load_trials,
)
from .export.scene_export import (
    export_scene as export_scene,
)
from .formats.grasp_files import (
    read_grasp_file as read_grasp_file,
    write_grasp_file as write_grasp_file,
)
from .generation.many import (
    sample_scenes as sample_scenes,
)
from .generation.sample import (
    sample_scene as sample_scene,
)
from .grasping.clearance.hand_clearance import (
    HandClearance as HandClearance,
    hand_clearance_alone as hand_clearance_alone,
)
from .grasping.comparison.average_precision import (
    graspnet_ap as graspnet_ap,
)
from .grasping.comparison.matching import (
    coverage as coverage,
    precision as precision,
)
from .grasping.comparison.summary import (
    compare_grasps as compare_grasps,
    summarize as summarize,
)
from .grasping.sampling.antipodal import (
    sample_antipodal as sample_antipodal,
)
from .grasping.sampling.approach import (
    ApproachCone as ApproachCone,
)
from .grasping.similarity.diversity import (
    farthest_points as farthest_points,
)
from .motion.lines.reach_settings import (
    ReachSettings as ReachSettings,
)
from .motion.planner import (
    Planner as Planner,
    plan as plan,
)
from .motion.plans.plan_file import (
    load_plan as load_plan,
)
from .motion.plans.trajectory import (
    Plan as Plan,
    Trajectory as Trajectory,
)
from .motion.reach.arm_reach import (
    ArmReach as ArmReach,
    Reach as Reach,
)
from .motion.timing.timing_settings import (
    TimingSettings as TimingSettings,
)
from .motion.workspace.reach_layer import (
    ReachLayer as ReachLayer,
    reach_from_above as reach_from_above,
)
from .motion.workspace.reachability import (
    ReachabilityMap as ReachabilityMap,
    ReachabilitySettings as ReachabilitySettings,
    map_reachability as map_reachability,
)
from .motion.workspace.station_check import (
    inspect_station as inspect_station,
)
from .objects.library.document import (
    load_library as load_library,
)
from .pipeline.build import (
    build_library as build_library,
)
from .printout.board_printout import (
    PrintSettings as PrintSettings,
    print_board as print_board,
)
from .scene.document.board import (
    Board as Board,
)
from .scene.document.recipe import (
    SceneRecipe as SceneRecipe,
)
from .scene.document.scene import (
    load_scene as load_scene,
    save_scene as save_scene,
)
from .scene.document.validation import (
    validate_scene as validate_scene,
)
from .simulation.robustness.friction_search import (
    FrictionSettings as FrictionSettings,
    friction_limit as friction_limit,
)
from .simulation.robustness.grip import (
    Grip as Grip,
    take_grip as take_grip,
)
from .simulation.robustness.hold_force import (
    LoadSettings as LoadSettings,
    shake as shake,
    tug as tug,
)
from .simulation.robustness.perturbation import (
    Noise as Noise,
    success_rate as success_rate,
)
from .simulation.settling.settled_scene import (
    settle_scene as settle_scene,
)
from .simulation.trials.arm_trial import (
    ArmTrial as ArmTrial,
)
from .simulation.trials.hand_trial import (
    HandTrial as HandTrial,
)
from .station.checks.scene_check import (
    SceneCheck as SceneCheck,
)
from .station.checks.scene_issues import (
    check_scene as check_scene,
)
from .station.diagram.builder import (
    build_station_diagram as build_station_diagram,
)
from .station.document.engine import (
    ENGINES as ENGINES,
    Engine as Engine,
)
from .station.document.grasp_motion import (
    GraspMotion as GraspMotion,
)
from .station.document.station_document import (
    load_station as load_station,
)

__version__: str
