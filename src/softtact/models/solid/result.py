"""Fields of a press of solids: what all bodies, frames and pairs in contact did, at the nodes and load step by load step."""

from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.errors import InputError
from softtact.fem.solid_mesh import ELEMENTS, SolidMesh

if TYPE_CHECKING:
    from softtact.contact.pair import ContactPair, PairHistory, PairState
    from softtact.fem.elements import Element
    from softtact.models.solid.body import SolidBody, SolidState
    from softtact.models.solid.path import SolidLoadStep

_VOIGT = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
_XYZ, _RANGE = "xyz", "least_largest"


def _array(units: str, *dimensions: str, later: bool = False) -> Any:
    """A field that files hold as an array; its metadata say how. later: files of earlier versions do not hold it."""
    return field(metadata={"units": units, "dimensions": dimensions, "later": later})


@dataclass(frozen=True)
class SolidFields:
    """What solids did: s load steps, n nodes of the mesh, f frames, p pairs in contact, r nodes of rigid objects."""

    mesh: SolidMesh
    """All soft bodies at rest."""
    frames: tuple[str, ...]
    """Names of the frames."""
    pairs: tuple[str, ...]
    """Names of the pairs in contact."""
    displacement_mm: np.ndarray = _array("mm", "step", "node", _XYZ)
    """(s, n, 3) of the nodes."""
    frame_load: np.ndarray = _array("N, N mm", "step", "frame", "load")
    """(s, f, 6): force in N and torque in N mm of each frame on the bodies, about its reference point."""
    frame_way_mm: np.ndarray = _array("mm", "step", "frame", _XYZ)
    """(s, f, 3): displacement of the frames' reference points."""
    contact_pressure_mpa: np.ndarray = _array("MPa", "step", "pair", "node")
    """(s, p, n) per area at rest, positive in compression; 0 where the surface is open, nan off the pair's surface."""
    contact_traction_mpa: np.ndarray = _array("MPa", "step", "pair", "node", _XYZ, later=True)
    """(s, p, n, 3): force on the pair's surface per area at rest, friction and pressure; nan as above."""
    contact_slip_mm: np.ndarray = _array("mm", "step", "pair", "node", later=True)
    """(s, p, n): how far the surface slid along the other one since it last came to touch; nan where it does not touch it."""
    volume_ratio: np.ndarray = _array("1", "step", "node")
    """(s, n) J."""
    von_mises_mpa: np.ndarray = _array("MPa", "step", "node")
    """(s, n) of the Cauchy stress."""
    increments: np.ndarray = _array("1", "step")
    """(s,) parts that a step was divided into."""
    volume_ratio_range: np.ndarray = _array("1", "step", _RANGE)
    """(s, 2) least and largest J at the points of quadrature."""
    stretch_range: np.ndarray = _array("1", "step", _RANGE)
    """(s, 2) least and largest isochoric principal stretch at the same points."""
    work_mj: np.ndarray = _array("mJ", "step")
    """(s,) work of frames and pressures up to the step's end."""
    dissipated_mj: np.ndarray = _array("mJ", "step")
    """(s,) energy that friction took up to the step's end."""
    strain_energy_mj: np.ndarray = _array("mJ", "step")
    """(s,) energy of the bodies."""
    object_points_mm: np.ndarray = _array("mm", "object_node", _XYZ)
    """(r, 3) nodes of rigid objects at rest."""
    object_triangles: np.ndarray = _array("1", "object_facet", "object_corner")
    """(t, 3) their facets."""
    object_displacement_mm: np.ndarray = _array("mm", "step", "object_node", _XYZ)
    """(s, r, 3) of the same nodes."""

    @classmethod
    def of_displacement(cls, mesh: SolidMesh, displacement_mm: np.ndarray, **known: Any) -> "SolidFields":
        """Fields of a body by its displacement (s, n, 3) in mm and what else is known, by names; what is not is nan.

        Without names of `frames` and `pairs` there are none.
        """
        names = {"frames": known.pop("frames", ()), "pairs": known.pop("pairs", ())}
        sizes = {"step": len(displacement_mm), "node": len(mesh.points), "frame": len(names["frames"]), "pair": len(names["pairs"]),
                 _XYZ: 3, "load": 6, _RANGE: 2, "object_corner": 3}
        unknown = {one.name: np.full([sizes.get(name, 0) for name in one.metadata["dimensions"]], np.nan)
                   for one in fields(cls) if one.metadata}
        unknown["object_triangles"] = np.zeros((0, 3), dtype=int)
        return cls(mesh=mesh, **names, **unknown | {"displacement_mm": displacement_mm} | known)

    def load(self, frame: str) -> np.ndarray:
        """Loads (s, 6) of a frame by its name. InputError lists the names where there is none of it."""
        if frame not in self.frames:
            raise InputError(f"The result has no frame {frame!r}; its frames are {', '.join(self.frames) or 'none'}.")
        return self.frame_load[:, self.frames.index(frame)]

    @property
    def pressed_mpa(self) -> np.ndarray:
        """(s, n): contact pressure at the nodes, of the pair with the largest; nan off all of them."""
        largest = np.nanmax(np.where(np.isnan(self.contact_pressure_mpa), -np.inf, self.contact_pressure_mpa), axis=1,
                            initial=-np.inf)
        return np.where(np.isfinite(largest), largest, np.nan)


def gathered(body: "SolidBody", steps: "Iterable[SolidLoadStep]") -> SolidFields:
    """The `SolidFields` of load steps."""
    steps = list(steps)
    if not steps:
        raise InputError("There is no load step to keep; solve one.")
    n = len(body.mesh.points)
    surfaces = [body.surface_nodes(frame.name) for frame in body.frames if frame.nodes.min() >= n]
    nodal = [nodal_fields(body, step.state) for step in steps]
    contacts = [[contact_at_nodes(*one, n) for one in zip(body.pairs, step.state.histories, step.state.contacts, strict=True)]
                for step in steps]
    pressure, traction, slip = (np.array([[one[k] for one in step] for step in contacts]) for k in range(3))

    def each(value):
        return np.array([value(step) for step in steps])

    return SolidFields(
        mesh=body.mesh, frames=tuple(frame.name for frame in body.frames), pairs=_names(body),
        displacement_mm=each(lambda step: step.state.displacement[:n]), frame_load=each(lambda step: step.loads),
        frame_way_mm=np.array([[pose.translation for pose in step.state.poses] for step in steps]).reshape(len(steps), -1, 3),
        contact_pressure_mpa=pressure.reshape(len(steps), -1, n), contact_slip_mm=slip.reshape(len(steps), -1, n),
        contact_traction_mpa=traction.reshape(len(steps), -1, n, 3),
        volume_ratio=np.array([J for J, _ in nodal]), von_mises_mpa=np.array([mises for _, mises in nodal]),
        increments=each(lambda step: step.increments), volume_ratio_range=each(lambda step: step.volume_ratio),
        stretch_range=each(lambda step: step.stretch), work_mj=each(lambda step: step.work_mj),
        dissipated_mj=each(lambda step: step.dissipated_mj), strain_energy_mj=each(lambda step: step.state.strain_energy),
        object_points_mm=body.points[n:],
        object_triangles=np.concatenate([np.zeros((0, 3), int), *(nodes - n for nodes in surfaces)]),
        object_displacement_mm=each(lambda step: step.state.displacement[n:]))


def _names(body):
    """Names of the pairs, numbered where they repeat."""
    names = [pair.name for pair in body.pairs]
    return tuple(name if names.count(name) == 1 else f"{name} {number}" for number, name in enumerate(names, start=1))


def nodal_fields(body: "SolidBody", state: "SolidState") -> tuple[np.ndarray, np.ndarray]:
    """Volume ratio J and von Mises stress of the Cauchy stress in MPa at the mesh's nodes (n,); nan where no element is.

    In each element the values at the points of quadrature are fitted by a linear function, which gives those at its nodes; a node
    has the mean of its elements, by their volumes.
    """
    n = len(body.mesh.points)
    sums, weights = np.zeros((2, n)), np.zeros(n)
    for element, (_, nodes, block), memory in zip(_elements(body.mesh), body.blocks, state.memories, strict=True):
        deformed = block.loops.deformation(state.displacement[nodes], block.at_rest)
        S = block.isochoric(deformed.C, tangent=False, history=memory).stress[:, _VOIGT].reshape(deformed.F.shape)
        cauchy = np.einsum("egik,egkl,egjl->egij", deformed.F, S, deformed.F, optimize=True) / deformed.J[..., None, None]
        mean = np.trace(cauchy, axis1=2, axis2=3) / 3
        deviator = cauchy - mean[..., None, None] * np.eye(3)     # the stress of U(J) is hydrostatic: no part of it
        mises = np.sqrt(1.5 * (deviator**2).sum(axis=(2, 3)))
        to_nodes = _linear_fit(element, block.at_rest.volumes.shape[1])
        volume = np.repeat(block.at_rest.volumes.sum(axis=1)[block.at_rest.shapes], nodes.shape[1])
        weights += np.bincount(nodes.ravel(), volume, n)
        for nodal, values in zip(sums, (deformed.J, mises), strict=True):
            nodal += np.bincount(nodes.ravel(), volume * (values @ to_nodes.T).ravel(), n)
    J, mises = np.where(weights > 0, sums / np.where(weights > 0, weights, 1.0), np.nan)
    return J, np.maximum(mises, 0.0)      # an extrapolation may fall below


def _elements(mesh: SolidMesh) -> "list[Element]":
    return [ELEMENTS[kind] for _, kind, nodes in mesh.cells if len(nodes)]


def _linear_fit(element: "Element", points: int) -> np.ndarray:
    """Matrix (m, g) that takes values at the points of the rule of so many points to the nodes."""
    rule = next(rule for rule in (element.quadrature, element.reduced) if rule is not None and len(rule.weights) == points)
    return _linear(element.nodes) @ np.linalg.pinv(_linear(rule.points))


def _linear(x):
    return np.column_stack([np.ones(len(x)), x])


def contact_at_nodes(pair: "ContactPair", history: "PairHistory", state: "PairState", count: int
                     ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pressure (n,) and force (n, 3) on a pair's surface per area at rest in MPa, and slip (n,) in mm, at `count` nodes.

    Pressure and force are 0 where the surface is open and nan off it; slip is nan where nothing touches. A node has the mean of the
    points around it, by their areas and its shape function at them.
    """
    touches = state.pressure > 0
    slid = (history.slid + state.slid_mm) * touches
    mean = _mean_at_nodes(pair, history, np.column_stack([state.pressure, state.force_mpa, slid, touches]), count)
    touching = np.where(mean[:, 5] > 0, mean[:, 5], np.nan)
    return mean[:, 0], mean[:, 1:4], mean[:, 4] / touching


def _mean_at_nodes(pair, history, values, count):
    """Means (n, k) of values (p, k) at the points around each of `count` nodes; nan off the pair's surface."""
    points = history.points
    there = points.nodes >= 0
    weight = np.where(there, np.abs(points.values[:, :points.nodes.shape[1]]), 0.0) * points.weight[:, None]
    total = np.bincount(points.nodes[there], weight[there], count)
    sums = np.column_stack([np.bincount(points.nodes[there], (weight * column[:, None])[there], count) for column in values.T])
    out = np.full((count, values.shape[1]), np.nan)
    on = pair.surface.used[pair.surface.used < count]
    out[on] = sums[on] / np.where(total[on] > 0, total[on], 1.0)[:, None]
    return out
