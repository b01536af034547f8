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
    from torch.utils.data import Dataset
except ImportError:
    Dataset = object


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


with tempfile.TemporaryDirectory() as folder:
    recipe = burg.dataset.DatasetRecipe(views=2)
    burg.generate_dataset(["tabletop_six"], "panda_tabletop", folder, recipe)
    views = Views(Path(folder))
    for k in range(len(views)):
        view = views[k]
        numbers = np.unique(view["labels"])
        print(f"{view['color'].shape}, objects {numbers[numbers > 0].tolist()}")
