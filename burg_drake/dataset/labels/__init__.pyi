from .instance_label import (
    Box as Box,
    InstanceLabel as InstanceLabel,
)
from .labelled_grasps import LabelledGrasps as LabelledGrasps
