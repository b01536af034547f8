from . import (
    compare as compare,
    gap as gap,
)
