from .calibration import confidence as confidence
from .grip_signs import GripLoad as GripLoad
