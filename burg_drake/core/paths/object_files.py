"""What the meshes in an object's folder of a library are called.

Whoever reads a path to one of them tells by the name that the object is called like its folder.
"""

MESH_FILE = "mesh.obj"
SURFACE_FILE = "surface.obj"
"""The surface that is touched, where it is not that of the mesh."""
