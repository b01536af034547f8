from .document import (
    DepthNoise as DepthNoise,
)
from .measurement import noisy_depth as noisy_depth
