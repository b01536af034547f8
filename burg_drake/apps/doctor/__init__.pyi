from .verb import add_to as add_to
