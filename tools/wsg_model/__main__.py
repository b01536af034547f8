"""`python -m tools.wsg_model`: writes `models/wsg` and `models/hands/wsg_50.yaml`."""

from __future__ import annotations

from tools.robot_model.obj import mtl_text, obj_text
from tools.robot_model.pad_mesh import PAD_FILE, pad_vtk
from tools.robot_model.write import write_models
from tools.wsg_model.collision import FINGER_SHAPES
from tools.wsg_model.hand_document import hand_yaml
from tools.wsg_model.look import body_parts, finger_parts
from tools.wsg_model.sdf import hand_sdf

MATERIAL_FILE = "wsg.mtl"


def model_texts() -> dict[str, str]:
    """Text of all files, by their paths below `models`."""
    return {
        "wsg/wsg_50.sdf": hand_sdf(),
        "hands/wsg_50.yaml": hand_yaml(),
        f"wsg/meshes/{MATERIAL_FILE}": mtl_text(),
        f"wsg/meshes/{PAD_FILE}": pad_vtk(FINGER_SHAPES[0].size, thickness=0),
        "wsg/meshes/body.obj": obj_text(body_parts(), MATERIAL_FILE),
        "wsg/meshes/finger.obj": obj_text(finger_parts(), MATERIAL_FILE),
    }


if __name__ == "__main__":
    write_models(model_texts())
