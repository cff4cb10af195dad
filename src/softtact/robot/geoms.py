"""Bodies of any MuJoCo model as meshes that a sensor can press, and the engine's contact forces between geoms.

Lengths of MuJoCo are taken to be in m; meshes are in mm, in the body's frame.
"""

from collections.abc import Callable, Collection, Iterator
from typing import Any, cast

import mujoco
import numpy as np
import trimesh
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from softtact.errors import InputError
from softtact.geometry.meshes import place
from softtact.geometry.pose import Pose

MM = 1e-3
# A ball of 10 mm of so many facets lies within 2 um of a sphere; so does a round side of so many sections.
_SUBDIVISIONS, _SECTIONS = 5, 160
_TYPES = mujoco.mjtGeom


def _round_end(size):
    return trimesh.creation.capsule(radius=size[0], height=2 * size[1], count=[_SECTIONS, _SECTIONS // 2])


def _ball(size):
    ball = trimesh.creation.icosphere(subdivisions=_SUBDIVISIONS)
    return ball.apply_scale(size)


_SHAPES: dict[Any, Callable[[np.ndarray], trimesh.Trimesh]] = {
    _TYPES.mjGEOM_BOX: lambda size: trimesh.creation.box(2 * size),
    _TYPES.mjGEOM_SPHERE: lambda size: _ball(size[:1].repeat(3)),
    _TYPES.mjGEOM_ELLIPSOID: _ball,
    _TYPES.mjGEOM_CAPSULE: _round_end,
    _TYPES.mjGEOM_CYLINDER: lambda size: trimesh.creation.cylinder(radius=size[0], height=2 * size[1], sections=_SECTIONS)}


def name_of(model: Any, body: int) -> str:
    """The name of a body, or its number where it has none."""
    return model.body(body).name or f"body {body}"


def geoms_of(model: Any, body: int) -> np.ndarray:
    """Numbers of a body's geoms: of those that collide, or of all where none does."""
    return _colliding(model, _all_geoms(model, body))


def _all_geoms(model, body):
    return model.body_geomadr[body] + np.arange(model.body_geomnum[body])


def _colliding(model, geoms):
    collide = (model.geom_contype[geoms] != 0) | (model.geom_conaffinity[geoms] != 0)
    return geoms[collide] if collide.any() else geoms


def rigid_body_of(model: Any, body: int) -> int:
    """The body that a body is fixed to, through any number of bodies without joints; itself where that is the world."""
    return int(model.body_weldid[body]) or body


def body_mesh(model: Any, body: int) -> trimesh.Trimesh:
    """The geoms of a body and of the bodies fixed to it in one mesh in mm, in the body's frame: those that collide, or all where
    none does.

    They may overlap: a sensor touches their lower envelope. Meshes are the true ones, not their convex hulls.
    Raises InputError for a body without geoms, and for a plane or a height field, which have no sides.
    """
    fixed = _fixed_to(model, body)
    geoms = _colliding(model, np.concatenate([_all_geoms(model, one) for one in fixed]))
    parts = [place(_geom_mesh(model, int(model.geom_bodyid[geom]), geom), pose=fixed[int(model.geom_bodyid[geom])])
             for geom in geoms]
    if not parts:
        raise InputError(f"The body {name_of(model, body)!r} has no geom that a sensor can press; give it one, or leave it out of "
                         "'objects'.")
    return cast(trimesh.Trimesh, trimesh.util.concatenate(parts))


def _fixed_to(model, body):
    """{number: pose in the body's frame} of a body and of those that hang on it without a joint."""
    found = {body: Pose(np.zeros(3))}
    for one in range(body + 1, model.nbody if body else 0):     # a parent has a lower number than its children
        parent = found.get(int(model.body_parentid[one]))
        if parent is not None and model.body_weldid[one] == model.body_weldid[body]:
            turn = Rotation.from_quat(model.body_quat[one], scalar_first=True)
            found[one] = Pose(parent.apply(model.body_pos[[one]] / MM)[0], parent.rotation * turn)
    return found


def _geom_mesh(model, body, geom):
    kind = _TYPES(model.geom_type[geom])
    if kind in (_TYPES.mjGEOM_MESH, _TYPES.mjGEOM_SDF):
        mesh = model.mesh(model.geom_dataid[geom])
        vertices = model.mesh_vert[mesh.vertadr[0]:mesh.vertadr[0] + mesh.vertnum[0]]
        faces = model.mesh_face[mesh.faceadr[0]:mesh.faceadr[0] + mesh.facenum[0]]
        shape = trimesh.Trimesh(vertices / MM, faces, process=False)
    elif kind in _SHAPES:
        shape = _SHAPES[kind](model.geom_size[geom] / MM)
    else:
        what = kind.name.removeprefix("mjGEOM_").lower()
        raise InputError(f"The body {name_of(model, body)!r} has a geom of type {what!r}, which a sensor cannot press; use a box, "
                         "a sphere, an ellipsoid, a capsule, a cylinder or a mesh.")
    turn = Rotation.from_quat(model.geom_quat[geom], scalar_first=True)
    shape.vertices = turn.apply(shape.vertices) + model.geom_pos[geom] / MM
    return shape


def contacts_of(data: Any, geoms: Collection[int]) -> Iterator[tuple[int, int, int, float]]:
    """(number of the contact, geom of `geoms`, other geom, sign) of each contact through which geoms can press each other.

    With a margin geoms press before they touch. The other geom is -1 where a flex touches.

    sign: of MuJoCo's force on the geom of `geoms`, as it acts on the second of a pair
    """
    pairs, rows = data.contact.geom.tolist(), data.contact.efc_address.tolist()
    for number, ((first, second), row) in enumerate(zip(pairs, rows, strict=True)):
        if row < 0 or (first in geoms) == (second in geoms):
            continue
        yield (number, second, first, 1.0) if second in geoms else (number, first, second, -1.0)


def contact_force(model: Any, data: Any, number: int, sign: float) -> np.ndarray:
    """The force (3,) in N of a contact in the world's frame, times a sign."""
    wrench = np.zeros(6)
    mujoco.mj_contactForce(model, data, number, wrench)
    return sign * data.contact[number].frame.reshape(3, 3).T @ wrench[:3]


def pose_of_frame(position_m: ArrayLike, matrix: ArrayLike) -> tuple[np.ndarray, Rotation]:
    """(positions (..., 3) in mm, rotations) of frames of MuJoCo, by their places in m and their matrices of nine numbers."""
    matrices = np.asarray(matrix)
    return np.array(position_m) / MM, Rotation.from_matrix(matrices.reshape(*matrices.shape[:-1], 3, 3))
