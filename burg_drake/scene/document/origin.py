"""How a scene was made, so that it can be made again."""

from __future__ import annotations

from dataclasses import dataclass, field

from burg_drake.scene.document.recipe import SceneRecipe

DECIDING_VERSIONS = ("burg_drake", "drake", "numpy", "scipy")
"""Software whose versions decide about scenes."""


@dataclass(frozen=True, kw_only=True)
class SamplingProvenance:
    """What all scenes of a folder were sampled with (`recipe.yaml`).

    Attributes:
        recipe: how scenes are drawn.
        library_content: hash of the library's objects.
        station_content: hash of the station.
        versions: versions of the software and the machine.
    """

    version: int = 1
    recipe: SceneRecipe
    library_content: str
    station_content: str
    versions: dict[str, str] = field(default_factory=dict)

    def differences(self, other: SamplingProvenance) -> list[str]:
        """What two differ in, in words; `other` is here, this is there. Of a library or a station
        its content counts, not where it is, and of the versions those in `DECIDING_VERSIONS`."""
        found = []
        for name, mine in vars(self.recipe).items():
            theirs = getattr(other.recipe, name)
            if name not in ("library", "station") and mine != theirs:
                found.append(
                    f"{name.replace('_', ' ')} is {_shown(mine)} there, {_shown(theirs)} here"
                )
        for name in ("library", "station"):
            mine, theirs = (getattr(one, f"{name}_content") for one in (self, other))
            if mine != theirs:
                found.append(f"the {name} has content {mine} there, {theirs} here")
        for name in DECIDING_VERSIONS:
            mine, theirs = (one.versions.get(name, "unknown") for one in (self, other))
            if mine != theirs:
                found.append(f"{name} is {mine} there, {theirs} here")
        return found


@dataclass(frozen=True, kw_only=True)
class SceneOrigin(SamplingProvenance):
    """How one scene was sampled.

    Attributes:
        number: number of the scene in its folder.
        attempt: number of the accepted draft, from 1.
    """

    number: int
    attempt: int


def _shown(value: object) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(str, value)) or "none"
    if isinstance(value, bool):
        return "on" if value else "off"
    size = getattr(value, "size", None)
    if isinstance(size, tuple):
        return f"{1e3 * size[0]:g} x {1e3 * size[1]:g} mm with {getattr(value, 'markers', '')}"
    return str(value) or "none"
