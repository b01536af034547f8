from .renderer import Overlay as Overlay
from .style import OverlayStyle as OverlayStyle
from .tag_layout import write_tags as write_tags
from .text_tags import (
    notice as notice,
    tag as tag,
)
