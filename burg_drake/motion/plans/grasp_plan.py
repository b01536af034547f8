"""`Plan`: the motions of one grasp, which are written to a file and read again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake.motion.plans.csv_file import read_csv, write_csv
from burg_drake.motion.plans.json_file import read_json, write_json
from burg_drake.motion.plans.planned_motion import PlannedMotion

if TYPE_CHECKING:
    from burg_drake.scene.document import SceneLike
    from burg_drake.station.document import StationLike


@dataclass(frozen=True, eq=False, repr=False)
class Plan(PlannedMotion):
    """The motions of one grasp; attributes are those of `PlannedMotion`."""

    def to_csv(self, path: str | Path) -> None:
        """Writes a table that `load_plan` reads; see `csv_file`."""
        write_csv(self, path)

    def to_json(self, path: str | Path) -> None:
        """Writes a document that `load_plan` reads; see `json_file`."""
        write_json(self, path)


def load_plan(
    path: str | Path, *, scene: SceneLike | None = None, station: StationLike | None = None
) -> Plan:
    """Reads what `Plan.to_json` or `Plan.to_csv` has written.

    Example::

        plan = burg.load_plan("plan.json", station="panda_tabletop")
        for name, phase in plan.phases.items():
            print(name, phase.duration, phase.q[-1])

    Args:
        path: the file; a name that ends in .csv is that of a table.
        scene, station: what the plan has to be for, if given.

    Raises:
        InvalidInputError: there is no such file, it is not a plan, or one that is damaged: with
            times, phases or positions that do not belong together, or beyond its own limits; or it
            is for another scene or station, or does not tell.
    """
    path = Path(path)
    read = read_csv if path.suffix.lower() == ".csv" else read_json
    plan = Plan(**vars(read(path)))
    plan.require_for(scene, station, name=str(path))
    return plan
