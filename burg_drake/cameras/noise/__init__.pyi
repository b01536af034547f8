from .document import (
    DepthNoise as DepthNoise,
    depth_noise as depth_noise,
)
from .measurement import noisy_depth as noisy_depth
