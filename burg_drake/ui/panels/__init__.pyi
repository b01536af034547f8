from .arrange import ArrangePanel as ArrangePanel
from .backdrop import BackdropPanel as BackdropPanel
from .board import BoardPanel as BoardPanel
from .check import CheckPanel as CheckPanel
from .display import DisplayPanel as DisplayPanel
from .file import FilePanel as FilePanel
from .fill import FillPanel as FillPanel
from .grasp import GraspPanel as GraspPanel
from .library import LibraryPanel as LibraryPanel
from .object import ObjectPanel as ObjectPanel
from .pose import PosePanel as PosePanel
from .reach import ReachPanel as ReachPanel
from .settle import (
    SettlePanel as SettlePanel,
    moved_names as moved_names,
)
from .summary import SummaryPanel as SummaryPanel
