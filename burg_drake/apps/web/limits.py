"""What the small servers bound, for options that tell it."""

MOST_CONNECTIONS = 32
"""At a time, each with a thread of its own, if not told otherwise; a browser takes two to six."""
