from .appearance import (
    Appearance as Appearance,
    DirectedLight as DirectedLight,
    Distractor as Distractor,
    Photometry as Photometry,
    TableSurface as TableSurface,
    read_appearance as read_appearance,
)
from .background import (
    over_background as over_background,
    with_background as with_background,
)
from .distractors import distractor_boxes as distractor_boxes
from .drawing import draw_appearance as draw_appearance
from .photometry import (
    linear_from_srgb as linear_from_srgb,
    photometric as photometric,
)
from .rendering import (
    apply_appearance as apply_appearance,
    environment_file as environment_file,
    place_appearance as place_appearance,
)
from .settings import AppearanceSettings as AppearanceSettings
