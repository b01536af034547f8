"""A data set on disk without what is damaged in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from burg_drake.core import InvalidInputError
from burg_drake.dataset.samples.dataset import Dataset
from burg_drake.dataset.samples.sample import Sample
from burg_drake.objects.library import ObjectLibrary


class ReadableSamples:
    """The samples of a data set that can be read; the others are left out, and named.

    Attributes:
        dataset: where they are.
        damaged: how many samples were left out so far, by what is wrong with them: shard, file, and
            what mends it. All samples of a shard that cannot be opened count as one line.
    """

    def __init__(self, dataset: Dataset) -> None:
        self.dataset = dataset
        self.damaged: dict[str, int] = {}

    @property
    def name(self) -> str:
        """Of the data set."""
        return self.dataset.name

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the library's objects, in the order of their ids."""
        return self.dataset.objects

    @property
    def library(self) -> ObjectLibrary:
        """Where these objects are."""
        return self.dataset.library

    def __len__(self) -> int:
        """All that the index has, damaged ones as well."""
        return len(self.dataset)

    def __getitem__(self, index: int, /) -> Sample:
        """A sample by its index, which a damaged one keeps.

        Raises:
            InvalidInputError: it is damaged.
        """
        return self.dataset[index]

    def __iter__(self) -> Iterator[Sample]:
        return self.read(range(len(self)))

    def read(self, indices: Iterable[int]) -> Iterator[Sample]:
        """Reads samples one after the other.

        Args:
            indices: of those that are wanted.

        Raises:
            InvalidInputError: in the end, if some were wanted and none can be read.
        """
        found, first = False, None
        for index in indices:
            try:
                sample = self.dataset[index]
            except InvalidInputError as error:
                first = first or error
                self.damaged[str(error)] = self.damaged.get(str(error), 0) + 1
            else:
                found = True
                yield sample
        if first is not None and not found:
            raise InvalidInputError(
                f"no sample of {self.dataset.folder} can be read; the first error is: {first}"
            ) from first
