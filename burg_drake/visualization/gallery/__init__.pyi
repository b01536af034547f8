from .grasp_frames import show_frames as show_frames
from .library import show_library as show_library
from .with_grasps import show_with_grasps as show_with_grasps
