"""Whether a library is still what the session has loaded, and what of a scene a change concerns."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from burg_drake.compose.document import State, Surroundings, name_of
from burg_drake.core import InvalidInputError, UnknownNameError, listing
from burg_drake.objects.library import LIBRARY_FILE, ObjectLibrary, load_library

Stamp = tuple[int, int, int] | None


class LibraryWatch:
    """Looks at a library's document now and then; without a change that costs nothing.

    Args:
        library: as it is now.
    """

    def __init__(self, library: ObjectLibrary) -> None:
        self.library = library
        self._stamp = _stamp(library.root)

    def reload_if_changed(self) -> ObjectLibrary | None:
        """The library, if it was changed since; None if not.

        Raises:
            BurgError: it cannot be loaded. It is tried again when it has changed once more.
        """
        stamp = _stamp(self.library.root)
        if stamp == self._stamp:
            return None
        self._stamp = stamp
        library = load_library(self.library.root)
        if library.document == self.library.document and library.content == self.library.content:
            return None
        self.library = library
        return library


def changes_notice(state: State, library: ObjectLibrary) -> str:
    """One line on what a changed library means for a scene."""
    placed = [*state.document.instances, *state.document.background]
    used = list(dict.fromkeys(i.object for i in placed))
    missing = [name_of(i) for i in placed if i.object not in library.objects]
    other = [
        name
        for name in used
        if name in library.objects and library.content[name] != state.library.content.get(name)
    ]
    parts = []
    if missing:
        parts.append(f"it no longer has the objects of {listing(missing)}")
    if other:
        parts.append(f"{listing(other)} {'was' if len(other) == 1 else 'were'} built again")
    return f"library {library.root} has changed: {'; '.join(parts) or 'no object of this scene'}"


def require_objects(state: State, library: ObjectLibrary) -> None:
    """Refuses a library that lacks objects of a scene.

    Raises:
        UnknownNameError: it does; the message lists them.
        InvalidInputError: it gives a free instance no mass.
    """
    placed = (*state.document.instances, *state.document.background)
    missing = sorted({i.object for i in placed if i.object not in library.objects})
    if missing:
        raise UnknownNameError(
            f"library {library.root} has no {listing([repr(m) for m in missing])}; delete their"
            " instances first, or choose a library that has them"
        )
    heavy = [name_of(i) for i in state.document.instances if library.entry(i.object).is_fixed]
    if heavy:
        raise InvalidInputError(
            f"library {library.root} has no mass for {listing(heavy)}; make them background first"
        )


@dataclass(frozen=True)
class UseLibrary:
    """Takes the objects from another library.

    Attributes:
        library: which must have all objects of the scene.
        reference: how the scene's document refers to it.
    """

    library: ObjectLibrary
    reference: str

    @property
    def label(self) -> str:
        return f"use library {self.library.name}"

    def apply(self, state: State, surroundings: Surroundings) -> State:
        require_objects(state, self.library)
        document = replace(state.document, library=self.reference)
        return replace(state, document=document, library=self.library)


def _stamp(root: Path) -> Stamp:
    try:
        stat = (root / LIBRARY_FILE).stat()
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_size, stat.st_ino
