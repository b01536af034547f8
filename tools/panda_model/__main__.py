"""`python -m tools.panda_model`: writes `models/panda` and `models/hands/panda_hand.yaml`."""

from __future__ import annotations

import sys
from pathlib import Path

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tools.panda_model.collision import LEFT_FINGER_SHAPES
from tools.panda_model.hand_document import hand_yaml
from tools.panda_model.looks import link_parts
from tools.panda_model.obj import MATERIAL_FILE, mtl_text, obj_text
from tools.panda_model.pad_mesh import PAD_FILE, pad_vtk
from tools.panda_model.sdf import arm_sdf, hand_sdf


def write_models(models: Path) -> list[Path]:
    """Writes all files below `models`; returns their paths."""
    texts = {
        "panda/panda_arm.sdf": arm_sdf(),
        "panda/panda_hand.sdf": hand_sdf(),
        "hands/panda_hand.yaml": hand_yaml(),
        f"panda/meshes/{MATERIAL_FILE}": mtl_text(),
        f"panda/meshes/{PAD_FILE}": pad_vtk(LEFT_FINGER_SHAPES[0].size),
    }
    for name, parts in link_parts().items():
        texts[f"panda/meshes/{name}.obj"] = obj_text(parts)
    for relative, text in texts.items():
        path = models / relative
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return [models / relative for relative in texts]


def main() -> None:
    """Writes the models of the checkout and says how large they are."""
    paths = write_models(Path(__file__).resolve().parents[2] / "models")
    for path in paths:
        print(f"{path.stat().st_size / 1000:8.1f} kB  {path}")
    print(f"{sum(p.stat().st_size for p in paths) / 1e6:8.2f} MB")


if __name__ == "__main__":
    main()
