"""Objects in the browser: meshes, outlines, settling proposal, and height above the support."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import trimesh
import viser
from numpy.typing import NDArray

from burg_drake.compose import (
    SessionView,
    SettlingProposal,
    instance_bounds,
    instance_name,
    names_of_moved_instances,
)
from burg_drake.core import (
    Array,
    BurgError,
    MeshError,
    distinct_colors,
    quaternion_from_rotation,
    suppress_numpy_warnings,
    transform_points,
)
from burg_drake.geometry import hull_mesh
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import convex_polygon
from burg_drake.ui.panel_parts import FIXED_COLOR, Rgb8, status_style
from burg_drake.visualization import linear_light


@dataclass(frozen=True, eq=False)
class ObjectMesh:
    """The mesh of an object for the browser.

    Attributes:
        glb: mesh with materials in the object frame, as binary glTF.
        vertices: (N, 3) of the mesh without materials in the object frame [m].
        faces: (M, 3) of the mesh without materials.
    """

    glb: bytes
    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]

    @property
    def bounds(self) -> Array:
        """(2, 3) lower and upper corner in the object frame [m]."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)], dtype=float)


class ObjectMeshes:
    """Meshes by object name, loaded when first used.

    Args:
        library: library of the objects.
    """

    def __init__(self, library: ObjectLibrary) -> None:
        self.library = library
        self._meshes: dict[str, ObjectMesh] = {}

    def __getitem__(self, name: str) -> ObjectMesh:
        """The mesh of an object.

        Raises:
            UnknownNameError: there is no such object, or its file is missing.
            MeshError: its file is damaged.
        """
        if name not in self._meshes:
            self._meshes[name] = _read_mesh(self.library, name)
        return self._meshes[name]


def _read_mesh(library: ObjectLibrary, name: str) -> ObjectMesh:
    path = library.path(library.entry(name).mesh)
    try:
        with suppress_numpy_warnings():
            scene = trimesh.load_scene(path, process=False)
            parts = [g for g in scene.geometry.values() if isinstance(g, trimesh.Trimesh)]
            for part in parts:
                _make_matte(part)
            glb = scene.export(file_type="glb", include_normals=True)
        plain = trimesh.util.concatenate([_geometry_only(part) for part in parts])
    except Exception as error:  # the reader may raise any exception
        raise library.damaged(path) from error
    if not len(plain.faces):
        raise MeshError(f"{path} has no faces")
    plain.merge_vertices(merge_tex=True, merge_norm=True)
    return ObjectMesh(
        bytes(glb),
        np.asarray(plain.vertices, dtype=np.float32),
        np.asarray(plain.faces, dtype=np.uint32),
    )


def _make_matte(part: trimesh.Trimesh) -> None:
    """Gives a part a matte material; the default of glTF is metallic."""
    max_texture = 1024  # Pixels along each side; larger textures are reduced.
    material = getattr(part.visual, "material", None)
    if material is None:
        return
    if hasattr(material, "to_pbr"):
        material = material.to_pbr()
    material.metallicFactor, material.roughnessFactor = 0.0, 0.75  # paper, paint and plastic
    if material.baseColorFactor is not None:  # files have sRGB colours; glTF has linear light
        r, g, b, a = np.asarray(material.baseColorFactor, dtype=float) / 255.0
        material.baseColorFactor = [*(float(linear_light(c)) for c in (r, g, b)), a]
    image = material.baseColorTexture
    if image is not None and max(image.size) > max_texture:
        small = image.copy()
        small.thumbnail((max_texture, max_texture), reducing_gap=2.0)
        material.baseColorTexture = small
    part.visual.material = material


def _geometry_only(part: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(np.asarray(part.vertices), np.asarray(part.faces), process=False)


Coloring = Literal["objects", "random", "status"]

OBJECTS_NODE = "/objects"  # Path of the objects in viser's scene.
OUTLINE_LINE_WIDTH = 2.0  # Pixels; outlines of selected objects are wider.


@dataclass(frozen=True, eq=False)
class ShownInstance:
    """The appearance of an instance.

    Attributes:
        object: its name in the library.
        X_SO: (4, 4) pose.
        status: see `STATUS_STYLES`.
        selected: whether it is selected.
        fixed: whether it is background.
    """

    object: str
    X_SO: Array
    status: str = "ok"
    selected: bool = False
    fixed: bool = False


@dataclass(eq=False)
class _InstanceNodes:
    """The nodes of an instance in viser's scene."""

    object: str
    frame: viser.FrameHandle
    mesh: Any
    p_OV: Array
    outline: viser.LineSegmentsHandle
    color: Rgb8
    tint: viser.MeshHandle | None = None
    drawn: tuple[bytes, str, bool] | None = None


class SceneView:
    """Shows the instances of a scene.

    Args:
        scene: API of viser, whose world frame is the scene frame.
        meshes: meshes of the library's objects.
        attach: called with each new handle that can be clicked or dragged, and its instance's
            name.
    """

    def __init__(
        self, scene: viser.SceneApi, meshes: ObjectMeshes, attach: Callable[[Any, str], None]
    ) -> None:
        self._scene = scene
        self._object_meshes = meshes
        self._attach = attach
        self._nodes: dict[str, _InstanceNodes] = {}
        self._coloring: Coloring = "objects"
        self._color_count = 0

    def use_library(self, meshes: ObjectMeshes) -> None:
        """Uses the meshes of another library from now on."""
        if meshes is not self._object_meshes:
            self.show({}, self._coloring)
            self._object_meshes = meshes

    def show(self, instances: Mapping[str, ShownInstance], coloring: Coloring) -> None:
        """Shows instances in the browser; sends changes only."""
        self._coloring = coloring
        for name in list(self._nodes):
            if name not in instances or instances[name].object != self._nodes[name].object:
                self._remove(name)
        for name, shown in instances.items():
            if name not in self._nodes:
                self._nodes[name] = self._add(name, shown)
            self._update(self._nodes[name], name, shown)

    def _remove(self, name: str) -> None:
        nodes = self._nodes.pop(name)
        nodes.outline.remove()
        nodes.frame.remove()

    def _add(self, name: str, shown: ShownInstance) -> _InstanceNodes:
        ball_radius = 0.03  # Metres; a ball replaces an unreadable mesh.
        frame = self._scene.add_frame(f"{OBJECTS_NODE}/{name}", show_axes=False)
        mesh: Any
        try:
            object_mesh = self._object_meshes[shown.object]
        except BurgError:  # the issues report the error; the ball shows the position
            mesh = self._scene.add_icosphere(
                f"{OBJECTS_NODE}/{name}/look", radius=ball_radius, color=(200, 60, 200)
            )
            p_OV = ball_radius * np.vstack([np.eye(3), -np.eye(3)])
        else:
            mesh = self._scene.add_glb(f"{OBJECTS_NODE}/{name}/look", object_mesh.glb)
            p_OV = hull_mesh(object_mesh.vertices.astype(float)).vertices
        self._attach(mesh, name)
        outline = self._scene.add_line_segments(
            f"/outlines/{name}",
            np.zeros((1, 2, 3)),
            FIXED_COLOR,
            thickness=OUTLINE_LINE_WIDTH,
            thickness_units="screen",
        )
        self._color_count += 1
        red, green, blue = distinct_colors(self._color_count)[-1]
        color = (round(255 * red), round(255 * green), round(255 * blue))
        return _InstanceNodes(shown.object, frame, mesh, np.asarray(p_OV), outline, color)

    def _update(self, nodes: _InstanceNodes, name: str, shown: ShownInstance) -> None:
        outline_height = 4e-4  # Metres above the board; on the board, outlines would flicker.
        nodes.frame.position = shown.X_SO[:3, 3]
        nodes.frame.wxyz = quaternion_from_rotation(shown.X_SO[:3, :3])
        self._paint(nodes, name, shown)
        drawn = (shown.X_SO.tobytes(), shown.status, shown.selected)
        if drawn != nodes.drawn:
            nodes.drawn = drawn
            line = footprint(nodes.p_OV, shown.X_SO, outline_height)
            nodes.outline.points = line.astype(np.float32)
            nodes.outline.colors = np.array(_status_color(shown), dtype=np.uint8)
            nodes.outline.thickness = 6.0 if shown.selected else OUTLINE_LINE_WIDTH

    def _paint(self, nodes: _InstanceNodes, name: str, shown: ShownInstance) -> None:
        if self._coloring == "objects":
            nodes.mesh.visible = True
            if nodes.tint is not None:
                nodes.tint.visible = False
            return
        color = nodes.color if self._coloring == "random" else _status_color(shown)
        if nodes.tint is None:
            nodes.tint = self._add_tinted_mesh(name, shown.object, color)
        else:
            nodes.tint.color = color
        if nodes.tint is not None:
            nodes.tint.visible = True
            nodes.mesh.visible = False

    def _add_tinted_mesh(self, name: str, object: str, color: Rgb8) -> viser.MeshHandle | None:
        try:
            object_mesh = self._object_meshes[object]
        except BurgError:
            return None
        tint = self._scene.add_mesh_simple(
            f"{OBJECTS_NODE}/{name}/tint",
            object_mesh.vertices,
            object_mesh.faces,
            color=color,
            side="double",
        )
        self._attach(tint, name)
        return tint


def _status_color(shown: ShownInstance) -> Rgb8:
    return FIXED_COLOR if shown.fixed and shown.status == "ok" else status_style(shown.status).color


def footprint(p_OV: Array, X_SO: Array, height: float, margin: float = 0.004) -> Array:
    """The outline of an object's convex hull in the view from above.

    Args:
        p_OV: (N, 3) vertices of the object [m].
        X_SO: (4, 4) pose of the object.
        height: z of the outline in S [m].
        margin: distance between the outline and the hull [m].

    Returns:
        (M, 2, 3) segments of a closed line in S [m].
    """
    corner_points = 6  # Points of a rounded corner.
    p_SV = transform_points(X_SO, p_OV)[:, :2]
    around = np.linspace(0.0, 2.0 * np.pi, 4 * corner_points, endpoint=False)
    disc = margin * np.stack([np.cos(around), np.sin(around)], axis=-1)
    line = convex_polygon((p_SV[:, None] + disc).reshape(-1, 2))
    line = np.column_stack([line, np.full(len(line), height)])
    return np.stack([line, np.roll(line, -1, axis=0)], axis=1)


class ProposalView:
    """Shows the settled poses of a proposal.

    Args:
        scene: API of viser.
    """

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._shown: SettlingProposal | None = None
        self._handles: list[Any] = []

    def show(self, proposal: SettlingProposal | None, meshes: ObjectMeshes) -> None:
        """Shows a proposal in the browser.

        Args:
            proposal: proposal of the view; None hides it.
            meshes: meshes of the library's objects.
        """
        if proposal is self._shown:
            return
        self._shown = proposal
        for handle in self._handles:
            handle.remove()
        self._handles = []
        if proposal is None:
            return
        # The ghost of an object that moves less would flicker within the object.
        moved = names_of_moved_instances(proposal, distance=2e-3, angle_deg=2.0)
        for instance in proposal.document.instances:
            if instance_name(instance) in moved:
                self._add(instance_name(instance), instance.object, instance.X_SO.matrix(), meshes)

    def _add(self, name: str, object: str, X_SO: Any, meshes: ObjectMeshes) -> None:
        try:
            object_mesh = meshes[object]
        except BurgError:  # the issues report the error
            return
        self._handles.append(
            self._scene.add_mesh_simple(
                f"/ghosts/{name}",
                object_mesh.vertices,
                object_mesh.faces,
                color=(245, 159, 0),
                opacity=0.5,
                side="double",
                cast_shadow=False,
                position=X_SO[:3, 3],
                wxyz=quaternion_from_rotation(X_SO[:3, :3]),
            )
        )


class HeightView:
    """Shows the heights of selected objects above the surface below them.

    Args:
        scene: API of viser.
    """

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._shown: dict[str, tuple[viser.LineSegmentsHandle, viser.LabelHandle]] = {}

    def show(self, view: SessionView) -> None:
        """Updates lines and labels from a view."""
        for name in [name for name in self._shown if name not in view.gaps]:
            self._shown.pop(name)[0].remove()  # also removes its child, the label
        for name, gap in view.gaps.items():
            lower, upper = instance_bounds(view.state, name)
            x, y = (lower[:2] + upper[:2]) / 2.0
            ends = np.array([[x, y, lower[2]], [x, y, lower[2] - gap]])
            if name not in self._shown:
                self._shown[name] = self._add_line(name, ends)
            line, label = self._shown[name]
            line.points = ends[None].astype(np.float32)
            label.position = ends.mean(axis=0)
            label.text = f"{1e3 * gap:.1f} mm"

    def _add_line(
        self, name: str, ends: Array
    ) -> tuple[viser.LineSegmentsHandle, viser.LabelHandle]:
        color = status_style("hovering").color
        line = self._scene.add_line_segments(
            f"/heights/{name}", ends[None], color, thickness=2.0, thickness_units="screen"
        )
        return line, self._scene.add_label(f"/heights/{name}/label", "", anchor="center-left")
