from .arm_collision import ArmCollision as ArmCollision
from .arm_links import ArmLinks as ArmLinks
from .arm_reach import (
    ArmReach as ArmReach,
    lift_heights as lift_heights,
    raise_lifts as raise_lifts,
)
from .arm_shape import ArmShape as ArmShape
from .arm_span import (
    ArmSpan as ArmSpan,
    unreachable_board as unreachable_board,
    unreachable_objects as unreachable_objects,
)
from .ball_tree import BallTrees as BallTrees, BodyBalls as BodyBalls, cover_body as cover_body
from .clearance_bounds import ArmProximity as ArmProximity
from .closed_form_lines import ClosedFormLineSearch as ClosedFormLineSearch
from .distance_field import (
    DistanceField as DistanceField,
    DistanceFieldSettings as DistanceFieldSettings,
    HullSolid as HullSolid,
    ProximitySolid as ProximitySolid,
    solid_of as solid_of,
)
from .edge_checker import (
    EdgeChecker as EdgeChecker,
    EdgeCheckSettings as EdgeCheckSettings,
    screen_edges as screen_edges,
)
from .grasp_timing import PathChecks as PathChecks, time_motion as time_motion
from .hand_sweep import HandSweep as HandSweep, SweepResult as SweepResult
from .home_posture import (
    HomeClearance as HomeClearance,
    base_overlaps as base_overlaps,
    home_clearance as home_clearance,
    require_free_home as require_free_home,
)
from .home_tree import HomeTree as HomeTree
from .ik_solutions import (
    IkRoutine as IkRoutine,
    RoutineSolutions as RoutineSolutions,
    arm_solutions as arm_solutions,
)
from .joint_limits import ArmLimits as ArmLimits
from .line_poses import (
    ClosedFormFiller as ClosedFormFiller,
    DenseRows as DenseRows,
    HandPath as HandPath,
    straighten_rows as straighten_rows,
)
from .line_search import (
    Chain as Chain,
    Failure as Failure,
    LineSearch as LineSearch,
    LineSearchBatch as LineSearchBatch,
    SuccessiveLineSearch as SuccessiveLineSearch,
)
from .line_timing import line_error as line_error
from .motion_settings import ReachSettings as ReachSettings, TimingSettings as TimingSettings
from .numeric_ik import (
    ArmKinematics as ArmKinematics,
    rotation_vector as rotation_vector,
    solve_ik as solve_ik,
)
from .numeric_lines import NumericLineSearch as NumericLineSearch
from .panda_ik import (
    PandaIk as PandaIk,
    PandaPostures as PandaPostures,
    panda_forward as panda_forward,
)
from .plan_files import Plan as Plan, format_rows as format_rows, load_plan as load_plan
from .planner import Planner as Planner, plan as plan
from .polyline_timing import (
    Cubics as Cubics,
    DoubleS as DoubleS,
    distance_to_polyline as distance_to_polyline,
    smooth_polyline as smooth_polyline,
    time_polyline as time_polyline,
)
from .posture_grid import (
    DEEP_PENETRATION as DEEP_PENETRATION,
    GridChain as GridChain,
    PostureGrid as PostureGrid,
)
from .reach_layer import (
    ReachLayer as ReachLayer,
    answers_by_refinement as answers_by_refinement,
    reach_from_above as reach_from_above,
    reach_without_objects as reach_without_objects,
)
from .reach_verdict import ArmPath as ArmPath, Reach as Reach
from .reachability import (
    ReachabilityMap as ReachabilityMap,
    ReachabilitySettings as ReachabilitySettings,
    map_reachability as map_reachability,
    without_free_objects as without_free_objects,
)
from .roadmap import (
    ObjectViewLimits as ObjectViewLimits,
    postures_over_objects as postures_over_objects,
)
from .self_clearance import (
    JointGrid as JointGrid,
    LinkDistance as LinkDistance,
    PairTable as PairTable,
    collision_pairs as collision_pairs,
    may_collide as may_collide,
)
from .station_check import (
    ArmFigures as ArmFigures,
    StationReport as StationReport,
    empty_scene as empty_scene,
    format_share as format_share,
    inspect_station as inspect_station,
)
from .station_proposal import find_built_in as find_built_in, propose_station as propose_station
from .trajectory import (
    MOTION_PHASES as MOTION_PHASES,
    Motion as Motion,
    PlanOrigin as PlanOrigin,
    Trajectory as Trajectory,
    round_to_grid as round_to_grid,
)
from .usable_arm import require_usable_arm as require_usable_arm
