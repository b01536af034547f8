"""The kinds of YAML documents, and the line of a file by which editors find its schema."""

from __future__ import annotations

import pkgutil

from burg_drake.core.errors import UnknownNameError, nearest

SCHEMA_FOLDER = "https://burg-drake.github.io/burg_drake/schema"

DOCUMENT_KINDS = {
    "scene": "burg_drake.scene.document.scene:SceneDocument",
    "station": "burg_drake.station.document.station_document:StationDocument",
    "hand": "burg_drake.station.document.gripper_document:Hand",
    "objects": "burg_drake.pipeline.recipe:RecipeDocument",
    "library": "burg_drake.objects.library.document:LibraryDocument",
    "intrinsics": "burg_drake.cameras.optics.intrinsics:Intrinsics",
    "pose": "burg_drake.core.documents.schema:Pose",
    "depth_noise": "burg_drake.cameras.noise.document:DepthNoise",
    "trials": "burg_drake.experiment.trials.sheet:TrialSheet",
    "cluster": "burg_drake.evaluation.cluster.document:ClusterDocument",
    "dataset_recipe": "burg_drake.dataset.generating.recipe:DatasetRecipe",
    "dataset": "burg_drake.dataset.samples.document:DatasetDocument",
    "sampled_scenes": "burg_drake.scene.document.origin:SamplingProvenance",
    "placement": "burg_drake.cameras.placement.document:PlacementCheck",
    "snapshot": "burg_drake.cameras.live.snapshot:SnapshotDocument",
    "recording": "burg_drake.cameras.live.recording:RecordingDocument",
    "run": "burg_drake.evaluation.records.run_document:RunDocument",
    "campaign": "burg_drake.evaluation.records.campaign_document:CampaignDocument",
    "plans": "burg_drake.evaluation.store.plan_folder:PlansDocument",
    "gap": "burg_drake.experiment.gap.steps:GapDocument",
    "export": "burg_drake.export.folder:ExportRecord",
}
"""The dataclass of each kind of YAML document, by module and name: importing all takes long."""


def document_class(kind: str) -> type:
    """The dataclass of a kind of document.

    Raises:
        UnknownNameError: there is no such kind.
    """
    if kind not in DOCUMENT_KINDS:
        raise UnknownNameError(f"there is no document {kind!r}; {nearest(kind, DOCUMENT_KINDS)}")
    found: type = pkgutil.resolve_name(DOCUMENT_KINDS[kind])
    return found


def schema_line(document: object) -> str:
    """The comment by which editors find the schema of a document; "" if it has none."""
    place = f"{type(document).__module__}:{type(document).__qualname__}"
    for kind, where in DOCUMENT_KINDS.items():
        if where == place:
            return f"# yaml-language-server: $schema={SCHEMA_FOLDER}/{kind}.json\n"
    return ""
