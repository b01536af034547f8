from . import (
    arm as arm,
    benchmark as benchmark,
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
from .core import (
    BurgError as BurgError,
    GraspSet as GraspSet,
    Outcome as Outcome,
    Stage as Stage,
)
from .dataset import (
    DatasetWriter as DatasetWriter,
    generate_dataset as generate_dataset,
    load_dataset as load_dataset,
    render as render,
)
from .evaluation import (
    Campaign as Campaign,
    EvaluationSettings as EvaluationSettings,
    Run as Run,
    SamplingSettings as SamplingSettings,
    evaluate as evaluate,
    load_campaign as load_campaign,
    load_run as load_run,
    reach as reach,
    read_results as read_results,
    sample_grasps as sample_grasps,
)
from .export import export_scene as export_scene
from .generation import sample_scene as sample_scene, sample_scenes as sample_scenes
from .motion import (
    ArmReach as ArmReach,
    Plan as Plan,
    Planner as Planner,
    Reach as Reach,
    ReachSettings as ReachSettings,
    TimingSettings as TimingSettings,
    load_plan as load_plan,
    plan as plan,
)
from .objects import ObjectLibrary as ObjectLibrary, load_library as load_library
from .pipeline import (
    BuildReport as BuildReport,
    ObjectSource as ObjectSource,
    build_library as build_library,
)
from .printout import print_board as print_board
from .scene import (
    Scene as Scene,
    SceneLike as SceneLike,
    SceneRecipe as SceneRecipe,
    load_scene as load_scene,
    save_scene as save_scene,
)
from .simulation import (
    ArmTrial as ArmTrial,
    HandTrial as HandTrial,
    TrialResult as TrialResult,
    TrialSettings as TrialSettings,
    settle_scene as settle_scene,
)
from .station import (
    ENGINES as ENGINES,
    Engine as Engine,
    GraspMotion as GraspMotion,
    Station as Station,
    StationDiagram as StationDiagram,
    StationLike as StationLike,
    build_station_diagram as build_station_diagram,
    check_scene as check_scene,
    load_station as load_station,
)

__version__: str
