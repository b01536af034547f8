"""Labels of the objects in a view: where each is, and how much of it is seen."""

from __future__ import annotations

import numpy as np

from burg_drake.core import inverse
from burg_drake.dataset.labels.instance_label import InstanceLabel, box_of_mask
from burg_drake.dataset.rendering import Images, SceneRenderer
from burg_drake.dataset.views import View


def label_instances(
    renderer: SceneRenderer, view: View, images: Images | None = None
) -> tuple[InstanceLabel, ...]:
    """Labels of all instances, in the order of their numbers.

    Args:
        renderer: of the scene.
        view: the camera.
        images: what it sees, with labels; looked at again if None.
    """
    labels = images.labels if images is not None else None
    if labels is None:
        labels = renderer.images(view, ("labels",)).labels
        assert labels is not None
    X_CS, height_width = inverse(view.X_SC), labels.shape
    counts = np.bincount(labels.ravel(), minlength=len(renderer.numbers) + 1)
    found = []
    for name, number in renderer.numbers.items():
        silhouette = renderer.silhouette(number, view)
        amodal = silhouette.within(height_width[1], height_width[0])
        visible = int(counts[number])
        size = int(np.count_nonzero(silhouette.mask))
        rows, columns = silhouette.mask.shape
        found.append(
            InstanceLabel(
                name=name,
                object=renderer.scene.instance(name).object,
                number=number,
                X_CO=X_CS @ renderer.scene.X_SO(name),
                visible_pixels=visible,
                silhouette_pixels=size,
                visibility=visible / size if size else 0.0,
                visible_box=box_of_mask(labels == number) if visible else None,
                amodal_box=(silhouette.left, silhouette.top, columns, rows) if rows else None,
                amodal=amodal,
            )
        )
    return tuple(found)
