from .pages import (
    Guide as Guide,
    draw_guide as draw_guide,
)
from .steps import (
    BoardFacts as BoardFacts,
    guide_steps as guide_steps,
)
