from .instance_label import (
    Box as Box,
    InstanceLabel as InstanceLabel,
)
from .instances import (
    box_around as box_around,
    label_instances as label_instances,
)
from .labelled_grasps import LabelledGrasps as LabelledGrasps
