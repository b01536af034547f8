from .bundle import (
    Bundle as Bundle,
    load_bundle as load_bundle,
    make_bundle as make_bundle,
    require_content as require_content,
)
from .bundled_judge import recipe_of as recipe_of
from .judge_recipe import JudgeRecipe as JudgeRecipe
from .unpacked import (
    bundle_folder as bundle_folder,
    unpack as unpack,
)
