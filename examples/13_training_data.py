"""Training data: samples of a scene on disk, and a data set of PyTorch that reads them.

Without PyTorch (`pip install torch`) the samples are read all the same.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import burg_drake as burg

try:
    from torch.utils.data import DataLoader, Dataset
except ImportError:
    DataLoader, Dataset = None, object


class Views(Dataset):
    """Colours, depth and labels of each view."""

    def __init__(self, folder: Path) -> None:
        self.samples = burg.load_dataset(folder)

    def __len__(self) -> int:
        return len(self.samples)

    def __getitem__(self, index: int) -> dict[str, Any]:
        images = self.samples.read(index, images=("color", "depth", "labels")).images
        color = images.color.astype(np.float32).transpose(2, 0, 1) / 255.0
        return {"color": color, "depth": images.depth, "labels": images.labels.astype(np.int64)}


def main() -> None:
    """Makes a small data set and reads it in batches, by two processes."""
    with tempfile.TemporaryDirectory() as folder:
        recipe = burg.dataset.DatasetRecipe(views=4)
        burg.generate_dataset(["tabletop_six"], "panda_tabletop", folder, recipe)
        views = Views(Path(folder))
        if DataLoader is None:
            print("PyTorch is not installed: views are read one by one")
            batches = ({key: array[None] for key, array in view.items()} for view in views)
        else:
            batches = DataLoader(views, batch_size=2, num_workers=2)
        for batch in batches:
            numbers = np.unique(batch["labels"])
            print(f"{tuple(batch['color'].shape)}, objects {numbers[numbers > 0].tolist()}")


if __name__ == "__main__":  # the processes of a DataLoader may read this file, too
    main()
