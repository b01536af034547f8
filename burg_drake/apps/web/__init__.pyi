from .requests import (
    address as address,
    picture_number as picture_number,
)
from .server import (
    Answer as Answer,
    PageHandler as PageHandler,
    PageServer as PageServer,
)
