from .comparison.agreement_between_runs import (
    MarginDifference as MarginDifference,
    PartedGrasp as PartedGrasp,
    RunAgreement as RunAgreement,
    assess_run_agreement as assess_run_agreement,
)
from .comparison.compared_runs import (
    TRIAL_SETTING_UNITS as TRIAL_SETTING_UNITS,
    Side as Side,
    unpredictable_outcomes as unpredictable_outcomes,
)
from .comparison.comparison import (
    Comparison as Comparison,
    Coverage as Coverage,
    bias_sentence as bias_sentence,
    comparison_json as comparison_json,
    headline_sentence as headline_sentence,
)
from .comparison.comparison_findings import comparison_tables as comparison_tables
from .comparison.comparison_report import comparison_page as comparison_page
from .comparison.confusion_matrix import (
    AGREEMENT_MEASURES as AGREEMENT_MEASURES,
    CELL_PRIOR as CELL_PRIOR,
    Agreement as Agreement,
    Estimate as Estimate,
    Paired as Paired,
    _compute_measures as _compute_measures,
    compare_paired as compare_paired,
    compare_paired_counts as compare_paired_counts,
    count_cells as count_cells,
    count_cells_by_group as count_cells_by_group,
    distribute_prior as distribute_prior,
    estimate_agreement as estimate_agreement,
    estimate_agreements as estimate_agreements,
    interval_bounds as interval_bounds,
)
from .comparison.group_agreement import (
    FactorGroup as FactorGroup,
    OutlierGroup as OutlierGroup,
    Stopped as Stopped,
    excess_p_value as excess_p_value,
    find_outlier_groups as find_outlier_groups,
    holm_correction as holm_correction,
)
from .comparison.judge_assessment import (
    PLACEMENT_LIMIT_MM as PLACEMENT_LIMIT_MM,
    Disagreement as Disagreement,
    Judgement as Judgement,
    PlacementAgreement as PlacementAgreement,
    Unpredictable as Unpredictable,
    assess_judge as assess_judge,
)
from .comparison.margin_calibration import (
    PREDICTOR_COLUMNS as PREDICTOR_COLUMNS,
    Bin as Bin,
    IsotonicStep as IsotonicStep,
    MarginCalibration as MarginCalibration,
    OrderedTrials as OrderedTrials,
    calibrate_margin as calibrate_margin,
    calibrate_margins as calibrate_margins,
    estimate_auroc as estimate_auroc,
)
from .comparison.result_table import (
    GRASP_CONTENT_COLUMNS as GRASP_CONTENT_COLUMNS,
    IdColumn as IdColumn,
    ResultTable as ResultTable,
    TextFactor as TextFactor,
    match_rows as match_rows,
    text_keys as text_keys,
)
from .comparison.run_comparison import (
    SUCCESS_CRITERIA as SUCCESS_CRITERIA,
    compare as compare,
    pair_runs as pair_runs,
)
from .comparison.verdict_pairs import (
    PREDICTION_COLUMNS as PREDICTION_COLUMNS,
    REFERENCE_COLUMNS as REFERENCE_COLUMNS,
    VerdictPairs as VerdictPairs,
)
from .gap.displaced_scenes import (
    PlacementNoise as PlacementNoise,
    candidates_as_commanded as candidates_as_commanded,
    correct_height_and_tilt as correct_height_and_tilt,
    displaced_scene as displaced_scene,
    grasps_as_commanded as grasps_as_commanded,
    measured_scene as measured_scene,
    move_on_board as move_on_board,
    noisy_scene as noisy_scene,
)
from .gap.gap_measurement import measure_gap as measure_gap
from .gap.gap_report import (
    GAP_REPORT_FILE as GAP_REPORT_FILE,
    change_section as change_section,
    gap_page as gap_page,
    push_section as push_section,
    write_gap_report as write_gap_report,
)
from .gap.gap_steps import (
    Change as Change,
    GapDocument as GapDocument,
    GapSettings as GapSettings,
    GapStep as GapStep,
    GapSteps as GapSteps,
    OutcomeChange as OutcomeChange,
    agreement_by_step as agreement_by_step,
    gap_changes as gap_changes,
    trials_of_run as trials_of_run,
)
from .gap.gap_words import (
    gap_json as gap_json,
    reality_sentence as reality_sentence,
    reality_table as reality_table,
    step_sentences as step_sentences,
    steps_view as steps_view,
)
from .gap.rejudging import (
    Rejudged as Rejudged,
    Rejudging as Rejudging,
    match_runs_to_sources as match_runs_to_sources,
    rejudge as rejudge,
    rejudging_json as rejudging_json,
)
from .gap.rejudging_report import (
    rejudged_section as rejudged_section,
    rejudged_sentences as rejudged_sentences,
    rejudged_view as rejudged_view,
)
from .lab.lab_book import (
    LabBook as LabBook,
    LabEntry as LabEntry,
    entry_data as entry_data,
    entry_states as entry_states,
    plan_data as plan_data,
    trial_state_hash as trial_state_hash,
)
from .lab.lab_camera import LabCamera as LabCamera
from .lab.painters import HAND_BODY as HAND_BODY, NO_BODY as NO_BODY
from .lab.protocol import ProtocolOptions as ProtocolOptions, protocol_page as protocol_page
from .lab.trial_pictures import (
    TARGET_RIM_COLOR as TARGET_RIM_COLOR,
    PictureCache as PictureCache,
    TrialPictures as TrialPictures,
)
from .lab.tried_grasps import (
    MAIN_OUTCOMES as MAIN_OUTCOMES,
    TriedRuns as TriedRuns,
    approach_text as approach_text,
    closing_text as closing_text,
    trials_by_block as trials_by_block,
)
from .trials.grasp_selection import allocate_to_strata as allocate_to_strata
from .trials.motion_export import (
    MOTION_INDEX_FILE as MOTION_INDEX_FILE,
    ExportedMotion as ExportedMotion,
    export_trials as export_trials,
)
from .trials.sheet_text import SheetText as SheetText
from .trials.source_runs import (
    grasp_content as grasp_content,
    grasp_contents as grasp_contents,
    load_source_run as load_source_run,
    load_sources as load_sources,
    make_source_run as make_source_run,
    trial_rows as trial_rows,
)
from .trials.statistical_power import (
    detectable_difference_sentence as detectable_difference_sentence,
    effective_trials as effective_trials,
    expected_estimates as expected_estimates,
    half_width as half_width,
    mcnemar_power as mcnemar_power,
    power_table as power_table,
    smallest_difference as smallest_difference,
)
from .trials.trial_book import (
    Entry as Entry,
    MissingValues as MissingValues,
    TrialBook as TrialBook,
    TrialChanged as TrialChanged,
    journal_path as journal_path,
    lock_trials_file as lock_trials_file,
    parse_real_outcome as parse_real_outcome,
    read_entries as read_entries,
)
from .trials.trial_photos import (
    measure_placement as measure_placement,
    require_scene_of_trial as require_scene_of_trial,
    save_photo_and_placement as save_photo_and_placement,
    summarize_placements as summarize_placements,
)
from .trials.trial_plan import SelectionSettings as SelectionSettings, plan_trials as plan_trials
from .trials.trial_sheet import (
    ObjectPlace as ObjectPlace,
    RealTrial as RealTrial,
    RobotReport as RobotReport,
    Selection as Selection,
    SourceRun as SourceRun,
    Stratum as Stratum,
    Success as Success,
    TrialSheet as TrialSheet,
    is_success as is_success,
    load_trials as load_trials,
    save_trials as save_trials,
)
