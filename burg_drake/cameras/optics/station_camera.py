"""Cameras of stations by name: `sim:STATION/CAMERA`."""

from __future__ import annotations

from burg_drake.core import InvalidInputError, UnknownNameError, nearest
from burg_drake.station.document import Station, load_station

SIMULATED = "sim:"
DEFAULT_CAMERA = "board"


def simulated_camera(reference: str) -> tuple[Station, str]:
    """Station and name of the camera of `sim:STATION[/CAMERA]`.

    A station is a built-in name or a file. Without a name of a camera it is the one called
    `board`, or the only one.

    Raises:
        UnknownNameError: no such station or camera.
        InvalidInputError: the station has several cameras and none is named, or it has none.
    """
    text = reference.removeprefix(SIMULATED)
    named = None
    try:
        station = load_station(text)
    except UnknownNameError as error:
        before, slash, named = text.rpartition("/")
        if not slash:
            raise UnknownNameError(f"station of {reference}: {error}") from None
        try:
            station = load_station(before)
        except UnknownNameError as without_camera:
            reason = error if text.endswith((".yaml", ".yml")) else without_camera
            raise UnknownNameError(f"station of {reference}: {reason}") from None
    known = station.document.cameras
    if not known:
        raise InvalidInputError(f"station {station.name!r} ({station.path}) has no cameras")
    camera = named or (next(iter(known)) if len(known) == 1 else DEFAULT_CAMERA)
    if named is None and camera not in known:
        raise InvalidInputError(
            f"{reference} has several cameras; name one, as in {reference}/CAMERA;"
            f" {nearest(DEFAULT_CAMERA, known)}"
        )
    station.camera(camera)
    return station, camera
