from . import (
    arm as arm,
    cameras as cameras,
    compose as compose,
    dataset as dataset,
    documents as documents,
    errors as errors,
    frames as frames,
    grasps as grasps,
    objects as objects,
    runs as runs,
    scenes as scenes,
    simulation as simulation,
    stations as stations,
    trials as trials,
)
from .core.errors import (
    BurgError as BurgError,
)
from .core.grasps.grasp_set import (
    GraspSet as GraspSet,
)
from .core.grasps.outcome import (
    Outcome as Outcome,
    Stage as Stage,
)
from .dataset.generating.generate import (
    generate_dataset as generate_dataset,
)
from .dataset.rendering.one_view import (
    render as render,
)
from .dataset.samples.dataset import (
    load_dataset as load_dataset,
)
from .dataset.samples.writer import (
    DatasetWriter as DatasetWriter,
)
from .evaluation.candidates.sampling_settings import (
    SamplingSettings as SamplingSettings,
)
from .evaluation.cascade import (
    evaluate as evaluate,
)
from .evaluation.feasibility import (
    reach as reach,
)
from .evaluation.grasp_sets.sampled import (
    sample_grasps as sample_grasps,
)
from .evaluation.records.settings import (
    EvaluationSettings as EvaluationSettings,
)
from .evaluation.store.campaign_folder import (
    Campaign as Campaign,
    load_campaign as load_campaign,
)
from .evaluation.store.loading import (
    read_results as read_results,
)
from .evaluation.store.run_folder import (
    Run as Run,
    load_run as load_run,
)
from .export.scene_export import (
    export_scene as export_scene,
)
from .generation.many import (
    sample_scenes as sample_scenes,
)
from .generation.sample import (
    sample_scene as sample_scene,
)
from .motion.lines.reach_settings import (
    ReachSettings as ReachSettings,
)
from .motion.planner import (
    Planner as Planner,
    plan as plan,
)
from .motion.plans.grasp_plan import (
    Plan as Plan,
    load_plan as load_plan,
)
from .motion.reach.arm_reach import (
    ArmReach as ArmReach,
)
from .motion.reach.verdict import (
    Reach as Reach,
)
from .motion.timing.timing_settings import (
    TimingSettings as TimingSettings,
)
from .objects.library.document import (
    ObjectLibrary as ObjectLibrary,
    load_library as load_library,
)
from .pipeline.build import (
    BuildReport as BuildReport,
    build_library as build_library,
)
from .pipeline.source import (
    ObjectSource as ObjectSource,
)
from .printout.board_printout import (
    print_board as print_board,
)
from .scene.document.recipe import (
    SceneRecipe as SceneRecipe,
)
from .scene.document.scene import (
    Scene as Scene,
    SceneLike as SceneLike,
    load_scene as load_scene,
    save_scene as save_scene,
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
from .simulation.trials.result import (
    TrialResult as TrialResult,
)
from .simulation.trials.trial_settings import (
    TrialSettings as TrialSettings,
)
from .station.checks.scene_issues import (
    check_scene as check_scene,
)
from .station.diagram.builder import (
    build_station_diagram as build_station_diagram,
)
from .station.diagram.station_diagram import (
    StationDiagram as StationDiagram,
)
from .station.document.engine import (
    ENGINES as ENGINES,
    Engine as Engine,
)
from .station.document.grasp_motion import (
    GraspMotion as GraspMotion,
)
from .station.document.station_document import (
    Station as Station,
    StationLike as StationLike,
    load_station as load_station,
)

__version__: str
