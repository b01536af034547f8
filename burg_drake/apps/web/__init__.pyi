from .requests import (
    address as address,
    json_body as json_body,
    picture_number as picture_number,
)
from .server import (
    Handler as Handler,
    PageHandler as PageHandler,
    PageServer as PageServer,
)
