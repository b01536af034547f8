"""Builds object libraries: repaired, decomposed, confirmed in simulation, cached, checked."""
