from .requests import (
    address as address,
    picture_number as picture_number,
)
from .server import (
    MOST_CONNECTIONS as MOST_CONNECTIONS,
    Handler as Handler,
    PageHandler as PageHandler,
    PageServer as PageServer,
)
