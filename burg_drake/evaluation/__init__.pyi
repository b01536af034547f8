from .campaign_folder import (
    Campaign as Campaign,
    SceneState as SceneState,
    SceneStates as SceneStates,
    is_campaign as is_campaign,
    load_campaign as load_campaign,
    load_runs as load_runs,
    open_results as open_results,
    read_results as read_results,
    save_campaign as save_campaign,
)
from .candidates import (
    INSTANCE_COLUMN as INSTANCE_COLUMN,
    TRIAL_FRICTION_COLUMN as TRIAL_FRICTION_COLUMN,
    Candidate as Candidate,
    Candidates as Candidates,
    chosen_instances as chosen_instances,
    given_candidates as given_candidates,
    rows_of_names as rows_of_names,
    select_instances as select_instances,
)
from .cascade import evaluate as evaluate
from .cluster.bundle import (
    Bundle as Bundle,
    load_bundle as load_bundle,
    make_bundle as make_bundle,
    require_same_content as require_same_content,
)
from .cluster.dask_executor import (
    DaskExecutor as DaskExecutor,
    connect_cluster as connect_cluster,
    map_on_cluster as map_on_cluster,
)
from .cluster.dispatch import send_bundle as send_bundle
from .cluster.document import (
    ClusterDocument as ClusterDocument,
    jobqueue_parameters as jobqueue_parameters,
    read_cluster as read_cluster,
    require_safe_address as require_safe_address,
)
from .cluster.jobs import ChunkSettings as ChunkSettings
from .cluster.members import (
    ClusterWorkers as ClusterWorkers,
    code_hash as code_hash,
    deciding_versions as deciding_versions,
    require_same_versions as require_same_versions,
    threads_by_address as threads_by_address,
)
from .cluster.node import (
    LOOPBACK as LOOPBACK,
    NO_DASHBOARD as NO_DASHBOARD,
    LocalNodes as LocalNodes,
)
from .cluster.unpacked_bundle import (
    BUNDLES_FOLDER as BUNDLES_FOLDER,
    JudgeRecipe as JudgeRecipe,
    bundle_folder as bundle_folder,
    unpack as unpack,
)
from .cluster.worker_tasks import (
    ChunkAnswers as ChunkAnswers,
    ClusterCall as ClusterCall,
    Supervisor as Supervisor,
    run_task as run_task,
)
from .executor import (
    Executor as Executor,
    Job as Job,
    JobFailed as JobFailed,
    JudgePool as JudgePool,
    LocalExecutor as LocalExecutor,
    OnFailure as OnFailure,
    WorkerLimits as WorkerLimits,
    judge_all as judge_all,
    keep_workers as keep_workers,
)
from .feasibility import (
    REACH_MARGIN_COLUMNS as REACH_MARGIN_COLUMNS,
    PlanFolder as PlanFolder,
    PlanFormat as PlanFormat,
    PlanOutput as PlanOutput,
    ReachJudgeFactory as ReachJudgeFactory,
    plan_into_folder as plan_into_folder,
    plans_document as plans_document,
    reach as reach,
    reach_columns as reach_columns,
)
from .grasp_sets.clear_counts import (
    ARM_LIMITS as ARM_LIMITS,
    GraspCount as GraspCount,
    clear_grasp_counts as clear_grasp_counts,
    count_grasps as count_grasps,
    grasp_counts as grasp_counts,
    object_grasps as object_grasps,
    within_reach as within_reach,
)
from .grasp_sets.given_grasps import (
    FRAME_WORDS as FRAME_WORDS,
    MAX_BOX_DISTANCE as MAX_BOX_DISTANCE,
    GivenGrasps as GivenGrasps,
    MisplacedGraspsError as MisplacedGraspsError,
    NoSceneIdsError as NoSceneIdsError,
    SeenScene as SeenScene,
    group_by_instance as group_by_instance,
    group_by_names as group_by_names,
    held_instances as held_instances,
    join_in_frame as join_in_frame,
    read_grasps as read_grasps,
    read_in_frame as read_in_frame,
    require_near as require_near,
)
from .grasp_sets.input import (
    RankedGrasps as RankedGrasps,
    best_of_each as best_of_each,
    format_name as format_name,
    grasp_index as grasp_index,
    hand_of as hand_of,
    hand_reference as hand_reference,
    rank_by_score as rank_by_score,
    rank_run_grasps as rank_run_grasps,
    read_input as read_input,
    result_column as result_column,
    run_grasps as run_grasps,
    shown_ids as shown_ids,
    station_reference as station_reference,
)
from .grasp_sets.mistake_search import (
    examine_grasps as examine_grasps,
    find_mistake as find_mistake,
    mistake_notes as mistake_notes,
    width_ratios as width_ratios,
)
from .grasp_sets.pose_mistakes import (
    FileReading as FileReading,
    Mistake as Mistake,
    MistakeFound as MistakeFound,
    correct_poses as correct_poses,
)
from .grasp_sets.sampled_sets import (
    SCENE_COLUMNS as SCENE_COLUMNS,
    sample_grasps as sample_grasps,
    sampled_set as sampled_set,
    scored_set as scored_set,
)
from .grasp_sets.sampling import (
    sample_candidates as sample_candidates,
    sample_library as sample_library,
    sample_on_scene as sample_on_scene,
    shortfall_note as shortfall_note,
)
from .journal import (
    JOURNAL_FILE as JOURNAL_FILE,
    Journal as Journal,
    JournalIndex as JournalIndex,
    WriterLock as WriterLock,
    decode_verdict as decode_verdict,
    encode_verdict as encode_verdict,
    hold_unchanged as hold_unchanged,
    is_locked as is_locked,
    journal_lines as journal_lines,
    read_journal as read_journal,
)
from .judge import (
    Decide as Decide,
    Decision as Decision,
    Judge as Judge,
    JudgingState as JudgingState,
    Screen as Screen,
    StationJudge as StationJudge,
    StationJudgeFactory as StationJudgeFactory,
    arm_settings as arm_settings,
    build_judge as build_judge,
    judge_grasp as judge_grasp,
    mode_for as mode_for,
    require_engine_for as require_engine_for,
    screen_grasps as screen_grasps,
    starting_note as starting_note,
    trial_verdict as trial_verdict,
)
from .labelling import (
    LABELLING_RUNS_FOLDER as LABELLING_RUNS_FOLDER,
    ObjectLabels as ObjectLabels,
    label_library as label_library,
)
from .many_scenes import campaign_document as campaign_document, read_scenes as read_scenes
from .outcome_counts import (
    MIN_PUSH as MIN_PUSH,
    OutcomeCounts as OutcomeCounts,
    Pushes as Pushes,
    StageCost as StageCost,
    Summary as Summary,
    count_pushes as count_pushes,
    count_short_lifts as count_short_lifts,
    member_codes as member_codes,
)
from .parallel_sampling import samples_in_parallel as samples_in_parallel
from .part_store import (
    PARTS_FOLDER as PARTS_FOLDER,
    PartWriter as PartWriter,
    read_journal_counts as read_journal_counts,
)
from .replay import (
    ReplayEngine as ReplayEngine,
    TrialInputs as TrialInputs,
    arm_figures as arm_figures,
    as_result as as_result,
    comparison as comparison,
    decisive_mode as decisive_mode,
    differences as differences,
    find_inputs as find_inputs,
    judge_of_trial as judge_of_trial,
    motion_figures as motion_figures,
    replay_engine as replay_engine,
    rerun as rerun,
)
from .report.failure_sections import (
    find_causes as find_causes,
    reachability_section as reachability_section,
    rows_of_run as rows_of_run,
)
from .report.grasp_sections import (
    FURTHER_MARGINS as FURTHER_MARGINS,
    further_margins as further_margins,
)
from .report.outcome_sections import STEP_LOSSES as STEP_LOSSES, worst_first as worst_first
from .report.page_elements import (
    GROUP_CLASSES as GROUP_CLASSES,
    command as command,
    folded_section as folded_section,
    header as header,
    html_page as html_page,
    number_cells as number_cells,
    section as section,
    style_sheet as style_sheet,
    table as table,
    tiles as tiles,
)
from .report.pages import (
    campaign_page as campaign_page,
    report_page as report_page,
    write_campaign_report as write_campaign_report,
    write_report as write_report,
)
from .report.pictures import (
    MAX_DRAWN_GRASPS as MAX_DRAWN_GRASPS,
    MAX_PICTURED_INSTANCES as MAX_PICTURED_INSTANCES,
    drawn_rows as drawn_rows,
)
from .report.reproduction import (
    repeat_section as repeat_section,
    reproduce_command as reproduce_command,
)
from .result_rows import ResultRows as ResultRows
from .results_table import (
    RANKING_CLEARANCE_STEP as RANKING_CLEARANCE_STEP,
    TEXT_COLUMNS as TEXT_COLUMNS,
    Columns as Columns,
    RecordedTrial as RecordedTrial,
    TextValues as TextValues,
    best_rows as best_rows,
    code_texts as code_texts,
    make_columns as make_columns,
    read_trial as read_trial,
    rows_of as rows_of,
    table_row as table_row,
    trial_columns as trial_columns,
)
from .robustness import (
    GraspRobustness as GraspRobustness,
    Robustness as Robustness,
    assess_robustness as assess_robustness,
    gather_answers as gather_answers,
    robustness_view as robustness_view,
)
from .robustness_probes import ProbeAnswer as ProbeAnswer
from .robustness_shares import (
    ROBUSTNESS_FILES as ROBUSTNESS_FILES,
    find_robustness_table as find_robustness_table,
    lifted_shares as lifted_shares,
)
from .run_document import (
    HASH_DIGITS as HASH_DIGITS,
    CampaignDocument as CampaignDocument,
    Grasps as Grasps,
    Input as Input,
    Library as Library,
    RunDocument as RunDocument,
    SceneEntry as SceneEntry,
    WorkSession as WorkSession,
    input_of as input_of,
    origin_of as origin_of,
    settings_numbers as settings_numbers,
)
from .run_folder import (
    REPORT_FILE as REPORT_FILE,
    RUN_FILE as RUN_FILE,
    Run as Run,
    StoredRun as StoredRun,
    create_run as create_run,
    load_run as load_run,
    require_run_folder as require_run_folder,
    save_run as save_run,
)
from .run_identity import (
    request_differences as request_differences,
    require_same_run as require_same_run,
    run_hash as run_hash,
)
from .run_merging import merge_folders as merge_folders, merge_runs as merge_runs
from .run_preparation import (
    GraspsLike as GraspsLike,
    RunRequest as RunRequest,
    current_command as current_command,
    given_content as given_content,
    given_correction as given_correction,
    sample_requested as sample_requested,
)
from .run_summary import (
    MotionRemedy as MotionRemedy,
    missing_grasps_note as missing_grasps_note,
    motion_remedy as motion_remedy,
    remedy_of_run as remedy_of_run,
    run_notes as run_notes,
    summarize as summarize,
    unclear_notes as unclear_notes,
    unmoved_notes as unmoved_notes,
)
from .scene_tasks import (
    FinishTask as FinishTask,
    Preparer as Preparer,
    PrepareTask as PrepareTask,
    SceneOutputs as SceneOutputs,
    SceneProcesses as SceneProcesses,
    SceneResultsWriter as SceneResultsWriter,
)
from .second_opinion import (
    judge_again as judge_again,
    require_second_engine as require_second_engine,
    settle_verdict as settle_verdict,
)
from .settings import (
    DEFAULT_BEST_COUNT as DEFAULT_BEST_COUNT,
    ROBUSTNESS_TESTS as ROBUSTNESS_TESTS,
    EvaluationSettings as EvaluationSettings,
    RobustnessSettings as RobustnessSettings,
    SamplingSettings as SamplingSettings,
    Shard as Shard,
    grasp_limits as grasp_limits,
)
from .status import RunWatch as RunWatch, Status as Status, read_status as read_status
from .summary_tables import SummaryView as SummaryView, summary_view as summary_view
from .table_file import (
    RUN_METADATA_KEY as RUN_METADATA_KEY,
    is_table as is_table,
    read_table as read_table,
    require_table as require_table,
    require_writer as require_writer,
    write_table as write_table,
)
from .table_parts import StoredRows as StoredRows, open_part as open_part, write_part as write_part
from .trial_origin import (
    MEASURE_NUMBERS as MEASURE_NUMBERS,
    TrialOrigin as TrialOrigin,
    engine_label as engine_label,
    limit_settings as limit_settings,
    limits_text as limits_text,
    motion_options as motion_options,
    motion_text as motion_text,
    read_motion as read_motion,
    read_origin as read_origin,
    read_trial_settings as read_trial_settings,
    require_lifts as require_lifts,
)
