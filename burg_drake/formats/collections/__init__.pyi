from .burg_library import (
    BurgLibrary as BurgLibrary,
    BurgObject as BurgObject,
    read_burg_library as read_burg_library,
)
from .burg_scene import (
    BurgInstance as BurgInstance,
    BurgScene as BurgScene,
    read_burg_scene as read_burg_scene,
)
from .ycb import (
    YcbObject as YcbObject,
    find_ycb as find_ycb,
)
