"""Visual geometry of all links, made here: the proportions are a Panda's, no mesh is borrowed."""

from __future__ import annotations

from tools.panda_model.base_look import base_parts
from tools.panda_model.hand_look import finger_parts, hand_parts
from tools.panda_model.limb_look import elbow_parts, shoulder_parts
from tools.panda_model.wrist_look import flange_parts, forearm_parts, wrist_parts
from tools.robot_model.obj import Part


def link_parts() -> dict[str, list[Part]]:
    """Parts of each mesh file, by its name without ending."""
    link1, link2 = shoulder_parts()
    link3, link4 = elbow_parts()
    return {
        "link0": base_parts(),
        "link1": link1,
        "link2": link2,
        "link3": link3,
        "link4": link4,
        "link5": forearm_parts(),
        "link6": wrist_parts(),
        "link7": flange_parts(),
        "hand": hand_parts(),
        "finger": finger_parts(),
    }
