from .buttons import (
    picture_button as picture_button,
    quiet_button as quiet_button,
    show_picture as show_picture,
    strong_button as strong_button,
    upload_button as upload_button,
)
from .dialogs import confirm as confirm
from .page_actions import PageActions as PageActions
from .scene_files import scene_names as scene_names
from .shortcuts import (
    ActionCall as ActionCall,
    KeysDialog as KeysDialog,
    register as register,
)
from .status_colors import (
    FIXED as FIXED,
    STATUS_STYLES as STATUS_STYLES,
    Rgb8 as Rgb8,
    style_of as style_of,
)
from .texts import (
    all_of as all_of,
    box as box,
    counted as counted,
    dot as dot,
    head as head,
    listing as listing,
    notice as notice,
    quiet as quiet,
    status_chip as status_chip,
    table as table,
    title as title,
)
from .typed_field import NAME_TYPING_DELAY as NAME_TYPING_DELAY
