"""Steps of MuJoCo Warp that do not depend on the order in which threads run.

MuJoCo Warp 4.0.0 numbers the constraint rows of contacts in the order in which threads find them,
and sums the Hessian of the friction cones and the square of the gradient in the order in which they
arrive. Sums of floats depend on that order: two trials of the same grasp differ. Its own option
`deterministic` does not help, as its sorting of contacts and rows is yet to be written.

`fixed_order` replaces three kernels while a step is recorded. Rows of contacts are numbered by
their geoms and by the contact's number in this pair, and sums are taken in that order. The kernels
are private to MuJoCo Warp and have the arguments of version 4.0.0, which is why `require_warp`
accepts no other. They are for the solver of trials: Newton, elliptic cones of dimension 3, dense.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import warp as wp
from mujoco_warp import Data
from mujoco_warp._src import constraint, solver
from mujoco_warp._src.types import ConstraintState

from burg_drake.simulation.batch.device_arrays import PairFriction

ROWS_PER_CONTACT = 3
"""Constraint rows of a contact."""
SLIDING_STATE = int(ConstraintState.CONE)
"""State of a contact that slides."""
MIN_DIVISOR = 1e-15
"""Smallest divisor, as in MuJoCo."""
PATCH_LOCK = threading.Lock()
"""Held while MuJoCo Warp's modules have other kernels, which all threads of the process share."""


@contextmanager
def fixed_order(data: Data) -> Iterator[None]:
    """Has the steps of this data that are recorded meanwhile take sums in a fixed order.

    Waits until no other thread of the process does the same. The data has to have been made with
    as many contacts for each world as rows / 3 or more.
    """
    replaced = {
        (constraint, "_efc_contact_init"): _ContactRows(data),
        (solver, "_update_gradient_JTCJ_dense"): _always(_add_cones),
        (solver, "_update_gradient_grad"): _always(_set_gradient),
    }
    with PATCH_LOCK:
        before = {(module, name): getattr(module, name) for module, name in replaced}
        for (module, name), new in replaced.items():
            setattr(module, name, new)
        try:
            yield
        finally:
            for (module, name), old in before.items():
                setattr(module, name, old)


def _always(kernel: Any) -> Callable[..., Any]:
    """A factory of kernels that makes this one."""
    return lambda *arguments: kernel


class _ContactRows:
    """Factory of the kernel that gives rows to contacts. It launches those that number them first.

    The fourth of the addresses of a contact, which contacts of dimension 3 do not need, lists the
    contacts of a world in this order.
    """

    def __init__(self, data: Data) -> None:
        self._data = data
        self._count = wp.zeros(data.nworld, dtype=int)
        self._keys = wp.zeros((data.nworld, data.njmax // ROWS_PER_CONTACT), dtype=wp.int64)

    def __call__(self, *arguments: Any) -> Any:
        data, contact = self._data, self._data.contact
        found = [data.nacon, contact.dist, contact.includemargin, contact.type]
        found += [contact.worldid, contact.geom, contact.geomcollisionid]
        room = data.naconmax // data.nworld
        outputs = [self._count, contact.efc_address]
        wp.launch(_forget, dim=data.nworld, inputs=[room], outputs=outputs)
        wp.launch(_collect_keys, dim=data.naconmax, inputs=found, outputs=[self._count, self._keys])
        wp.launch(
            _number_rows,
            dim=data.naconmax,
            inputs=[*found, data.nefc, self._count, self._keys, room],
            outputs=[contact.efc_address],
        )
        return _take_rows


@wp.func
def is_active(dist: float, margin: float, kind: int):
    """Whether a contact gets constraint rows."""
    return (kind & 1) != 0 and dist - margin < 0.0


@wp.func
def key_of(geom: wp.vec2i, number: int):
    """Key of a contact in its world, by geoms and number in the pair."""
    pair = wp.int64(geom[0]) * wp.int64(1 << 20) + wp.int64(geom[1])
    return pair * wp.int64(1 << 10) + wp.int64(number)


@wp.kernel(enable_backward=False)
def _forget(room: int, count: wp.array(dtype=int), efc_address: wp.array2d(dtype=int)):
    w = wp.tid()
    count[w] = 0
    efc_address[w * room, ROWS_PER_CONTACT] = -1


@wp.kernel(enable_backward=False)
def _collect_keys(
    nacon: wp.array(dtype=int),
    dist: wp.array(dtype=float),
    margin: wp.array(dtype=float),
    kind: wp.array(dtype=int),
    worldid: wp.array(dtype=int),
    geom: wp.array(dtype=wp.vec2i),
    number: wp.array(dtype=int),
    count: wp.array(dtype=int),
    keys: wp.array2d(dtype=wp.int64),
):
    i = wp.tid()
    if i >= wp.min(nacon[0], dist.shape[0]) or not is_active(dist[i], margin[i], kind[i]):
        return
    slot = wp.atomic_add(count, worldid[i], 1)
    if slot < keys.shape[1]:
        keys[worldid[i], slot] = key_of(geom[i], number[i])


@wp.kernel(enable_backward=False)
def _number_rows(
    nacon: wp.array(dtype=int),
    dist: wp.array(dtype=float),
    margin: wp.array(dtype=float),
    kind: wp.array(dtype=int),
    worldid: wp.array(dtype=int),
    geom: wp.array(dtype=wp.vec2i),
    number: wp.array(dtype=int),
    nefc: wp.array(dtype=int),
    count: wp.array(dtype=int),
    keys: wp.array2d(dtype=wp.int64),
    room: int,
    efc_address: wp.array2d(dtype=int),
):
    i = wp.tid()
    if i >= wp.min(nacon[0], dist.shape[0]) or not is_active(dist[i], margin[i], kind[i]):
        return
    w, key = worldid[i], key_of(geom[i], number[i])
    contacts = wp.min(count[w], keys.shape[1])
    rank = int(0)
    for other in range(contacts):
        if keys[w, other] < key:
            rank += 1
    efc_address[i, 0] = nefc[w] + ROWS_PER_CONTACT * rank
    if rank < room:
        efc_address[w * room + rank, ROWS_PER_CONTACT] = i
    if rank == 0 and contacts < room:
        efc_address[w * room + contacts, ROWS_PER_CONTACT] = -1


@wp.kernel(enable_backward=False)
def _take_rows(
    body_weldid: wp.array(dtype=int),
    body_dofnum: wp.array(dtype=int),
    body_dofadr: wp.array(dtype=int),
    dof_parentid: wp.array(dtype=int),
    geom_bodyid: wp.array(dtype=int),
    njmax: int,
    njmax_nnz: int,
    nacon: wp.array(dtype=int),
    dist: wp.array(dtype=float),
    condim: wp.array(dtype=int),
    margin: wp.array(dtype=float),
    adhesion: wp.array(dtype=float),
    worldid: wp.array(dtype=int),
    geom: wp.array(dtype=wp.vec2i),
    kind: wp.array(dtype=int),
    nefc: wp.array(dtype=int),
    efc_address: wp.array2d(dtype=int),
    efc_id: wp.array2d(dtype=int),
    jtdaj_adr: wp.array2d(dtype=int),
    jtdaj_nrow: wp.array2d(dtype=int),
    jtdaj_nblock: wp.array(dtype=int),
    J_rownnz: wp.array2d(dtype=int),
    J_rowadr: wp.array2d(dtype=int),
    Jqvel: wp.array2d(dtype=float),
    nnz: wp.array(dtype=int),
):
    """In place of `constraint._efc_contact_init`."""
    i = wp.tid()
    if i >= wp.min(nacon[0], dist.shape[0]) or not is_active(dist[i], margin[i], kind[i]):
        return
    w, first = worldid[i], efc_address[i, 0]
    wp.atomic_add(nefc, w, ROWS_PER_CONTACT)
    for k in range(ROWS_PER_CONTACT):
        if first + ROWS_PER_CONTACT > njmax:
            efc_address[i, k] = -1
        else:
            efc_address[i, k] = first + k
            efc_id[w, first + k] = i


@wp.kernel(enable_backward=False)
def _set_gradient(
    qfrc_smooth: wp.array2d(dtype=float),
    qfrc_constraint: wp.array2d(dtype=float),
    Ma: wp.array2d(dtype=float),
    state_changed_count: wp.array(dtype=int),
    done: wp.array(dtype=bool),
    gradient: wp.array2d(dtype=float),
    square: wp.array(dtype=float),
):
    """In place of `solver._update_gradient_grad`."""
    w, dof = wp.tid()
    if done[w]:
        return
    gradient[w, dof] = Ma[w, dof] - qfrc_smooth[w, dof] - qfrc_constraint[w, dof]
    if dof == 0:
        total = float(0.0)
        for k in range(Ma.shape[1]):
            one = Ma[w, k] - qfrc_smooth[w, k] - qfrc_constraint[w, k]
            total += one * one
        square[w] = total


@wp.func
def cone_curvature(
    friction: float,
    mu: float,
    D: float,
    jar: wp.vec3,
    column_1: wp.vec3,
    column_2: wp.vec3,
):
    """One element of the Hessian of a sliding contact's cost.

    MuJoCo documentation, "Computation": the cost is half the square of the distance of the
    residual from the cone, by its normal part N and the length T of its tangential part, with the
    weight D / (mu^2 (1 + mu^2)). Its second derivative in the residual, scaled to the cone, is
    that weight times [1, -mu t; -mu t, mu N / T t t' + (mu^2 - mu N / T) 1] with t the direction.

    Args:
        friction: coefficient of the contact.
        mu: friction over the square root of `impratio`.
        D: weight of the normal row.
        jar: residual of the three rows.
        column_1, column_2: elements of the three rows of the Jacobian, of both degrees of freedom.
    """
    weight = mu * mu * (1.0 + mu * mu)
    if weight == 0.0:
        return float(0.0)
    u_1, u_2 = friction * jar[1], friction * jar[2]
    T = wp.max(wp.sqrt(u_1 * u_1 + u_2 * u_2), MIN_DIVISOR)
    n_1, n_2 = mu * column_1[0], mu * column_2[0]
    a_1, a_2 = friction * column_1[1], friction * column_2[1]
    b_1, b_2 = friction * column_1[2], friction * column_2[2]
    t_1, t_2 = (u_1 * a_1 + u_2 * b_1) / T, (u_1 * a_2 + u_2 * b_2) / T
    ratio = mu * mu * jar[0] / T
    value = n_1 * n_2 - mu * (n_1 * t_2 + n_2 * t_1) + ratio * t_1 * t_2
    return D / weight * (value + (mu * mu - ratio) * (a_1 * a_2 + b_1 * b_2))


@wp.kernel(enable_backward=False)
def _add_cones(
    impratio_invsqrt: wp.array(dtype=float),
    dof_tri_row: wp.array(dtype=int),
    dof_tri_col: wp.array(dtype=int),
    dist: wp.array(dtype=float),
    margin: wp.array(dtype=float),
    friction: wp.array(dtype=PairFriction),
    condim: wp.array(dtype=int),
    efc_address: wp.array2d(dtype=int),
    worldid: wp.array(dtype=int),
    J: wp.array3d(dtype=float),
    D: wp.array2d(dtype=float),
    state: wp.array2d(dtype=int),
    naconmax: int,
    nacon: wp.array(dtype=int),
    Jaref: wp.array2d(dtype=float),
    done: wp.array(dtype=bool),
    blocks_per_block: int,
    blocks: int,
    h: wp.array3d(dtype=float),
):
    """In place of `solver._update_gradient_JTCJ_dense`: each thread sums one element of the Hessian
    over the contacts of some worlds."""
    block, element = wp.tid()
    i, j = dof_tri_row[element], dof_tri_col[element]
    worlds = done.shape[0]
    room = naconmax / worlds
    w = block
    while w < worlds:
        if not done[w]:
            total, k = float(0.0), int(0)
            while k < room:
                contact = efc_address[w * room + k, ROWS_PER_CONTACT]
                k += 1
                if contact < 0:
                    k = room
                else:
                    row = efc_address[contact, 0]
                    if row >= 0:
                        if state[w, row] == SLIDING_STATE:
                            total += cone_curvature(
                                friction[contact][0],
                                friction[contact][0] * impratio_invsqrt[0],
                                D[w, row],
                                wp.vec3(Jaref[w, row], Jaref[w, row + 1], Jaref[w, row + 2]),
                                wp.vec3(J[w, row, i], J[w, row + 1, i], J[w, row + 2, i]),
                                wp.vec3(J[w, row, j], J[w, row + 1, j], J[w, row + 2, j]),
                            )
            h[w, i, j] = h[w, i, j] + total
        w += blocks
