"""`python -m tools.ur5e_model`: writes `models/ur5e`."""

from __future__ import annotations

from tools.robot_model.write import write_models
from tools.ur5e_model.urdf import arm_urdf


def model_texts() -> dict[str, str]:
    """Text of all files, by their paths below `models`."""
    return {"ur5e/ur5e.urdf": arm_urdf()}


if __name__ == "__main__":
    write_models(model_texts())
