"""Whether and how the arm can bring the hand to a grasp, and away with the object.

Read `arm_reach` first: it decides whether the arm can execute a grasp. `planner` times the motion.
`hand_sweep` checks the hand alone, `line_search` finds the straight segments, `motion_search` joins
them to the home posture by `home_tree`. `clearance_bounds` and `arm_collision` say what is free.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
