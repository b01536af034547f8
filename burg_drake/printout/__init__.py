"""The printable board: height map of a scene, markers at true scale, pages."""
