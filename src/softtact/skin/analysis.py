"""From loads to counts: deformed mesh, capacitances on it, readings of the converter."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from softtact.errors import ExtrapolationWarning
from softtact.skin.converter import Converter
from softtact.skin.elasticity import ElasticLayer
from softtact.skin.elastomers import Elastomer
from softtact.skin.electrostatics import Field
from softtact.skin.layer_mesh import LayerMesh
from softtact.skin.layout import Layout
from softtact.skin.loads import Load
from softtact.skin.plan import even_plan, taxel_plan


@dataclass(frozen=True)
class Readings:
    """What a skin does under loads."""

    capacitance_ff: np.ndarray
    """(load, taxel): of the deformed skin."""
    at_rest_ff: np.ndarray
    """(taxel,)"""
    counts: np.ndarray
    """(load, taxel): whole counts above rest."""
    displacement_mm: np.ndarray
    """(load, node, 3): of the nodes on the upper side."""
    young_mpa: np.ndarray
    """(load,): the secant modulus that each load was solved with."""
    remarks: list[str]
    """Where a curve was extrapolated, or a strain is large."""

    @property
    def delta_ff(self) -> np.ndarray:
        """(load, taxel): above rest."""
        return self.capacitance_ff - self.at_rest_ff


class Skin:
    """A layer of elastomer on taxels: meshes and factors once, then any load.

    spacing_mm, layers: of the mesh for deformations;  field_spacing_mm, field_layers: of that for the field, which has one element
    across each guard gap; `softtact.skin.convergence` tells what that is worth.
    """

    def __init__(
        self,
        layout: Layout,
        *,
        thickness_mm: float,
        poisson: float,
        permittivity: float,
        spacing_mm: float = 1.0,
        layers: int = 4,
        field_spacing_mm: float = 1.2,
        field_layers: int = 3,
        threads: int = 1,
    ) -> None:
        self.layout, self.thickness_mm, self.permittivity, self.threads = layout, thickness_mm, permittivity, threads
        self.layer = ElasticLayer(
            LayerMesh(even_plan(layout, spacing_mm=spacing_mm), np.linspace(0.0, thickness_mm, layers + 1)),
            poisson=poisson,
            threads=threads,
        )
        self.field_mesh = LayerMesh(
            taxel_plan(layout, spacing_mm=field_spacing_mm), np.linspace(0.0, thickness_mm, field_layers + 1)
        )

    @cached_property
    def at_rest(self) -> Field:
        """The field without a load."""
        return self.field()

    @cached_property
    def at_rest_ff(self) -> np.ndarray:
        """Capacitances (taxel,) without a load."""
        return self.at_rest.capacitance_ff

    def field(self, displacement_mm: np.ndarray | None = None) -> Field:
        """The field after a displacement (node, 3) of the layer's nodes, or at rest."""
        moved = None if displacement_mm is None else self.to_field @ displacement_mm
        return Field(self.field_mesh, self.layout, permittivity=self.permittivity, displacement_mm=moved, threads=self.threads)

    @cached_property
    def to_field(self) -> sp.csr_matrix:
        """Values at the field's nodes from those at the layer's, as a sparse matrix."""
        return self.layer.mesh.interpolation(self.field_mesh.nodes_mm)

    @cached_property
    def influence(self) -> np.ndarray:
        """Rise of each capacitance in fF per N straight down on a node of the layer, for a modulus of 1 MPa: (node, taxel).

        To first order in the force: the adjoint of elasticity applied to the shape derivative of each capacitance, so that one
        solve for a taxel gives its answer to a force anywhere.
        """
        gradient = self.at_rest.gradient()
        nodal = np.stack([self.to_field.T @ gradient[:, axis] for axis in range(3)], axis=1)
        return -self.layer.respond(nodal)[:, 2]

    def first_order_ff(self, load: Load, *, young_mpa: float) -> np.ndarray:
        """Rise (taxel,) of the capacitances under a load to first order, by `influence`."""
        return load.force_n @ (self.layer.under(load.points_mm) @ self.influence) / young_mpa


def analyse(skin: Skin, loads: Sequence[Load], *, elastomer: Elastomer, converter: Converter) -> Readings:
    """`Readings` of loads one by one, each solved with the elastomer's secant modulus at its pressure."""
    rows, tops, moduli, remarks = [], [], [], []
    for load in loads:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", ExtrapolationWarning)
            young = elastomer.young_mpa(load.pressure_mpa)
        remarks += [str(warning.message) for warning in said]
        moved = load.displacement_mm
        if moved is None:
            moved = skin.layer.displacement(load, young_mpa=young)
        rows.append(skin.field(moved).capacitance_ff)
        tops.append(moved[skin.layer.mesh.top])
        moduli.append(young)
        squeezed = -moved[:, 2].min() / skin.thickness_mm
        if squeezed > _LARGE and load.displacement_mm is None:
            remarks.append(
                f"{load.words}: the elastomer gives way by {squeezed:.0%} of its thickness, where small strains are coarse; take "
                "the reading as a trend."
            )
    capacitance = np.array(rows)
    return Readings(
        capacitance,
        skin.at_rest_ff,
        converter.counts(np.vstack([skin.at_rest_ff, capacitance])),
        np.array(tops),
        np.array(moduli),
        list(dict.fromkeys(remarks)),
    )


_LARGE = 0.3  # of the thickness: the strain up to which the papers' elastomers were tested
