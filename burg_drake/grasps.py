"""Grasps: files of many formats, sampling on a mesh, clearance, quality and comparison of sets."""

from burg_drake.evaluation import (
    FileReading as FileReading,
    GivenGrasps as GivenGrasps,
    Mistake as Mistake,
    MistakeFound as MistakeFound,
    ObjectLabels as ObjectLabels,
    find_mistake as find_mistake,
    label_library as label_library,
    read_grasps as read_grasps,
    scored_set as scored_set,
)
from burg_drake.formats import (
    Gripper as Gripper,
    GripperJoint as GripperJoint,
    ImportedGrasps as ImportedGrasps,
    read_grasp_file as read_grasp_file,
    write_grasp_file as write_grasp_file,
)
from burg_drake.grasping import (
    AntipodalSettings as AntipodalSettings,
    ApproachCone as ApproachCone,
    Clearance as Clearance,
    ClearanceBatch as ClearanceBatch,
    Distribution as Distribution,
    HandClearance as HandClearance,
    Matches as Matches,
    ObjectComparison as ObjectComparison,
    ObjectSummary as ObjectSummary,
    SetComparison as SetComparison,
    SetSummary as SetSummary,
    Share as Share,
    Tolerance as Tolerance,
    TopPrecision as TopPrecision,
    compare_grasps as compare_grasps,
    coverage as coverage,
    farthest_points as farthest_points,
    graspnet_ap as graspnet_ap,
    hand_clearance_alone as hand_clearance_alone,
    precision as precision,
    sample_antipodal as sample_antipodal,
    summarize as summarize,
)
