from .arm_reach import ArmReach as ArmReach
from .lift_height import lift_heights as lift_heights
from .verdict import Reach as Reach
from .witness import Witness as Witness
