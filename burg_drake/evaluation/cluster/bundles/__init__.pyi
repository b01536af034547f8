from .bundle import Bundle as Bundle
from .bundled_judge import recipe_of as recipe_of
from .judge_recipe import JudgeRecipe as JudgeRecipe
from .unpacked import unpack as unpack
