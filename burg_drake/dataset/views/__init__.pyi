from .view import (
    DEPTH_RANGE as DEPTH_RANGE,
    View as View,
)
