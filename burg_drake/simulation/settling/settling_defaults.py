"""How objects are let fall unless told otherwise; apart, as a help text needs no simulation."""

SETTLING_TIME = 10.0
"""Simulated time allowed until all is at rest [s]."""
SETTLING_ENGINE = "screening"
"""How time is stepped while objects fall; they come to rest in steps of their own."""
