from .depth_file import read_depth as read_depth
from .device import open_devices as open_devices
from .frame import (
    CameraLost as CameraLost,
    Frame as Frame,
    FrameSource as FrameSource,
    Image as Image,
)
from .image_file import (
    decode_image as decode_image,
    read_image as read_image,
    require_image_format as require_image_format,
    write_image as write_image,
)
from .opencv_log import quiet as quiet
from .opening import (
    image_paths as image_paths,
    open_source as open_source,
)
