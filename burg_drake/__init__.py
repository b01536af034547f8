"""Reproducible robot-grasping scenes and reachability-aware grasp evaluation on Drake.

The names below are the public entry points; each is imported from its room on first use, so that
importing the package stays instantaneous.
"""

from __future__ import annotations

from burg_drake.core.lazy import attach

__version__ = "0.1.0"

__all__, __getattr__, __dir__ = attach(
    __name__,
    {
        "burg_drake.cameras.board_estimate": ["BoardEstimate"],
        "burg_drake.cameras.board_loop": ["build_board_loop"],
        "burg_drake.cameras.board_pose": ["BoardPose", "estimate_board"],
        "burg_drake.cameras.board_pose_estimator": ["BoardPoseEstimator"],
        "burg_drake.cameras.calibration": ["calibrate"],
        "burg_drake.cameras.intrinsics": ["Intrinsics"],
        "burg_drake.cameras.intrinsics_file": ["load_intrinsics"],
        "burg_drake.cameras.locate": ["locate_camera"],
        "burg_drake.cameras.overlay": ["Overlay"],
        "burg_drake.cameras.overlay_style": ["OverlayStyle"],
        "burg_drake.cameras.placement": ["check_placement"],
        "burg_drake.cameras.placement_document": ["PlacementCheck", "load_placement"],
        "burg_drake.cameras.pose_filter": ["PoseFilter"],
        "burg_drake.cameras.scene_overlay": ["SceneOverlay"],
        "burg_drake.cameras.snapshot": ["load_snapshot"],
        "burg_drake.cameras.sources": ["open_source"],
        "burg_drake.core.errors": ["BurgError"],
        "burg_drake.core.grasps": ["GraspSet"],
        "burg_drake.core.outcome": ["Outcome", "Stage"],
        "burg_drake.evaluation.candidate_files": ["read_grasps"],
        "burg_drake.evaluation.cascade": ["evaluate"],
        "burg_drake.evaluation.probes": ["RobustnessSettings"],
        "burg_drake.evaluation.feasibility": ["reach"],
        "burg_drake.evaluation.robustness": ["assess_robustness"],
        "burg_drake.evaluation.run_store": ["Run", "load_run"],
        "burg_drake.evaluation.sampled_set": ["sample_grasps"],
        "burg_drake.evaluation.sampling_settings": ["SamplingSettings"],
        "burg_drake.evaluation.scored_set": ["scored_set"],
        "burg_drake.export.export": ["export_scene"],
        "burg_drake.formats.grasp_files": ["read_grasp_file", "write_grasp_file"],
        "burg_drake.grasping.approach": ["ApproachCone"],
        "burg_drake.grasping.antipodal": ["sample_antipodal"],
        "burg_drake.grasping.average_precision": ["graspnet_ap"],
        "burg_drake.grasping.clearance": ["HandClearance", "hand_clearance_alone"],
        "burg_drake.grasping.comparison": ["compare", "summarize"],
        "burg_drake.grasping.coverage": ["coverage", "precision"],
        "burg_drake.grasping.diversity": ["farthest_points"],
        "burg_drake.motion.plan": ["Planner", "plan"],
        "burg_drake.motion.plan_file": ["load_plan"],
        "burg_drake.motion.reach": ["ArmReach", "Reach"],
        "burg_drake.motion.reach_settings": ["ReachSettings"],
        "burg_drake.motion.reachability": [
            "ReachabilityMap",
            "ReachabilitySettings",
            "map_reachability",
        ],
        "burg_drake.motion.station_check": ["inspect_station"],
        "burg_drake.motion.timing_settings": ["TimingSettings"],
        "burg_drake.motion.trajectory": ["Plan", "Trajectory"],
        "burg_drake.pipeline.build": ["build_library"],
        "burg_drake.printout.board_printout": ["PrintSettings", "print_board"],
        "burg_drake.objects.library": ["load_library"],
        "burg_drake.scene.scene": ["load_scene"],
        "burg_drake.scene.validate": ["validate_scene"],
        "burg_drake.simulation.arm_trial": ["ArmTrial"],
        "burg_drake.simulation.friction_limit": ["FrictionSettings", "friction_limit"],
        "burg_drake.simulation.grip": ["Grip", "take_grip"],
        "burg_drake.simulation.hand_trial": ["HandTrial"],
        "burg_drake.simulation.hold_force": ["LoadSettings", "shake", "tug"],
        "burg_drake.simulation.perturbation": ["Noise", "success_rate"],
        "burg_drake.simulation.settle_scene": ["settle_scene"],
        "burg_drake.station.check": ["check_scene"],
        "burg_drake.station.scene_check": ["SceneCheck"],
        "burg_drake.station.diagram": ["build_station_diagram"],
        "burg_drake.station.engine": ["ENGINES", "Engine"],
        "burg_drake.station.grasp_motion": ["GraspMotion"],
        "burg_drake.station.station": ["load_station"],
    },
)
