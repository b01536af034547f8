from .limits import MOST_CONNECTIONS as MOST_CONNECTIONS
from .requests import (
    address as address,
    picture_number as picture_number,
)
from .server import (
    Handler as Handler,
    PageHandler as PageHandler,
    PageServer as PageServer,
)
