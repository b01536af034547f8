from .images import (
    SURROUNDINGS as SURROUNDINGS,
    Images as Images,
)
