"""Whether and how the arm can bring the hand to a grasp, and away with the object.

`reach` says whether, `planner` how fast. On the way, `ik` gives postures, `proximity` and
`collision` say which are free, `lines` has the straight parts and `transit` the way there from
home.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
