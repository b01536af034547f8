"""What other engines are told of a hand: links, joints and the flat fronts of its pads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from burg_drake.core import InvalidInputError, resolve_reference, transform_points
from burg_drake.export import pad_spheres
from burg_drake.objects import LibraryDocument, ObjectLibrary
from burg_drake.scene import Board, Scene, SceneDocument
from burg_drake.station import (
    HandDescription,
    Station,
    StationDocument,
    build_station_diagram,
    load_hand,
    read_hand,
)

COMPLIANT = """<drake:proximity_properties><drake:compliant_hydroelastic/>
<drake:hydroelastic_modulus>1e7</drake:hydroelastic_modulus>
<drake:mesh_resolution_hint>0.002</drake:mesh_resolution_hint></drake:proximity_properties>"""
SDF = """\
<sdf version="1.9" xmlns:drake="http://drake.mit.edu"><model name="pincer">
  <link name="base"><collision name="block">
    <pose>0 0 -0.1 0 0 0</pose><geometry><box><size>0.1 0.1 0.02</size></box></geometry>
  </collision></link>
  {fingers}{more}</model></sdf>
"""
FINGER = """\
  <link name="{name}"><pose relative_to="slide_{name}"/>
    <inertial><mass>0.05</mass><inertia><ixx>1e-5</ixx><iyy>1e-5</iyy><izz>1e-5</izz></inertia>
    </inertial>
    <collision name="rubber"><pose>{side} 0 0 0 0 0</pose><geometry>{shape}</geometry>
      {compliant}</collision></link>
  <joint name="slide_{name}" type="prismatic"><parent>base</parent><child>{name}</child>
    <pose relative_to="base">0 0 0 0 0 0</pose>
    <axis><xyz>1 0 0</xyz><limit><lower>-0.05</lower><upper>0.05</upper><effort>25</effort></limit>
    </axis></joint>
"""
LOOSE = """\
  <link name="flap"><pose relative_to="hinge"/>
    <inertial><mass>0.05</mass><inertia><ixx>1e-5</ixx><iyy>1e-5</iyy><izz>1e-5</izz></inertia>
    </inertial></link>
  <joint name="hinge" type="revolute"><parent>base</parent><child>flap</child>
    <pose relative_to="base">0 0 0 0 0 0</pose>
    <axis><xyz>0 0 1</xyz><limit><effort>0</effort></limit></axis></joint>
"""
DOCUMENT = """\
version: 1
name: pincer
model: pincer.sdf
body: base
X_HG: {translation: [0, 0, 0]}
opening: [0.0, 0.08]
force: 25
closing_speed: 0.1
fingers:
  - {body: a, joint: slide_a, pad: rubber, closed: 0.0, open: 0.04}
  - {body: b, joint: slide_b, pad: rubber, closed: 0.0, open: -0.04}
"""
BOX = "<box><size>0.01 0.02 0.03</size></box>"


def described(station: Station) -> HandDescription:
    document = SceneDocument(name="empty", library="none", board=Board(), instances=())
    library = ObjectLibrary(LibraryDocument(name="none", objects={}), Path("none"))
    scene = Scene(document, library, Path("empty.yaml"))
    return read_hand(build_station_diagram(scene, station, robot="hand"))


def station_of(reference: str) -> Station:
    hand, base = load_hand(reference), Path(reference).parent
    document = StationDocument(name="test", hand=reference)
    return Station(
        document, hand, resolve_reference(hand.model, base=base), None, Path("test.yaml")
    )


def pincer(folder: Path, shape: str = BOX, more: str = "") -> Station:
    """A hand whose pads are 10 mm thick along the closing direction."""
    fingers = "".join(
        FINGER.format(name=name, side=side, shape=shape, compliant=COMPLIANT)
        for name, side in (("a", 0.005), ("b", -0.005))
    )
    (folder / "pincer.sdf").write_text(SDF.format(fingers=fingers, more=more), encoding="utf-8")
    (folder / "pincer.yaml").write_text(DOCUMENT, encoding="utf-8")
    return station_of(str(folder / "pincer.yaml"))


@pytest.mark.parametrize(
    ("reference", "size", "thickness"),
    [("panda_hand", (0.0175, 0.0185), 0.0152), ("wsg_50", (0.02, 0.02), 0.008)],
)
def test_built_in_hands(reference: str, size: tuple[float, float], thickness: float) -> None:
    """A pad's pressure grows to the modulus of 1e7 Pa in its middle."""
    found = described(station_of(reference))
    for finger, closing in zip(found.fingers, (-1.0, 1.0), strict=True):
        front = finger.front
        assert sorted(front.size) == pytest.approx(sorted(size))
        assert front.area == pytest.approx(size[0] * size[1])
        assert front.thickness == pytest.approx(thickness)
        assert front.stiffness == pytest.approx(1e7 / (thickness / 2))
        R_GH = found.document.X_HG.matrix()[:3, :3].T
        np.testing.assert_allclose(
            R_GH @ finger.X_HB[:3, :3] @ front.X_BP[:3, 2], (closing, 0.0, 0.0), atol=1e-9
        )


def test_where_links_and_their_masses_are(tmp_path: Path) -> None:
    found = described(pincer(tmp_path))
    assert [shape.kind for shape in found.body.shapes] == ["box"]
    assert found.coupling == -1.0
    for finger, side in zip(found.fingers, (1.0, -1.0), strict=True):
        assert finger.mass == pytest.approx(0.05)
        np.testing.assert_allclose(finger.I_BCm, 1e-5 * np.eye(3), atol=1e-12)
        np.testing.assert_allclose(finger.axis_B, (1.0, 0.0, 0.0), atol=1e-12)
        assert (finger.pad.kind, finger.shapes) == ("box", ())
        np.testing.assert_allclose(finger.front.X_BP[:3, 3], 0.0, atol=1e-9)
        np.testing.assert_allclose(finger.front.X_BP[:3, 2], (-side, 0.0, 0.0), atol=1e-9)
        assert finger.front.size == pytest.approx((0.02, 0.03))
        assert finger.front.stiffness == pytest.approx(1e7 / 0.005)


def test_a_mesh_pad_has_the_front_and_the_spheres_that_fit_it(tmp_path: Path) -> None:
    """The pad is widest in its middle, and narrows to a front on either side."""
    corners = [(y, z) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]
    points = [(0.0, 0.012 * y, 0.015 * z) for y, z in corners]
    points += [(x, 0.010 * y, 0.012 * z) for x in (-0.005, 0.005) for y, z in corners]
    pad = trimesh.PointCloud(points).convex_hull
    pad.export(tmp_path / "pad.obj")
    shape = (
        "<mesh xmlns:drake='http://drake.mit.edu'><uri>pad.obj</uri><drake:declare_convex/></mesh>"
    )
    found = described(pincer(tmp_path, shape))
    for finger in found.fingers:
        assert sorted(finger.front.size) == pytest.approx([0.020, 0.024])
        assert finger.front.stiffness == pytest.approx(1e7 / 0.005)
        centers, radii = pad_spheres(finger.front)
        center_of_pad = (0.0, 0.0, -0.005)
        spheres = transform_points(finger.front.X_BP, centers - center_of_pad)
        depth = np.einsum("fi,sfi->sf", pad.face_normals, pad.triangles[:, 0] - spheres[:, None])
        np.testing.assert_array_less(radii, depth.min(axis=1) + 1e-9)
        np.testing.assert_allclose(centers[:, 2], -radii)
        assert len(radii) >= 36


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ("<sphere><radius>0.005</radius></sphere>", "pad 'rubber' of 'a' has only"),
        (
            "<cylinder><radius>0.005</radius><length>0.02</length></cylinder>",
            "needs a flat front",
        ),
    ],
)
def test_a_curved_pad_is_refused(tmp_path: Path, shape: str, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        described(pincer(tmp_path, shape))


def test_other_joints_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="'pincer': links flap"):
        described(pincer(tmp_path, more=LOOSE))
