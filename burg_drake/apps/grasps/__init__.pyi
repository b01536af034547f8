from . import frames as frames
from .verbs import add_to as add_to
