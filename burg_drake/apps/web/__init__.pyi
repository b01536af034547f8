from .requests import (
    address as address,
    json_body as json_body,
    picture_number as picture_number,
)
