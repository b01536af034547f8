from .heap_settling import settle_heap as settle_heap
from .scene_folder import (
    SampledFolder as SampledFolder,
    SceneRow as SceneRow,
    sample_scenes as sample_scenes,
)
from .scene_sampling import (
    ReproducedScene as ReproducedScene,
    SampledScene as SampledScene,
    SceneSampler as SceneSampler,
    attempts_with_same_objects as attempts_with_same_objects,
    convert_drake_errors as convert_drake_errors,
    kept_sampler as kept_sampler,
    sample_again as sample_again,
    sample_scene as sample_scene,
)
