from .admission import (
    MAX_ALL_UPLOADS_BYTES as MAX_ALL_UPLOADS_BYTES,
    MAX_UPLOAD_BYTES as MAX_UPLOAD_BYTES,
)
from .background_pictures import ObjectPictures as ObjectPictures
from .board_panels import LivePicture as LivePicture
from .board_view import sheet_picture as sheet_picture
from .check_panels import issues_html as issues_html
from .gizmo import Handle as Handle, PageCamera as PageCamera, handle_under as handle_under
from .guarded_viser import (
    MAX_MESSAGE_BYTES as MAX_MESSAGE_BYTES,
    MESSAGE_BURST as MESSAGE_BURST,
    MESSAGE_RATE as MESSAGE_RATE,
)
from .page_actions import ActionQueue as ActionQueue, TypedField as TypedField
from .page_server import (
    ServedPage as ServedPage,
    require_guarded as require_guarded,
    require_viser as require_viser,
    serve_page as serve_page,
)
from .panel_parts import (
    STATUS_STYLES as STATUS_STYLES,
    html_table as html_table,
    notice_html as notice_html,
    paragraph as paragraph,
)
from .scene_panels import scene_names as scene_names
from .scene_view import footprint as footprint
from .setup_page import SetupPage as SetupPage
from .shortcuts import SHORTCUTS as SHORTCUTS, shortcut_list_html as shortcut_list_html
from .viewpoints import (
    FRONT_FOV as FRONT_FOV,
    TOP_FOV as TOP_FOV,
    direction_to_camera as direction_to_camera,
    viewpoint as viewpoint,
)
