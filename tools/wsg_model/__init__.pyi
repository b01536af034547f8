from .__main__ import model_texts as model_texts
from .collision import (
    BEAM_THICKNESS as BEAM_THICKNESS,
    BODY_SHAPES as BODY_SHAPES,
    FINGER_SHAPES as FINGER_SHAPES,
    GAP as GAP,
    JAW_BREADTH as JAW_BREADTH,
)
from .figures import (
    ADAPTER as ADAPTER,
    BODY as BODY,
    CLOSING_SPEED as CLOSING_SPEED,
    FINGER_BREADTH as FINGER_BREADTH,
    FINGER_EFFORT as FINGER_EFFORT,
    FINGER_HEIGHT as FINGER_HEIGHT,
    FINGER_MASS as FINGER_MASS,
    FINGER_SPEED as FINGER_SPEED,
    FINGER_THICKNESS as FINGER_THICKNESS,
    FINGER_TRAVEL as FINGER_TRAVEL,
    GRASP_FORCE as GRASP_FORCE,
    JAW_HEIGHT as JAW_HEIGHT,
    PAD_CENTER as PAD_CENTER,
    PAD_HEIGHT as PAD_HEIGHT,
    PAD_THICKNESS as PAD_THICKNESS,
    TCP_HEIGHT as TCP_HEIGHT,
    body_inertia as body_inertia,
)
from .hand_document import hand_yaml as hand_yaml
from .look import body_parts as body_parts, finger_parts as finger_parts
from .sdf import (
    BODY_LINK as BODY_LINK,
    FINGER_JOINTS as FINGER_JOINTS,
    FINGER_LINKS as FINGER_LINKS,
    hand_sdf as hand_sdf,
)
