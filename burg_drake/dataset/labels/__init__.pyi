from .instance_label import (
    Box as Box,
    InstanceLabel as InstanceLabel,
)
from .labelled_grasps import LabelledGrasps as LabelledGrasps
from .run_length import (
    decode_mask as decode_mask,
    encode_mask as encode_mask,
)
