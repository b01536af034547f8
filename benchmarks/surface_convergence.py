"""Faces of the surface that pads touch, beyond which verdicts no longer change.

    python benchmarks/surface_convergence.py [--engine NAME] [-o FOLDER]

The hard cases of the oracle (see contact_oracle.py) on those of its objects that touch with a
surface of their own, with surfaces from coarse to fine: each keeps half the distance and 0.7 times
the angle of the one before. Prints for each the faces, the verdicts that differ from those with the
finest one, those that differ from the oracle's, how far slip is off, and CPU time. What changes
from the pipeline's bounds on to the finest is what the choice of its bounds costs.
"""

from __future__ import annotations

import argparse
import shutil
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from contact_oracle_trials import KNOWN, build, run_engine
from oracle.cases import Case, load_cases
from oracle.catalogue import HELD_OUT, TUNED

from burg_drake.objects import (
    MAX_CONTACT_DISTANCE,
    MAX_NORMAL_ANGLE,
    ObjectLibrary,
    contact_surface,
    load_library,
    max_excess,
    write_piece,
)

FACTORS = (4.0, 2.0, 1.0, 0.5, 0.25)
"""Of the pipeline's bound on distance; that on angles has the square root of it."""


@dataclass
class Rung:
    """What was measured with one set of surfaces.

    Attributes:
        faces: by object.
        lifted, slip, seconds: of each case.
    """

    faces: dict[str, int] = field(default_factory=dict)
    lifted: list[bool] = field(default_factory=list)
    slip: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--engine", default="standard", choices=list(KNOWN))
    parser.add_argument("-o", "--output", type=Path, default=Path("surface_convergence"))
    arguments = parser.parse_args()
    built = load_library(build(arguments.output / "library", (*TUNED, *HELD_OUT), None))
    curved = [name for name, e in built.objects.items() if e.contact.kind == "surface"]
    cases = [case for case in load_cases() if case.object in curved]
    print(f"{len(cases)} cases on {len(curved)} objects: {', '.join(curved)}", flush=True)
    rungs = {}
    for factor in FACTORS:
        folder = arguments.output / f"surfaces_{factor:g}"
        rungs[factor] = measure(resurfaced(built, curved, folder, factor), cases, arguments.engine)
        print(f"{factor:g}: {np.mean(list(rungs[factor].faces.values())):.0f} faces", flush=True)
    show(rungs, cases)


def resurfaced(
    library: ObjectLibrary, curved: list[str], folder: Path, factor: float
) -> ObjectLibrary:
    """The library with surfaces of other bounds."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(library.root, folder)
    objects = dict(library.objects)
    for name in curved:
        entry = objects[name]
        mesh, fit = contact_surface(
            library.surface(name),
            True,
            factor * MAX_CONTACT_DISTANCE,
            factor**0.5 * MAX_NORMAL_ANGLE,
        )
        write_piece(mesh, folder / entry.contact.mesh)
        out = max_excess(mesh, [library.mesh(piece) for piece in entry.pieces])
        objects[name] = replace(entry, contact=replace(entry.contact, fit=fit, excess=out))
    changed = ObjectLibrary(replace(library.document, objects=objects), folder.resolve())
    changed.save()
    return changed


def measure(library: ObjectLibrary, cases: list[Case], engine: str) -> Rung:
    """Executes all cases."""
    rung = Rung()
    for case in cases:
        if case.object not in rung.faces:
            mesh = library.mesh(library.entry(case.object).contact.mesh)
            rung.faces[case.object] = len(mesh.faces)
            run_engine(str(library.root), case, engine)  # builds the diagrams
        start = time.process_time()
        found = run_engine(str(library.root), case, engine)
        rung.seconds.append(time.process_time() - start)
        rung.lifted.append(bool(found["lifted"]))
        rung.slip.append(float(found["slip"]))  # type: ignore[arg-type]
    return rung


def show(rungs: dict[float, Rung], cases: list[Case]) -> None:
    """Prints the table."""
    finest = rungs[FACTORS[-1]]
    truth = np.array([case.lifted for case in cases])
    print("bound [mm]  faces  unlike the finest  unlike the oracle  slip off [mm]  s a trial")
    for factor, rung in rungs.items():
        lifted = np.array(rung.lifted)
        both = lifted & np.array(finest.lifted)
        slip = 1e3 * np.abs(np.array(rung.slip) - np.array(finest.slip))[both]
        print(
            f"{1e3 * factor * MAX_CONTACT_DISTANCE:10.3f} {np.mean(list(rung.faces.values())):6.0f}"
            f" {np.sum(lifted != finest.lifted):11} of {len(cases)}"
            f" {np.sum(lifted != truth):12} of {len(cases)}"
            f" {np.median(slip):14.3f} {np.mean(rung.seconds):10.3f}"
        )
    for place, case in enumerate(cases):
        verdicts = [rung.lifted[place] for rung in rungs.values()]
        if len(set(verdicts)) > 1:
            print(f"{case.object} {case.id}: {['-+'[v] for v in verdicts]}, oracle {case.lifted}")


if __name__ == "__main__":
    main()
