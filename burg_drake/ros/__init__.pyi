from .board_node import BoardNode as BoardNode
from .distribution import (
    choose as choose,
    connect as connect,
)
from .link import (
    Names as Names,
    Parent as Parent,
)
from .loop import serve as serve
