from . import render as render
from .verbs import add_to as add_to
