from .arm_replay import record_arm_trial as record_arm_trial
from .replay import (
    describe as describe,
    record_trial as record_trial,
)
from .scene import (
    aim_camera as aim_camera,
    open_meshcat as open_meshcat,
    scene_points as scene_points,
    show_scene as show_scene,
)
from .station import show_station as show_station
