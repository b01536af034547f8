"""Meshes to sim-ready objects: repair, mass properties, convex pieces, SDF, stable poses."""
