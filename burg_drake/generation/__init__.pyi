from .folder import SceneRow as SceneRow
from .many import (
    SampledFolder as SampledFolder,
    sample_scenes as sample_scenes,
)
from .reproduction import (
    ReproducedScene as ReproducedScene,
    sample_again as sample_again,
)
from .sample import (
    SampledScene as SampledScene,
    SceneSampler as SceneSampler,
)
