from .board_node import BoardNode as BoardNode
from .distribution import (
    CLIENTS as CLIENTS,
    ROS_1_HINT as ROS_1_HINT,
    ROS_2_HINT as ROS_2_HINT,
    SYSTEM_PACKAGES as SYSTEM_PACKAGES,
    choose as choose,
    connect as connect,
)
from .link import (
    Names as Names,
    Parent as Parent,
)
from .loop import serve as serve
