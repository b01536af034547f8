"""Kinds of YAML documents, and the comment that tells editors the schema of a file."""

from __future__ import annotations

import pkgutil

from burg_drake.core.errors import UnknownNameError, suggest_names

SCHEMA_URL = "https://burg-drake.github.io/burg_drake/schema"
"""Address of the folder of published JSON Schemas."""

DOCUMENT_KINDS = {
    "scene": "burg_drake.scene.scene_document:SceneDocument",
    "station": "burg_drake.station.station_document:StationDocument",
    "hand": "burg_drake.station.hand_document:Hand",
    "objects": "burg_drake.pipeline.library_recipe:RecipeDocument",
    "library": "burg_drake.objects.library:LibraryDocument",
    "intrinsics": "burg_drake.cameras.intrinsics:Intrinsics",
    "pose": "burg_drake.core.documents:Pose",
    "depth_noise": "burg_drake.cameras.depth_camera_presets:DepthNoise",
    "trials": "burg_drake.experiment.trials.trial_sheet:TrialSheet",
    "cluster": "burg_drake.evaluation.cluster.document:ClusterDocument",
    "dataset_recipe": "burg_drake.dataset.recipe:DatasetRecipe",
    "dataset": "burg_drake.dataset.document:DatasetDocument",
    "sampled_scenes": "burg_drake.scene.scene_document:SamplingProvenance",
    "placement": "burg_drake.cameras.placement.document:PlacementCheck",
    "snapshot": "burg_drake.cameras.snapshot:SnapshotDocument",
    "recording": "burg_drake.cameras.recording:RecordingDocument",
    "run": "burg_drake.evaluation.run_document:RunDocument",
    "campaign": "burg_drake.evaluation.run_document:CampaignDocument",
    "plans": "burg_drake.evaluation.feasibility:PlansDocument",
    "suite": "burg_drake.benchmark.suite:SuiteDocument",
    "benchmark": "burg_drake.benchmark.benchmark_folder:BenchmarkDocument",
    "gap": "burg_drake.experiment.gap.gap_steps:GapDocument",
    "export": "burg_drake.export.scene_export:ExportRecord",
}
"""Dataclass of each kind of YAML document as MODULE:NAME, imported on demand."""


def document_class(kind: str) -> type:
    """The dataclass of a kind of document.

    Raises:
        UnknownNameError: there is no such kind.
    """
    if kind not in DOCUMENT_KINDS:
        raise UnknownNameError(
            f"there is no document {kind!r}; {suggest_names(kind, DOCUMENT_KINDS)}"
        )
    found: type = pkgutil.resolve_name(DOCUMENT_KINDS[kind])
    return found


def schema_line(document: object) -> str:
    """The comment that tells editors the schema of a document; "" if it has none."""
    place = f"{type(document).__module__}:{type(document).__qualname__}"
    for kind, where in DOCUMENT_KINDS.items():
        if where == place:
            return f"# yaml-language-server: $schema={SCHEMA_URL}/{kind}.json\n"
    return ""
