"""The layered sensor as one body: slab (sheet and cover) tied to the bed of frusta, and one Newton step of it."""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from softtact.contact.friction import coulomb
from softtact.contact.height_field import HeightField
from softtact.contact.penalty import Contact
from softtact.mechanics.body_friction import BodyFriction
from softtact.mechanics.contact_step import ContactStepper
from softtact.mechanics.frustum_bed import BedGeometry, BedState, FrustumBed
from softtact.mechanics.hex_mesh import sheet_plan
from softtact.mechanics.linear_solvers import make_solver
from softtact.mechanics.parallel import Workers
from softtact.mechanics.refinement import FAR, NEAR, levels_of, zones
from softtact.mechanics.sheet_cells import SheetCells
from softtact.mechanics.slab import Layer, Slab, SlabState, StepContact
from softtact.mechanics.top_contact import FacingPlanes

_OBJECT_SMOOTHING_MM = 1e-3


@dataclass(frozen=True)
class MeshSettings:
    """Resolution of the layered body.

    cover_levels: heights of the cover's element layers as shares of its thickness; cover_splits: how often the elements of
    each layer, a pitch wide, are split in plan: the lowest under the object, the others at its edges (see `refinement`);
    far_pitches: pitches (1, 2, 4) that an element far from the object spans; contact_stiffness: N/mm3 of the contacts' penalty,
    a third of it takes a quarter fewer iterations and leaves three times the overlap; sheet_layers: elements through the sheet;
    frustum_levels: heights of the frustum's element layers as shares of its height; local_over_shear, growing_over_shear:
    what holds volume changes in the frusta that their elements' pressure does not see, over mu (see `blocks`);
    trilinear_pressure: or linear, which is softer by 2 % for small movements, and fails under deep objects.
    refinement: how often all elements are split in plan. frustum_rings: rings of elements around a frustum's core, the
    thinner the farther out. coarse_walls: along all walls between cells, not only far from the object, the sheet moves as one
    quadratic curve: half a factor's operations, and 2 to 2.5 % of the map; without effect where refined.
    """

    sheet_layers: int = 1
    frustum_levels: tuple = (0.0, 0.2, 0.6, 1.0)
    local_over_shear: float = 0.5
    growing_over_shear: float = 100.0
    trilinear_pressure: bool = True
    refinement: int = 0
    frustum_rings: int = 1
    coarse_walls: bool = False
    cover_levels: tuple = (0.0, 0.45, 0.8, 1.0)
    cover_splits: tuple = (1, 1, 2)
    far_pitches: int = 2
    contact_stiffness: float = 3000.0

    def __post_init__(self):
        if len(self.cover_splits) != len(self.cover_levels) - 1:
            raise ValueError(f"cover_splits has {len(self.cover_splits)} entries for the {len(self.cover_levels) - 1} layers "
                             "of cover_levels")

    @property
    def contact(self):
        """The frusta's penalty, linear above half of a pressure of 1 MPa."""
        return Contact(stiffness=self.contact_stiffness, smoothing=1.0 / self.contact_stiffness)

    @property
    def object_contact(self):
        """The object's penalty: softer where it is lightly pressed, a third fewer factors under a wide punch and 0.3 um deeper."""
        return Contact(stiffness=self.contact_stiffness, smoothing=_OBJECT_SMOOTHING_MM)

    @classmethod
    def draft(cls):
        """For quick studies: a layer less in the cover and in each frustum, and walls as one curve."""
        return cls(frustum_levels=(0.0, 0.35, 1.0), local_over_shear=4.0, coarse_walls=True, cover_levels=(0.0, 0.55, 1.0),
                   cover_splits=(0, 2), contact_stiffness=1000.0)

    @classmethod
    def converging(cls, *, local_over_shear=0.1, **changes):
        """To be refined: linear pressure, which does not lock, and little else; single frusta and cells, but no whole sensor."""
        return cls(local_over_shear=local_over_shear, growing_over_shear=0.0, trilinear_pressure=False, **changes)

    @classmethod
    def stable(cls):
        """For frusta pressed to more than 60 % of their height, where on the default mesh elements give way and many steps fail.

        A sphere to 50 N; unit cell 1 to 2 % stiffer up to 0.4 MPa, alike from 0.7 MPa on (docs/performance.md).
        """
        return cls(local_over_shear=4.0)


@dataclass(frozen=True)
class BodyState:
    """Slab and bed at one displacement, and the potential energy (mJ) of both with their contacts and friction."""

    slab: SlabState
    bed: BedState
    indentation: float

    @property
    def energy(self):
        return self.slab.energy + self.bed.energy

    @property
    def force(self):
        """Force (N) that the object exerts downwards."""
        return self.slab.indentation_force


@dataclass(frozen=True)
class Step:
    """A Newton step: slab (n, 3), frusta (f, nodes, 3) in mm, indentation in mm, and what the object's contact faces in it."""

    slab: np.ndarray
    bed: np.ndarray
    indentation: float
    planes: FacingPlanes

    def largest(self):
        return max(np.abs(self.slab).max(), np.abs(self.bed).max(), abs(self.indentation))


_DAMPINGS = 4         # steps that are tried with ever more damping of the cells that they throw too far
_FIRST_SHIFT = 0.01   # N/mm on every free unknown of the slab, doubled until the tangent is positive definite


def _shifts():
    """What is tried, one after the other, until a tangent is positive definite, so that every step lowers the energy."""
    yield None
    yield 0.0
    for doubling in itertools.count():
        yield _FIRST_SHIFT * 2**doubling


class LayeredBody:
    """Slab on frusta on a rigid PCB, pressed from above by a rigid object. Lengths in mm, z = 0 at the top at rest."""

    def __init__(self, slab, bed, roots, *, threads=1):
        """`roots` (f, k): the slab's nodes that are the frusta's root nodes."""
        self.slab, self.bed = slab, bed
        self.workers = Workers(threads)
        self.friction = BodyFriction(slab.top, bed)
        self.cells = SheetCells(slab, bed, roots)
        slab.build_pattern(self.cells.eliminated, self.cells.outer_dofs)
        self.solver = make_solver(threads=threads, rough=True)
        self.stepper = ContactStepper(self.solver)

    def close(self):
        """Free the factors, and end the threads."""
        self.solver.close()
        self.workers.close()

    def rest(self):
        """Displacements of slab (n, 3) and frusta (f, nodes, 3) at rest."""
        return np.zeros((self.slab.nodes, 3)), np.zeros((self.bed.count, self.bed.nodes, 3))

    def evaluate(self, slab_displacement, bed_displacement, indentation, planes):
        """State at given displacements; None where an element is inside out."""
        slab = self.slab.evaluate(slab_displacement, planes, indentation, workers=self.workers)
        bed = self.bed.evaluate(bed_displacement, workers=self.workers) if slab is not None else None
        return None if bed is None else BodyState(slab=slab, bed=bed, indentation=indentation)

    def reface(self, state, planes):
        """The same state with the object's contact on other planes."""
        return replace(state, slab=self.slab.reface(state.slab, planes, state.indentation))

    def let_down(self, state, force_n):
        """The state with the object at the depth where its force is `force_n`: the least energy over the indentation."""
        return self.lowered(state, self.slab.top.balanced(state.slab, state.indentation, force_n) - state.indentation)

    def lowered(self, state, by_mm):
        """The state with the object lower by so much."""
        depth = state.indentation + by_mm
        return replace(state, slab=self.slab.reface(state.slab, state.slab.planes, depth), indentation=depth)

    def newton_step(self, state, force_n, surface=None, *, largest_mm=np.inf):
        """The Newton step under a given force (N), or with the indentation kept where `force_n` is None.

        largest_mm: by which the object goes down at most

        With a surface the step's contact is with the facets that the points face where it leads, else with those of the state.
        Where nothing touches, a force finds no stiffness: the step is then not finite.
        """
        state = self.friction.for_tangent(state)
        for _ in range(_DAMPINGS):
            step = self._newton_step(state, force_n, surface, largest_mm)
            if not (np.isfinite(step.largest()) and self.cells.damp(step.slab, step.bed)):
                break
        return step

    def _newton_step(self, state, force_n, surface, largest_mm):
        """The step with the cells as they are damped now."""
        self.cells.refresh(state, workers=self.workers)
        residual, kept = self.cells.condensed_residual(state)
        contact = StepContact(self.slab, state.slab, state.indentation, surface)
        step, lowering = self._step_of_unknowns(state, residual.ravel()[self.slab.unknowns], contact, force_n,
                                                 largest_mm)
        full = np.zeros(3 * self.slab.nodes)
        full[self.slab.unknowns] = step
        slab, bed = self.cells.recover(kept, full.reshape(-1, 3))
        return Step(slab=slab, bed=bed, indentation=lowering, planes=contact.planes)

    def _step_of_unknowns(self, state, residual, contact, force_n, largest_mm):
        """Step of the global unknowns, and how far the object goes down; the tangent is made positive definite where it is not."""
        excess, drag = None if force_n is None else state.force - force_n, self.slab.friction_border(state.slab)
        for shift in _shifts():
            step = self.stepper.step(self._rubber_tangent(state, shift), residual, contact, drag=drag, excess=excess,
                                     largest=largest_mm)
            if step is not None:
                return step

    def _rubber_tangent(self, state, shift):
        """The rubber's tangent as it is (None), or without the cells' modes of negative stiffness and stiffened by a shift."""
        if shift is None:
            return self.slab.rubber_tangent(state.slab, self.cells.outer, workers=self.workers)
        rubber = self.slab.rubber_tangent(state.slab, self.cells.positive_outer(), workers=self.workers)
        self.slab.add_to_diagonal(rubber, shift)
        return rubber

    def penetration(self, state):
        """Deepest penetration in mm, of the object into the cover or of frusta into the board or each other."""
        return float(max(0.0, -self.slab.top.own_gaps(state.slab).min(), -state.bed.gaps.min()))

    def contact_error(self, state):
        """Deepest overlap, or widest gap under pressure, in mm."""
        return max(self.slab.top.contact.error(self.slab.top.own_gaps(state.slab)), self.bed.contact.error(state.bed.gaps))

    def press_apart(self, state, *, allowed_mm):
        """Hold the points that overlap where their surfaces just touch, on the object or in the bed, wherever it is too much."""
        if self.slab.top.contact.error(self.slab.top.own_gaps(state.slab)) > allowed_mm:
            self.slab.top.contact = self.slab.top.contact.pressed_apart(state.slab.gaps)
        if self.bed.contact.error(state.bed.gaps) > allowed_mm:
            self.bed.contact = self.bed.contact.pressed_apart(state.bed.gaps)

    def most_compressed(self, state):
        """Place x, y (mm) of the most compressed frustum, and its compression as a share of its height."""
        share = self.bed.compression(state.bed.displacement) / self.bed.geometry.heights
        worst = int(np.argmax(share))
        return *self.bed.geometry.centres[worst], float(share[worst])

    def share_outside_window(self, state):
        """Share of a law's volume that is strained beyond what the law was fitted to, the largest over the laws.

        nan where no law knows what it was fitted to.
        """
        volumes = {}
        for nodes, block in self.slab.solids:
            _add_volumes(volumes, block, state.slab.displacement[nodes])
        _add_volumes(volumes, self.bed.block, self.bed.per_element(state.bed.displacement))
        return max((outside / whole for outside, whole in volumes.values()), default=np.nan)

    def residual_norm(self, state, force_n):
        """Largest unbalanced nodal force in N, over slab, frusta and the object."""
        parts = [np.abs(self.slab_force(state).ravel()[self.slab.free]).max(), np.abs(self.bed.inner_residual(state.bed)).max()]
        if force_n is not None:
            parts.append(abs(state.force - force_n))
        return float(max(parts))

    def slab_force(self, state):
        """Forces (n, 3) on the slab's nodes, those of the frusta's roots among them."""
        total = state.slab.force.copy()
        np.add.at(total, self.cells.roots.ravel(), state.bed.force[:, self.bed.root].reshape(-1, 3))
        return total


def _add_volumes(volumes, block, displacement):
    """Add a block's volume outside its law's window, and its whole volume, to those of the same law."""
    if block.law.stretch_window is not None:
        outside, whole = volumes.get(id(block.law), (0.0, 0.0))
        volumes[id(block.law)] = outside + block.volume_outside(displacement, block.law.stretch_window), whole + block.volume


def _lines(side, count, pitch, pitches):
    """Grid lines: the frusta's lattice, one for `pitches` of them, and a strip to each edge where one is left."""
    half = 0.5 * count * pitch
    inner = pitch * np.append(np.arange(0, count, pitches), count) - half
    margin = 0.5 * side - half
    return np.concatenate([[-0.5 * side], inner, [0.5 * side]]) if margin > 1e-6 else inner


def lattice(counts, pitch):
    """Centres (n, 2) of a frustum lattice around the origin and who has a neighbour in +x, +y, -x, -y (n, 4)."""
    nx, ny = counts
    i, j = (grid.ravel() for grid in np.meshgrid(np.arange(nx), np.arange(ny)))
    centres = pitch * np.column_stack([i - 0.5 * (nx - 1), j - 0.5 * (ny - 1)])
    return centres, np.column_stack([i < nx - 1, j < ny - 1, i > 0, j > 0])


def build_sensor_body(spec, *, dielectric_law, cover_law, mesh=MeshSettings(), scatter=None, contact=None, threads=1, surface=None):
    """The whole sensor. `scatter`: None or (heights factor (n,), tip diameter factor (n,)) of its frusta.

    surface: the underside of the object that is to be pressed, where the cover's mesh is to be fine; without it a pitch everywhere
    """
    frusta, counts = spec.dielectric.frusta, spec.frusta_counts
    bottom = -(spec.cover.thickness_mm + spec.dielectric.sheet_thickness_mm)
    x_lines, y_lines = (_lines(side, count, frusta.pitch_mm, mesh.far_pitches)
                        for side, count in zip(spec.footprint_mm, counts, strict=True))
    sheet = Layer(np.linspace(bottom, -spec.cover.thickness_mm, mesh.sheet_layers + 1), dielectric_law)
    cover = Layer(spec.cover.thickness_mm * (np.asarray(mesh.cover_levels) - 1), cover_law)
    splits, zone = _cover_splits(mesh, surface, x_lines, y_lines, frusta.pitch_mm)
    centres, neighbours = lattice(counts, frusta.pitch_mm)
    plan = sheet_plan(centres, counts, frusta.pitch_mm, frusta.root_diameter_mm, spec.footprint_mm, refinement=mesh.refinement,
                      rings=mesh.frustum_rings)
    slab = Slab(sheet, cover, plan, x_lines, y_lines, sides="held", contact=contact or mesh.object_contact,
                coarse_walls=mesh.coarse_walls or _far(zone, x_lines, y_lines), splits=splits,
                friction=coulomb(spec.friction.object))
    return LayeredBody(slab, _bed(spec, centres, neighbours, dielectric_law, mesh, scatter, contact), slab.bottom[plan.roots],
                       threads=threads)


def _cover_splits(mesh, surface, x_lines, y_lines, pitch):
    """How often the cover's elements are split, layer by layer from below (layers, ny 2^m, nx 2^m), and its zones.

    The sheet follows the cover's lower side, which must not be finer than the sheet: it would hang freely between its nodes.
    """
    far = int(np.log2(mesh.far_pitches)) + mesh.refinement
    most = far + max(mesh.cover_splits)
    shape = (len(x_lines) - 1, len(y_lines) - 1)
    zone = np.full((shape[1] << most, shape[0] << most), NEAR) if surface is None else zones(surface, x_lines, y_lines, most)
    narrow = [np.round(np.log2(mesh.far_pitches * pitch / np.diff(lines))).astype(int).clip(0) for lines in (x_lines, y_lines)]
    narrow = np.maximum(*np.meshgrid(*narrow)).repeat(1 << most, axis=0).repeat(1 << most, axis=1)
    levels = []
    for k, splits in enumerate(mesh.cover_splits):
        of_zone = far + np.array([mesh.refinement - far, 0, splits if k == 0 else 0, min(splits, 1), splits])
        levels.append(levels_of(np.maximum(of_zone[zone] - narrow, 0), shape, most))
    return np.stack(levels), zone


def _far(zone, x_lines, y_lines):
    """A function of places (n, 2) that tells (n,) which lie among FAR places of the grid only."""
    x, y = (np.interp(np.arange(size + 1), np.linspace(0, size, len(lines)), lines)
            for size, lines in zip(zone.shape[::-1], (x_lines, y_lines), strict=True))

    def far(places):
        around = np.zeros(len(places), dtype=int)
        for dx, dy in itertools.product((-1e-6, 1e-6), repeat=2):
            i, j = (np.clip(np.searchsorted(lines, value) - 1, 0, len(lines) - 2)
                    for lines, value in ((x, places[:, 0] + dx), (y, places[:, 1] + dy)))
            around = np.maximum(around, zone[j, i])
        return around == FAR

    return far


def build_unit_cell(spec, *, dielectric_law, cover_law=None, mesh=MeshSettings(), height_factor=1.0, tip_factor=1.0):
    """One frustum of an endless lattice with its share of the sheet, and of the cover where a law for it is given."""
    frusta = spec.dielectric.frusta
    lines = 0.5 * frusta.pitch_mm * np.linspace(-1, 1, 2**mesh.refinement + 1)
    splits = np.minimum(mesh.cover_splits, 1)[:, None, None] * np.ones((2 * len(lines) - 2,) * 2, dtype=int) if cover_law else None
    cover_mm = 0.0 if cover_law is None else spec.cover.thickness_mm
    bottom = -(cover_mm + spec.dielectric.sheet_thickness_mm)
    sheet = Layer(np.linspace(bottom, -cover_mm, mesh.sheet_layers + 1), dielectric_law)
    cover = Layer(cover_mm * (np.asarray(mesh.cover_levels) - 1) if cover_mm else np.zeros(1), cover_law)
    centre = np.zeros((1, 2))
    plan = sheet_plan(centre, (1, 1), frusta.pitch_mm, frusta.root_diameter_mm, (frusta.pitch_mm,) * 2, refinement=mesh.refinement,
                      rings=mesh.frustum_rings)
    slab = Slab(sheet, cover, plan, lines, lines, sides="symmetric", contact=mesh.contact, coarse_walls=mesh.coarse_walls,
                splits=splits, friction=coulomb(spec.friction.object))
    bed = _bed(spec, centre, np.ones((1, 4), dtype=bool), dielectric_law, mesh,
               (np.array([height_factor]), np.array([tip_factor])), None, bottom=bottom)
    return LayeredBody(slab, bed, slab.bottom[plan.roots])


def build_patch(spec, counts, *, dielectric_law, mesh=MeshSettings()):
    """A piece of the dielectric alone, `counts` frusta along x and y with free borders half a pitch from the outer ones' axes."""
    frusta, thickness = spec.dielectric.frusta, spec.dielectric.sheet_thickness_mm
    centres, neighbours = lattice(counts, frusta.pitch_mm)
    lines = [frusta.pitch_mm * (np.arange(count + 1) - 0.5 * count) for count in counts]
    plan = sheet_plan(centres, counts, frusta.pitch_mm, frusta.root_diameter_mm, [np.ptp(line) for line in lines],
                      rings=mesh.frustum_rings)
    slab = Slab(Layer(np.linspace(-thickness, 0.0, mesh.sheet_layers + 1), dielectric_law), Layer(np.zeros(1), None), plan, *lines,
                sides="free", contact=mesh.contact, coarse_walls=mesh.coarse_walls)
    bed = _bed(spec, centres, neighbours, dielectric_law, mesh, None, None, bottom=-thickness)
    return LayeredBody(slab, bed, slab.bottom[plan.roots])


def _bed(spec, centres, neighbours, law, mesh, scatter, contact, *, bottom=None):
    frusta = spec.dielectric.frusta
    if bottom is None:
        bottom = -(spec.cover.thickness_mm + spec.dielectric.sheet_thickness_mm)
    height_factor, tip_factor = scatter or (np.ones(len(centres)), np.ones(len(centres)))
    heights = frusta.height_mm * height_factor
    # Every cone is built with the same root; where its printed readings are swapped the tip is the wide end.
    geometry = BedGeometry(centres=centres, heights=heights, tip_diameters=frusta.tip_diameter_mm * tip_factor,
                           root_diameter=frusta.root_diameter_mm, neighbours=neighbours,
                           wall_mm=0.5 * (frusta.pitch_mm - frusta.root_diameter_mm))
    return FrustumBed(geometry, law, levels=np.asarray(mesh.frustum_levels) * frusta.height_mm, root_z_mm=bottom,
                      pcb_z_mm=bottom - heights.max(), tips_held=spec.tips_held, contact=contact or mesh.contact,
                      local_over_shear=mesh.local_over_shear, growing_over_shear=mesh.growing_over_shear,
                      trilinear=mesh.trilinear_pressure, refinement=mesh.refinement, rings=mesh.frustum_rings,
                      friction=coulomb(spec.friction.board))


def surface_of(mesh):
    """The object's underside as the body asks for it."""
    return HeightField(mesh)
