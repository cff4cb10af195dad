"""A rigid object pressed on the skin: area and forces of contact.

At small strains the layer has one modulus, and contact is without friction. At finite strains the solid model uses the law of a
foam fitted to the elastomer's curve. The papers assume a uniform pressure instead.
"""

import warnings

import numpy as np
import trimesh
from scipy.optimize import least_squares, nnls
from scipy.spatial.transform import Rotation

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.contact.unilateral import active_set
from softtact.errors import ExtrapolationWarning, InputError
from softtact.fem.solid_mesh import SolidMesh
from softtact.materials.laws.base import Law
from softtact.materials.laws.registry import make_law
from softtact.materials.linear import LinearConstants
from softtact.models.solid.body import SolidBody
from softtact.models.solid.path import SolidLoadStep, SolidPath
from softtact.progress import Watch, announce
from softtact.skin.analysis import BEYOND, Skin
from softtact.skin.elastomers import Elastomer
from softtact.skin.layer_mesh import LayerMesh
from softtact.skin.loads import Load

_DEPTHS = (0.15, 0.3, 0.6)  # of the thickness: candidates for contact lie at most so far below the object's lowest point
_GUESS_MPA = 0.1
_ITERATIONS, _TOLERANCE = 20, 1e-3  # of the secant modulus, which depends on the pressure
_OBJECT, _LAYER = "object", "elastomer"
_PENALTY = 20.0  # times E / h of the layer's facets
_POINTS = 26  # of the elastomer's curve
_MIRRORED = [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]  # order of a tetrahedron's nodes in its mirror image


def contact_load(skin: Skin, mesh: trimesh.Trimesh, centre_mm: tuple[float, float], *, force_n: float, elastomer: Elastomer,
                 turned_deg: tuple[float, float, float] = (0.0, 0.0, 0.0), name: str = "mesh") -> Load:
    """Frictionless contact at small strains: nodal forces on the upper side, without penetration and without tension.

    centre_mm: place of the middle of the mesh's bounding box, after rotations about fixed x, y, z in degrees; the object moves
    straight down
    The modulus is the secant one at the mean pressure on the nodes in contact, found by iteration.
    Raises InputError where no part of the mesh is above the elastomer, and where it would be pressed too deep.
    """
    placed = placed_over(mesh, centre_mm, turned_deg)
    top = skin.layer.mesh.top
    nodes = skin.layer.mesh.nodes_mm[top, :2]
    height = underside(placed, nodes, centre_mm, name)
    gap = height - height.min()
    for depth in _DEPTHS:
        near = np.flatnonzero(gap < depth * skin.thickness_mm)
        forces, pressure, indentation = _contact_forces(skin, top[near], gap[near], force_n, elastomer)
        if indentation < depth * skin.thickness_mm:
            touching = forces > 0
            words = f"{force_n:g} N by {name} at ({centre_mm[0]:g}, {centre_mm[1]:g}) mm, {1e3 * pressure:.3g} kPa in the mean"
            return Load(nodes[near[touching]], forces[touching], pressure, words, indentation_mm=indentation)
    raise InputError(f"load {name!r}: {force_n:g} N presses it deeper than {_DEPTHS[-1]:.0%} of the {skin.thickness_mm:g} mm of "
                     "elastomer, where small strains do not hold; choose a smaller force, or finite strains (in a design "
                     "`strains: finite`, of a press the model solid).")


def placed_over(mesh: trimesh.Trimesh, centre_mm: tuple[float, float], turned_deg: tuple[float, float, float]) -> trimesh.Trimesh:
    """A copy, rotated about fixed x, y, z in degrees, with the middle of its bounding box over a place in mm."""
    placed = mesh.copy()
    placed.vertices = Rotation.from_euler("xyz", turned_deg, degrees=True).apply(mesh.vertices)
    placed.apply_translation([*(np.array(centre_mm) - placed.bounds.mean(axis=0)[:2]), 0.0])
    return placed


def underside(placed: trimesh.Trimesh, points_mm: np.ndarray, centre_mm: tuple[float, float], name: str) -> np.ndarray:
    """Height (n,) in mm of the mesh's underside over points (n, 2), infinite beside it. InputError where it is beside all."""
    height, _ = HeightField(placed)(*points_mm.T)
    over = height < NO_CONTACT_MM
    if not over.any():
        raise InputError(f"load {name!r}: the mesh at ({centre_mm[0]:g}, {centre_mm[1]:g}) mm lies beside the elastomer; correct "
                         "at_mm.")
    return np.where(over, height, np.inf)


def _contact_forces(skin, nodes, gap, force_n, elastomer):
    """Forces (c,) on nodes under gaps (c,), mean pressure and indentation, with the modulus at that pressure."""
    compliance = skin.compliance(nodes)
    node_area = skin.layout.area_mm2 / len(skin.layer.mesh.top)
    young = elastomer.young_gentle_mpa or _GUESS_MPA
    for _ in range(_ITERATIONS):
        step = next(iter(active_set(compliance / young, gap, [force_n])))
        pressure = force_n / (node_area * np.count_nonzero(step.nodal_force))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ExtrapolationWarning)  # `analyse` warns of the modulus that is found
            before, young = young, elastomer.young_mpa(pressure)
        if abs(young / before - 1) < _TOLERANCE:
            break
    return step.nodal_force, pressure, step.indentation


def force_at_depth(skin: Skin, mesh: trimesh.Trimesh, depth_mm: float, *, elastomer: Elastomer) -> float:
    """The force (N) at which a placed mesh (mm) is pressed `depth_mm` below first touch, at small strains.

    The nodes in contact follow from the depth alone; the force is in proportion to the modulus, found as in `contact_load`.
    """
    height = underside(mesh, skin.layer.mesh.nodes_mm[skin.layer.mesh.top, :2], tuple(mesh.bounds.mean(axis=0)[:2]), "mesh")
    near = np.flatnonzero(height - height.min() < depth_mm)
    factor = np.linalg.cholesky(skin.compliance(skin.layer.mesh.top[near]))     # A f >= depth - gap, f >= 0, complementary
    forces, _ = nnls(factor.T, np.linalg.solve(factor, depth_mm - (height - height.min())[near]))
    area = skin.layout.area_mm2 / len(skin.layer.mesh.top) * np.count_nonzero(forces)
    young = elastomer.young_gentle_mpa or _GUESS_MPA
    for _ in range(_ITERATIONS):
        before, young = young, elastomer.tested_young_mpa(young * forces.sum() / area)
        if abs(young / before - 1) < _TOLERANCE:
            break
    return float(young * forces.sum())


def compression_law(elastomer: Elastomer) -> tuple[Law, float]:
    """The law `hyperfoam1` with the elastomer's Poisson's ratio, fitted to its curve (nominal stress) over the tested stresses.

    The second value is the largest deviation from the curve, as a share of the highest stress. The law's stretch window is that of
    the test, from its smallest stretch to 1, or to the lateral stretch there.
    """
    stress = np.linspace(*elastomer.tested_mpa, _POINTS)
    stretch = 1 - elastomer.fit(stress)

    def law_of(values):
        return make_law("hyperfoam1", {"mu1": float(np.exp(values[0])), "alpha1": float(values[1]), "nu1": elastomer.poisson})

    def misfit(values):
        return (-law_of(values).nominal_stress("uniaxial", stretch) - stress) / stress[-1]

    shear = stress[-1] / (1 - stretch[-1]) / (2 * (1 + elastomer.poisson))
    found = least_squares(misfit, [np.log(shear), 2.0], bounds=([-20, -25], [3, 25]))
    law = law_of(found.x)
    lateral = float(law.lateral_stretch("uniaxial", stretch[-1]))
    law.stretch_window = (float(stretch[-1]), max(lateral, 1.0))
    return law, float(np.abs(found.fun).max())


def solid_layer(mesh: LayerMesh) -> SolidMesh:
    """The layer as a `SolidMesh` of the same nodes, with the faces `floor` and `top`."""
    cells = np.ascontiguousarray(mesh.basis.element_dofs.T, dtype=np.int64)
    a, b, c, d = np.moveaxis(mesh.nodes_mm[cells[:, :4]], 1, 0)
    mirrored = np.einsum("ei,ei->e", np.cross(b - a, c - a), d - a) < 0
    cells[mirrored] = cells[mirrored][:, _MIRRORED]
    height = mesh.levels_mm[-1]
    return SolidMesh(mesh.nodes_mm, ((_LAYER, "tetra10", cells),)).with_faces(
        floor=lambda x: x[:, 2] < 1e-9, top=lambda x: x[:, 2] > height - 1e-9
    )


def press_at_finite_strains(skin: Skin, mesh: trimesh.Trimesh, centre_mm: tuple[float, float], *, force_n: float,
                            elastomer: Elastomer, turned_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
                            friction: float = 0.0, name: str = "mesh") -> Load:
    """The load of an object that moves straight down, with the displacement of the layer's nodes; floor bonded, sides free.

    centre_mm, turned_deg: as in `contact_load`;  friction: Coulomb's coefficient of object and elastomer
    Raises InputError where no part of the mesh is above the elastomer, ConvergenceError where the force is not reached.
    """
    placed = placed_over(mesh, centre_mm, turned_deg)
    layer = solid_layer(skin.layer.mesh)
    top = layer.points[layer.face_nodes("top")]
    lowest = underside(placed, top[:, :2], centre_mm, name).min()
    placed.apply_translation([0.0, 0.0, float(top[0, 2] - lowest)])
    law, deviation = compression_law(elastomer)
    body = SolidBody(layer, {_LAYER: law}, held={"floor": "xyz"}, threads=skin.threads,
                     rigid={_OBJECT: (placed.bounds.mean(axis=0), np.asarray(placed.triangles))})  # fmt: skip
    face = Surface.of(layer.face("top"))
    size = face.size_mm(body.points)
    young = LinearConstants.of_law(law).young_mpa
    body.add(
        ContactPair(face, Surface.of({"triangle": body.surface_nodes(_OBJECT)}), stiffness=_PENALTY * young / size,
                    reach_mm=2 * size, friction=friction, rigid=True)
    )  # fmt: skip
    body.watch = Watch(name)
    try:
        (step,) = SolidPath(body, {_OBJECT: Motion().press(force_n=force_n)}, tell=lambda text: announce(f"{name}: {text}")).run()
    finally:
        body.watch.end()
    at = f"({centre_mm[0]:g}, {centre_mm[1]:g}) mm"
    words = f"{force_n:g} N by {name} at {at}, finite strains by a law off the curve by {deviation:.0%}"
    return _load_of(body, step, force_n, len(layer.points), words)


def _load_of(body: SolidBody, step: SolidLoadStep, force_n: float, nodes: int, words: str) -> Load:
    """The `Load` of an equilibrium: forces at the points in contact; its words name strain beyond the elastomer's test."""
    points, pressure = step.state.histories[0].points, step.state.contacts[0].pressure
    touching = pressure > 0
    forces = (points.weight * pressure)[touching]
    area = float(points.weight[touching].sum())
    at = np.einsum("pk,pki->pi", points.values, body.points[points.nodes])[touching, :2]
    beyond = step.extrapolated_volume_fraction
    words += f", {1e3 * force_n / area:.3g} kPa in the mean"
    if beyond > BEYOND:
        words += f", {beyond:.0%} of the volume strained beyond the tests"
    return Load(at, forces * (force_n / forces.sum()), force_n / area, words, step.state.displacement[:nodes],
                indentation_mm=-float(step.state.poses[0].translation[2]), beyond_tests=beyond)
