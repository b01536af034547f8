"""Makes samples of a data set again: alone, and for checks."""

from __future__ import annotations

from pathlib import Path

from burg_drake.core import BurgError, InvalidInputError
from burg_drake.dataset.generating.contents import require_same_contents
from burg_drake.dataset.generating.recipe import DatasetRecipe, read_recipe
from burg_drake.dataset.generating.scene_samples import SceneSamples, appearance_of
from burg_drake.dataset.rendering import Images
from burg_drake.dataset.samples import (
    FILE,
    Dataset,
    DatasetDocument,
    DatasetFinding,
    Sample,
    check_dataset,
    load_dataset_document,
)
from burg_drake.scene.document import Scene
from burg_drake.station.document import Station


def sample_again(dataset: Dataset, key: str) -> Sample:
    """One sample of a generated data set, rendered anew from what is stored with it.

    Args:
        dataset: made by `generate_dataset`.
        key: of the sample, such as `000012_003`.

    Returns:
        The same images, to the byte if all software is the same; without grasps.

    Raises:
        UnknownNameError: no such sample.
        InvalidInputError: nobody generated the data set, or its library or station is another now.
    """
    stored = dataset.read(dataset.index(key), images=())
    recipe, station = _made_with(dataset.document, dataset.folder)
    scene = dataset.scene(stored.scene)
    samples = SceneSamples(
        scene, stored.scene, station, recipe, dataset.folder, appearance_of(stored)
    )
    return samples.sample(stored.number, stored.view)


def check_generated(folder: str | Path) -> list[DatasetFinding]:
    """All that is wrong with a data set; depth and labels are rendered anew and compared.

    Args:
        folder: of a data set made by `generate_dataset`, or by anybody with `DatasetWriter`, whose
            images are not rendered anew.

    Raises:
        DocumentError: its document is missing, damaged, or of another version.
    """
    folder = Path(folder)
    document = load_dataset_document(folder / FILE)
    if document.recipe is None:
        return check_dataset(folder)
    try:
        recipe, station = _made_with(document, folder)
    except BurgError as error:
        return [DatasetFinding("", FILE, str(error)), *check_dataset(folder)]

    last: list[tuple[tuple[int, str], SceneSamples]] = []

    def redraw(scene: Scene, sample: Sample) -> Images:
        key = sample.scene, repr(sample.appearance)
        if not last or last[0][0] != key:
            appearance = appearance_of(sample)
            samples = SceneSamples(scene, sample.scene, station, recipe, folder, appearance)
            last[:] = [(key, samples)]
        return last[0][1].redrawn(sample.view)

    return check_dataset(folder, redraw)


def _made_with(document: DatasetDocument, folder: Path) -> tuple[DatasetRecipe, Station]:
    if document.recipe is None:
        raise InvalidInputError(
            f"{folder} has no recipe in its document, so its samples cannot be made again"
        )
    recipe = read_recipe(document.recipe, f"recipe of {folder}")
    return recipe, require_same_contents(document, recipe, folder)
