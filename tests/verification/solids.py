"""Bodies for the verification of the solid model: laws, graded and round meshes, rollers and balls of prescribed nodes."""

from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.fem.structured_meshes import box, square_to_disc
from softtact.materials.laws.registry import make_law
from softtact.models.solid.body import SolidBody


def elastic(young, poisson):
    """A law whose small-strain constants are E (MPa) and nu."""
    return make_law("neo_hooke", {"c10": young / (4 * (1 + poisson))}, bulk_modulus=young / (3 * (1 - 2 * poisson)))


def growing(first, count):
    """Shares from 0 to 1 of `count` elements that grow in a constant ratio from `first`."""
    ratio = brentq(lambda q: first * (q**count - 1) / (q - 1) - 1, 1 + 1e-6, 50)
    ends = np.concatenate([[0.0], np.cumsum(first * ratio ** np.arange(count))])
    return ends / ends[-1]


def roller(radius, half_width, elements, *, geometry="plane_strain", tip=0.0, from_axis=False):
    """A strip of one row of elements whose face y0 is the parabola of a roller (of a ball, axisymmetric) that stands on y = tip."""
    mesh = box((0.0 if from_axis else -half_width, 0.0), (half_width, 0.1 * half_width), (elements, 1), region="roller",
               geometry=geometry)
    return mesh.moved(lambda x: x + np.column_stack([0 * x[:, 0], tip + x[:, 0] ** 2 / (2 * radius), 0 * x[:, 0]]))


def pressed_by_roller(soft, law, roller_mesh, *, held, face="y1", stiffness, reach_mm, friction=0.0, segments=False):
    """A `SolidBody` of a soft mesh under a roller; the frame "roller" carries all of the roller, so that it is rigid."""
    mesh = soft.joined(roller_mesh, prefix="on ")
    body = SolidBody(mesh, {"body": law, "on roller": law}, held=held,
                     carried={"roller": ((0, 0, 0), ["on boundary"])})
    body.add(ContactPair(Surface.of(mesh.face(face)), Surface.of(mesh.face("on y0")), stiffness=stiffness, reach_mm=reach_mm,
                              friction=friction, segments=segments, rigid=True, axisymmetric=mesh.axisymmetric))
    return body


def places_of(body, state, pair=0):
    """Places (p, 3) in mm of a pair's points, and their pressures (p,) in MPa."""
    from softtact.contact.surface_places import places

    history = state.histories[pair]
    return places(history.points, body.points + state.displacement), state.contacts[pair].pressure


def merged(mesh, tolerance=1e-7):
    """The mesh with nodes at one place made one, and without named faces."""
    _, first, number = np.unique(np.round(mesh.points / tolerance), axis=0, return_index=True, return_inverse=True)
    number = number.ravel()
    return replace(mesh, points=mesh.points[first], faces={},
                   cells=tuple((region, kind, number[nodes]) for region, kind, nodes in mesh.cells))


def disc_in_cylinder(radius, far, disc_shares, *, depth_shares, ring_shares):
    """A cylinder of radius and depth `far` below z = 0 whose mesh follows the circle of a disc on its top; faces disc, z0, side.

    shares: ends of the elements across the disc, from it outwards and from the top down, rising from 0 to 1
    """
    across, outwards, downwards = (len(shares) - 1 for shares in (disc_shares, ring_shares, depth_shares))
    down = 1 - np.asarray(depth_shares)[::-1]
    mesh = box((-1, -1, -far), (1, 1, 0), (across, across, downwards), grading=(disc_shares, disc_shares, down)).moved(
        lambda x: np.column_stack([radius * square_to_disc(x[:, :2]), x[:, 2]]))
    for quarter in range(4):
        ring = box((0, -1, -far), (1, 1, 0), (outwards, across, downwards), grading=(ring_shares, disc_shares, down))

        def to_ring(x, quarter=quarter):
            angle, r = np.arcsin(x[:, 1] / np.sqrt(2)) + quarter * np.pi / 2, radius + (far - radius) * x[:, 0]
            return np.column_stack([r * np.cos(angle), r * np.sin(angle), x[:, 2]])

        mesh = mesh.joined(ring.moved(to_ring), prefix="")
    mesh = merged(mesh)
    return mesh.with_faces(disc=lambda x: (x[:, 2] > -1e-9) & (np.hypot(x[:, 0], x[:, 1]) < radius),
                           z0=lambda x: x[:, 2] < -far + 1e-9,
                           side=lambda x: (np.hypot(x[:, 0], x[:, 1]) > 0.6 * far) & (x[:, 2] < -1e-9) & (x[:, 2] > -far + 1e-9))
