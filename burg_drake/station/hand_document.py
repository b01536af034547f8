"""The hand document: description of a parallel hand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from burg_drake.core import (
    NO_PACKAGES,
    Array,
    FieldError,
    Packages,
    Pose,
    UnknownNameError,
    inverse,
    load_document,
    referenced_packages,
    require_name,
    resolve_reference,
)


@dataclass(frozen=True, kw_only=True)
class Finger:
    """A finger of a parallel hand.

    Attributes:
        body: link of the finger in the hand's model.
        joint: prismatic joint that moves the finger. For hands whose fingers turn see
            https://burg-drake.github.io/burg_drake/reference/hands.html.
        pad: name of the collision geometry that touches objects.
        closed: joint position at the smallest distance of the pads [m].
        open: joint position at the largest distance of the pads [m].
    """

    body: str
    joint: str
    pad: str
    closed: float
    open: float

    def position(self, closed: float) -> float:
        """Joint position [m] by how far the finger is closed, from 0 (open) to 1."""
        return self.open + closed * (self.closed - self.open)


@dataclass(frozen=True, kw_only=True)
class Hand:
    """A parallel hand.

    Attributes:
        name: name of the hand. Letters, digits, `_`, `-` and `.`.
        description: text for people.
        source: where the figures are from.
        model: model of the hand (URDF or SDF): `package://` address, or path relative to this file.
        body: link that the arm carries; its frame is H.
        X_HG: pose of the grasp frame in H: midway between the pads, +z along the approach, +x along
            the closing direction.
        opening: smallest and largest distance between the pads [m].
        force: force of each finger on the object while gripping [N].
        closing_speed: speed of each finger while closing [m/s].
        coupled: whether one drive moves both fingers, each in proportion to its way from open to
            closed.
        fingers: the two fingers; the first is on the +x side of G.
    """

    version: int = 1
    name: str
    description: str = ""
    source: str = ""
    model: str
    body: str
    X_HG: Pose
    opening: tuple[float, float]
    force: float
    closing_speed: float
    coupled: bool = True
    fingers: tuple[Finger, Finger]

    def __post_init__(self) -> None:
        max_closing_time = 60.0  # Seconds; the slowest hands on sale take half of it.
        require_name(self.name, "name")
        low, high = self.opening
        if not 0.0 <= low < high:
            raise FieldError(
                f"opening {list(self.opening)} must be two distances in metres, the"
                " smaller one first and at least 0",
                "opening",
            )
        for name, unit in (("force", "N"), ("closing_speed", "m/s")):
            if not (value := getattr(self, name)) > 0.0:
                raise FieldError(f"{name} is {value:g} {unit}; it must be above 0", name)
        if self.closing_time > max_closing_time:
            raise FieldError(
                f"closing_speed is {self.closing_speed:g} m/s, so the hand takes "
                f"{self.closing_time:.3g} s to close; at most {max_closing_time:g} s can"
                " be simulated",
                "closing_speed",
            )
        for i, finger in enumerate(self.fingers):
            if finger.closed == finger.open:
                raise FieldError(
                    f"finger {finger.body!r}: closed and open must differ; both are "
                    f"{finger.open:g} m",
                    *("fingers", i, "closed"),
                )
        one, other = self.fingers
        for name in ("body", "joint"):
            if (shared := getattr(other, name)) == getattr(one, name):
                raise FieldError(
                    f"both fingers name the same {name}, {shared!r}", "fingers", 1, name
                )

    @property
    def closing_time(self) -> float:
        """Time that the open hand takes to close [s]."""
        return (self.opening[1] - self.opening[0]) / 2.0 / self.closing_speed

    def X_AH(self, X_AG: Array) -> Array:
        """Hand body poses (..., 4, 4) that bring the grasp frame to `X_AG` (..., 4, 4)."""
        return X_AG @ inverse(self.X_HG.matrix())


def load_hand(reference: str, base: Path | None = None) -> Hand:
    """Loads a hand document by path or built-in name such as `panda_hand`.

    Raises:
        UnknownNameError: no such hand.
        DocumentError: the file does not fit the schema.
    """
    return load_document(resolve_reference(reference, "models/hands", base), Hand)


def locate_hand(
    reference: str, base: Path | None = None, packages: Packages = NO_PACKAGES
) -> tuple[Hand, Path, Path]:
    """Loads a hand document and finds the model file that it names.

    Args:
        reference: built-in name or path, relative to `base`.
        base: folder of the document that names it.
        packages: the station's package folders.

    Returns:
        The hand, its model file, and the document's file.

    Raises:
        UnknownNameError: no such hand, model, or package that the model names.
        DocumentError: the file does not fit the schema.
    """
    path = resolve_reference(reference, "models/hands", base, packages)
    hand = load_document(path, Hand)
    try:
        model = resolve_reference(hand.model, base=path.parent, packages=packages)
        referenced_packages(model, packages)
        return hand, model, path
    except UnknownNameError as error:
        raise UnknownNameError(f"{path}: model: {error}") from error
