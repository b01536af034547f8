"""The card of a data set: a README with what is in it, how it is distributed, and examples."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from burg_drake.core import InvalidInputError, UnknownNameError, nearest, software_versions
from burg_drake.core.files import atomic_write_all
from burg_drake.dataset.exchange.histogram import bars_of_counts, histogram
from burg_drake.dataset.exchange.sheet import sheet_png, spread
from burg_drake.dataset.exchange.source import Samples
from burg_drake.dataset.exchange.tally import Tally, tally

CARD, PICTURES = "README.md", "card"
"""The file, and the folder of its pictures."""
MARK = "<!-- Card of a data set, written by burg_drake. -->"
"""By which a card is known that may be replaced."""
EXAMPLES = 4
NOT_STATED = "not stated"


def write_card(
    samples: Samples,
    folder: str | Path,
    *,
    description: str = "",
    facts: Mapping[str, str] | None = None,
    licences: Mapping[str, str] | None = None,
) -> None:
    """Writes the card of a data set: `README.md`, and the folder `card` with its pictures.

    An earlier card is replaced.

    Args:
        samples: the data set.
        folder: for the card.
        description: a paragraph of what the data set is for.
        facts: how it was made, such as its seed, by name.
        licences: of the meshes, by object; libraries of objects have none.

    Raises:
        InvalidInputError: there are no samples, there is another README.md, or the place cannot be
            written to.
        UnknownNameError: a licence is of no object of the data set.
    """
    folder = Path(folder)
    _require_own_card(folder / CARD)
    for name in licences or {}:
        if name not in samples.objects:
            raise UnknownNameError(
                f"a licence is given for object {name!r}, which is not in the data set;"
                f" {nearest(name, samples.objects)}"
            )
    if not len(samples):
        raise InvalidInputError(f"cannot write {folder / CARD}: the data set has no samples")
    counted = tally(samples)
    chosen = [samples[k] for k in spread(len(samples), EXAMPLES)]
    charts = _charts(counted)
    pictures: dict[str, str | bytes] = {**charts, "examples.png": sheet_png(chosen, 1)}
    made = {**(facts or {}), **software_versions(with_platform=False)}
    text = "\n\n".join(
        [
            MARK,
            f"# {samples.name}",
            *([description] if description else []),
            _summary(counted),
            "![images of some samples](card/examples.png)",
            "## Objects",
            _objects(samples, counted, licences or {}),
            "## Distributions",
            "\n".join(f"![{Path(name).stem}](card/{name})" for name in charts),
            *(["## Grasps", _counts("outcome", counted.outcomes)] if counted.outcomes else []),
            "## How it was made",
            _table(("", ""), list(made.items())),
        ]
    )
    contents = {folder / PICTURES / name: picture for name, picture in pictures.items()}
    atomic_write_all({**contents, folder / CARD: text + "\n"})


def _require_own_card(path: Path) -> None:
    """Refuses to replace a file of somebody else."""
    if not path.exists():
        return
    try:
        own = path.read_text(encoding="utf-8").startswith(MARK)
    except (OSError, UnicodeDecodeError):
        own = False
    if not own:
        raise InvalidInputError(
            f"{path} exists already and is not the card of a data set; move it away"
        )


def _charts(counted: Tally) -> dict[str, str]:
    """Pictures by the names of their files."""
    degrees = np.rad2deg(counted.elevations).tolist()
    percent = [100.0 * share for share in counted.visibilities]
    return {
        "distance.svg": histogram(
            counted.distances, "Distance of visible objects", "from the camera [m]"
        ),
        "elevation.svg": histogram(
            degrees, "Elevation of views", "by which the camera looks down [°]"
        ),
        "visibility.svg": histogram(
            percent, "Visibility of objects", "share of the silhouette [%]", limits=(0.0, 100.0)
        ),
        "objects.svg": bars_of_counts(counted.objects, "Objects in images", "visible objects"),
    }


def _summary(counted: Tally) -> str:
    sizes = [f"{wide} x {tall} ({n:,})" for (wide, tall), n in sorted(counted.sizes.items())]
    views = [f"{name} ({n:,})" for name, n in sorted(counted.views.items())]
    images = [f"{name} ({n:,})" for name, n in counted.images.items() if n]
    instances, visible = counted.instances.total(), counted.visible.total()
    rows = [
        ("scenes", f"{len(counted.scenes):,}"),
        ("samples", f"{counted.samples:,}"),
        ("views (samples)", ", ".join(views)),
        ("images (samples)", ", ".join(images)),
        ("size [pixel] (samples)", ", ".join(sizes)),
        ("instances in samples", f"{instances:,}, {visible:,} of them visible"),
        ("grasps in samples", f"{counted.outcomes.total():,}"),
    ]
    return _table(("", ""), rows)


def _objects(samples: Samples, counted: Tally, licences: Mapping[str, str]) -> str:
    """Objects with their counts, and where their meshes are from."""
    rows = []
    for number, name in enumerate(samples.objects, start=1):
        source = samples.library.entry(name).source
        counts = f"{counted.instances[name]:,}", f"{counted.visible[name]:,}"
        origin = source.file or "made by code", source.sha256[:12]
        rows.append((str(number), name, *counts, *origin, licences.get(name, NOT_STATED)))
    header = ("id", "object", "instances", "visible", "mesh", "sha256", "licence of the mesh")
    return f"Object library `{samples.library.name}`.\n\n{_table(header, rows)}"


def _counts(name: str, counts: Counter[str]) -> str:
    rows = [(key or "clear, or not judged", f"{n:,}") for key, n in counts.most_common()]
    return _table((name, "number"), rows)


def _table(header: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    lines = [header, ("---",) * len(header), *rows]
    return "\n".join(f"| {' | '.join(map(_cell, line))} |" for line in lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
