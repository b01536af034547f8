from .friction_search import (
    friction_limit as friction_limit,
)
from .grip import take_grip as take_grip
from .hold_force import (
    AXES as AXES,
    DIRECTIONS as DIRECTIONS,
    HoldForces as HoldForces,
    shake as shake,
    tug as tug,
)
from .perturbation import (
    SuccessRate as SuccessRate,
    perturb as perturb,
)
from .settings import (
    FrictionSettings as FrictionSettings,
    LoadSettings as LoadSettings,
    Noise as Noise,
)
