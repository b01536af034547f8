from .fields import (
    Field as Field,
    Vector as Vector,
    box as box,
    capsule as capsule,
    cylinder as cylinder,
    domed as domed,
    gradient as gradient,
    half_space as half_space,
    inset as inset,
    join as join,
    meet as meet,
    prism as prism,
    sphere as sphere,
)
from .inertia import Inertia as Inertia, box_inertia as box_inertia
from .obj import Part as Part, mtl_text as mtl_text, obj_text as obj_text
from .pad_mesh import PAD_FILE as PAD_FILE, pad_vtk as pad_vtk, squares as squares
from .sdf import (
    DISSIPATION as DISSIPATION,
    FRICTION as FRICTION,
    HYDROELASTIC_MODULUS as HYDROELASTIC_MODULUS,
    RESOLUTION_HINT as RESOLUTION_HINT,
    FingerJoint as FingerJoint,
    filter_group as filter_group,
    finger_joint as finger_joint,
    link as link,
    model_sdf as model_sdf,
    numbers as numbers,
)
from .shapes import (
    PAD as PAD,
    Box as Box,
    Capsule as Capsule,
    Cylinder as Cylinder,
    Shape as Shape,
    axis_pose as axis_pose,
    mirrored_finger as mirrored_finger,
)
from .solids import plate as plate, rod as rod, rounded_hull as rounded_hull
from .surface import Piece as Piece, part as part, pieces as pieces, turned as turned
from .surface_nets import surface_net as surface_net
from .write import write_models as write_models
