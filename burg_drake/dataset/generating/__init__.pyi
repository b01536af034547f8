from .again import (
    check_generated as check_generated,
    sample_again as sample_again,
)
from .generate import (
    GeneratedDataset as GeneratedDataset,
    generate_dataset as generate_dataset,
)
from .recipe import (
    DatasetRecipe as DatasetRecipe,
)
