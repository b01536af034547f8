from .door import (
    PageServer as PageServer,
    require_viser as require_viser,
    serve as serve,
)
