"""Grasps: files of many formats, sampling on a mesh, clearance, quality and comparison of sets."""

from burg_drake.evaluation.grasp_sets import (
    FileReading as FileReading,
    GivenGrasps as GivenGrasps,
    Mistake as Mistake,
    MistakeFound as MistakeFound,
    find_mistake as find_mistake,
    read_grasps as read_grasps,
    scored_set as scored_set,
)
from burg_drake.formats import (
    read_grasp_file as read_grasp_file,
    write_grasp_file as write_grasp_file,
)
from burg_drake.formats.common import (
    Gripper as Gripper,
    GripperJoint as GripperJoint,
    ImportedGrasps as ImportedGrasps,
)
from burg_drake.grasping.clearance import (
    Clearance as Clearance,
    ClearanceBatch as ClearanceBatch,
    HandClearance as HandClearance,
    hand_clearance_alone as hand_clearance_alone,
)
from burg_drake.grasping.comparison import (
    Distribution as Distribution,
    Matches as Matches,
    ObjectComparison as ObjectComparison,
    ObjectSummary as ObjectSummary,
    SetComparison as SetComparison,
    SetSummary as SetSummary,
    Share as Share,
    TopPrecision as TopPrecision,
    compare_grasps as compare_grasps,
    coverage as coverage,
    graspnet_ap as graspnet_ap,
    precision as precision,
    summarize as summarize,
)
from burg_drake.grasping.sampling import (
    AntipodalSettings as AntipodalSettings,
    ApproachCone as ApproachCone,
    sample_antipodal as sample_antipodal,
)
from burg_drake.grasping.similarity import (
    Tolerance as Tolerance,
    farthest_points as farthest_points,
)
