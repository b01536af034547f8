from .landscape import PotentialLandscape as PotentialLandscape
from .mass import (
    DEFAULT_DENSITY as DEFAULT_DENSITY,
    Solid as Solid,
    implausible as implausible,
    mass_properties as mass_properties,
    solid_of_pieces as solid_of_pieces,
    solid_of_surface as solid_of_surface,
)
from .pose_classes import PoseClasses as PoseClasses
from .shell import solid_of_shell as solid_of_shell
from .stability import stable_poses as stable_poses
from .symmetry import (
    SymmetrySearch as SymmetrySearch,
    sample_surface as sample_surface,
    spread_over as spread_over,
)
