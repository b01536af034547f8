"""A session in a process of its own, to be killed or to run out of disk; run by its path.

Arguments: what to open, the folder, and `work` or `full`.
"""

from __future__ import annotations

import resource
import sys
import time
from pathlib import Path

from burg_drake.compose import AddObject, ComposeSession, Delete
from burg_drake.core import BurgError
from burg_drake.station import load_station


def main(reference: str, folder: str, what: str) -> None:
    """Takes four steps, takes one of them back, does the same in a scene that is saved, in the
    folder `saved`, and waits to be killed; or fills the disk."""
    if what == "full":
        fill_the_disk(begun(reference, folder), folder)
        return
    (Path(folder) / "saved").mkdir()
    sessions = [begun(reference, folder), begun(reference, f"{folder}/saved")]
    for session in sessions:
        session.do(AddObject("marble"))
        session.do(Delete(("bowl",)))
        session.undo()
    sessions[1].save("breakfast")
    print("ready", flush=True)
    time.sleep(60)


def begun(reference: str, folder: str) -> ComposeSession:
    """A session with two bowls."""
    session = ComposeSession.open(
        reference, load_station("wsg_tabletop"), folder=folder, address="http://127.0.0.1:8080"
    )
    for x in (0.1, 0.3):
        session.do(AddObject("bowl", position=(x, 0.15)))
    return session


def fill_the_disk(session: ComposeSession, folder: str) -> None:
    """Edits a saved scene with a limit of 200 bytes on the size of files."""
    session.save("breakfast")
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, resource.RLIM_INFINITY))
    view = session.do(AddObject("marble"))
    print(len(view.instances), view.notices)
    try:
        session.save()
    except BurgError as error:
        print(error, (Path(folder) / "breakfast.yaml").read_text().count("object:"))
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    print(session.do(Delete(("marble",))).notices, session.save().saved)


if __name__ == "__main__":
    main(*sys.argv[1:])
