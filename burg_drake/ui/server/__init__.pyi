from .door import (
    Door as Door,
    require_viser as require_viser,
    serve as serve,
)
