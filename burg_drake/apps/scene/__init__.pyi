from . import (
    printout as printout,
    setup as setup,
)
from .printout import require_pdf as require_pdf
from .references import (
    library_reference as library_reference,
    station_reference as station_reference,
)
from .verbs import add_to as add_to
