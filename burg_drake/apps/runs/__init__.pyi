from . import (
    demo as demo,
    evaluate as evaluate,
    merge as merge,
    reach as reach,
    replay as replay,
    report as report,
    robustness as robustness,
    status as status,
)
