from . import (
    printout as printout,
    setup as setup,
)
from .printout import require_pdf as require_pdf
from .verbs import add_to as add_to
