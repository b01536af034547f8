from .friction_search import (
    FrictionSettings as FrictionSettings,
    friction_limit as friction_limit,
)
from .grip import take_grip as take_grip
from .hold_force import (
    AXES as AXES,
    DIRECTIONS as DIRECTIONS,
    HoldForces as HoldForces,
    LoadSettings as LoadSettings,
    shake as shake,
    tug as tug,
)
from .perturbation import (
    Noise as Noise,
    SuccessRate as SuccessRate,
    perturb as perturb,
)
