"""What a generated household object is: one frozen record of geometry, mass and colour."""

from __future__ import annotations

from dataclasses import dataclass

import trimesh


@dataclass(frozen=True)
class Shape:
    """A generated object, in its own frame O (z up, lengths in metres).

    Attributes:
        name: Name of the library entry.
        description: One line for people.
        mesh: Closed surface with outward winding, in frame O; each face has a colour.
        pieces: Convex meshes in frame O whose union stands for the mesh in contact.
        mass: Mass [kg].
        rgba: Main colour, with opacity, each 0 to 1.
        notes: What the object resembles, and where its mass comes from.
    """

    name: str
    description: str
    mesh: trimesh.Trimesh
    pieces: tuple[trimesh.Trimesh, ...]
    mass: float
    rgba: tuple[float, float, float, float]
    notes: str = ""
