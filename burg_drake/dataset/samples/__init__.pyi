from .check import (
    DatasetFinding as DatasetFinding,
    check_dataset as check_dataset,
)
from .dataset import (
    Dataset as Dataset,
    load_dataset as load_dataset,
)
from .document import (
    FILE as FILE,
    DatasetDocument as DatasetDocument,
    load_dataset_document as load_dataset_document,
)
from .png import (
    depth_unit_of as depth_unit_of,
    encode_image as encode_image,
    encode_png as encode_png,
)
from .readable import ReadableSamples as ReadableSamples
from .sample import Sample as Sample
from .shard import (
    ShardEntry as ShardEntry,
    shard_name as shard_name,
    write_shard as write_shard,
)
from .tar import (
    TAR_END as TAR_END,
    tar_member as tar_member,
)
from .writer import (
    DatasetWriter as DatasetWriter,
    write_made_scene as write_made_scene,
    write_scene as write_scene,
)
