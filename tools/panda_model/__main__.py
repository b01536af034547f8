"""`python -m tools.panda_model`: writes `models/panda` and `models/hands/panda_hand.yaml`."""

from __future__ import annotations

from tools.panda_model.collision import LEFT_FINGER_SHAPES
from tools.panda_model.hand_document import hand_yaml
from tools.panda_model.looks import link_parts
from tools.panda_model.sdf import arm_sdf, hand_sdf
from tools.robot_model.obj import mtl_text, obj_text
from tools.robot_model.pad_mesh import PAD_FILE, pad_vtk
from tools.robot_model.write import write_models

MATERIAL_FILE = "panda.mtl"


def model_texts() -> dict[str, str]:
    """Text of all files, by their paths below `models`."""
    texts = {
        "panda/panda_arm.sdf": arm_sdf(),
        "panda/panda_hand.sdf": hand_sdf(),
        "hands/panda_hand.yaml": hand_yaml(),
        f"panda/meshes/{MATERIAL_FILE}": mtl_text(),
        f"panda/meshes/{PAD_FILE}": pad_vtk(LEFT_FINGER_SHAPES[0].size),
    }
    for name, parts in link_parts().items():
        texts[f"panda/meshes/{name}.obj"] = obj_text(parts, MATERIAL_FILE)
    return texts


if __name__ == "__main__":
    write_models(model_texts())
