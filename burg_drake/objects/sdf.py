"""The Drake model of an object, as SDF text.

How an object touches the world is decided here and nowhere else: convex pieces, rigid in Drake's
hydroelastic contact. Gripper pads and tables are compliant, so that objects meet them by contact
surfaces; two objects meet by point contact between their pieces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

from burg_drake.objects.library import MassProperties

LINK = "body"
"""Name of an object's only link; its frame is O."""


@dataclass(frozen=True, kw_only=True)
class Contact:
    """How an object's pieces touch.

    Attributes:
        hydroelastic: `rigid`, or `compliant` with `modulus`.
        modulus: hydroelastic modulus of compliant pieces [Pa].
        dissipation: Hunt-Crossley dissipation [s/m].
    """

    hydroelastic: str = "rigid"
    modulus: float = 1e7
    dissipation: float = 20.0


DEFAULT_CONTACT = Contact()


def model_sdf(
    name: str,
    mass_properties: MassProperties,
    friction: float,
    visual: str,
    pieces: Sequence[str],
    contact: Contact = DEFAULT_CONTACT,
) -> str:
    """SDF of an object.

    Args:
        name: model name.
        mass_properties: of the object, in O.
        friction: coefficient, static and dynamic.
        visual: path of the visual mesh relative to the SDF.
        pieces: paths of the convex pieces relative to the SDF.
        contact: how the pieces touch.
    """
    ixx, iyy, izz, ixy, ixz, iyz = (f"{v!r}" for v in mass_properties.inertia)
    x, y, z = (f"{v!r}" for v in mass_properties.center_of_mass)
    collisions = "".join(
        _collision(f"piece_{i:03d}", uri, friction, contact) for i, uri in enumerate(pieces)
    )
    return f"""<?xml version="1.0"?>
<sdf version="1.9" xmlns:drake="http://drake.mit.edu">
  <model name="{escape(name)}">
    <link name="{LINK}">
      <inertial>
        <pose>{x} {y} {z} 0 0 0</pose>
        <mass>{mass_properties.mass!r}</mass>
        <inertia>
          <ixx>{ixx}</ixx>
          <iyy>{iyy}</iyy>
          <izz>{izz}</izz>
          <ixy>{ixy}</ixy>
          <ixz>{ixz}</ixz>
          <iyz>{iyz}</iyz>
        </inertia>
      </inertial>
      <visual name="visual">
        <geometry>
          <mesh>
            <uri>{escape(visual)}</uri>
          </mesh>
        </geometry>
      </visual>
{collisions}    </link>
  </model>
</sdf>
"""


def _collision(name: str, uri: str, friction: float, contact: Contact) -> str:
    return f"""      <collision name="{name}">
        <geometry>
          <mesh>
            <uri>{escape(uri)}</uri>
            <drake:declare_convex/>
          </mesh>
        </geometry>
        <drake:proximity_properties>
{_hydroelastic(contact)}
          <drake:mu_dynamic>{friction!r}</drake:mu_dynamic>
          <drake:mu_static>{friction!r}</drake:mu_static>
          <drake:hunt_crossley_dissipation>{contact.dissipation!r}</drake:hunt_crossley_dissipation>
        </drake:proximity_properties>
      </collision>
"""


def _hydroelastic(contact: Contact) -> str:
    if contact.hydroelastic == "rigid":
        return "          <drake:rigid_hydroelastic/>"
    return (
        "          <drake:compliant_hydroelastic/>\n"
        f"          <drake:hydroelastic_modulus>{contact.modulus!r}</drake:hydroelastic_modulus>"
    )
