from .renderer import Overlay as Overlay
from .style import OverlayStyle as OverlayStyle
from .tag_layout import lay_out as lay_out
from .text_tags import (
    notice as notice,
    paste as paste,
    tag as tag,
)
