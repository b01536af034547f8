from .door import (
    ServedPage as ServedPage,
    require_viser as require_viser,
    serve as serve,
)
