"""A body whose own faces come to touch: a slot that closes."""

import numpy as np
import pytest

from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.fem.solid_mesh import SolidMesh
from softtact.fem.structured_meshes import box
from softtact.materials.laws.registry import make_law
from softtact.models.solid.body import SolidBody
from softtact.models.solid.path import SolidPath, last

RUBBER = make_law("mooney_rivlin", {"c10": 0.08, "c01": 0.03}, bulk_over_shear=20)


def slotted():
    """A block of 3 mm x 2.1 mm with a slot of 0.1 mm from its right side, in plane strain; the slot's faces by name."""
    heights = np.array([0.0, 0.5, 1.0, 1.1, 1.6, 2.1]) / 2.1
    block = box((0, 0), (3, 2.1), (6, 5), grading=(None, heights))
    ((region, kind, cells),) = block.cells
    middle = block.points[cells].mean(axis=1)
    solid = cells[~((middle[:, 0] > 1) & (abs(middle[:, 1] - 1.05) < 0.05))]
    mesh = SolidMesh(block.points, ((region, kind, solid),), geometry="plane_strain")
    return mesh.with_faces(
        bottom=lambda x: x[:, 1] < 1e-9,
        top=lambda x: x[:, 1] > 2.1 - 1e-9,
        lower=lambda x: (abs(x[:, 1] - 1.0) < 1e-9) & (x[:, 0] > 1),
        upper=lambda x: (abs(x[:, 1] - 1.1) < 1e-9) & (x[:, 0] > 1),
    )


def pressed(surface, other, *, segments):
    """The last load step of the block pressed down by 0.3 mm, with these faces in contact; none where `surface` is None."""
    mesh = slotted()
    body = SolidBody(mesh, {"body": RUBBER}, held={"bottom": "xy"}, carried={"top": ((0, 0, 0), ["top"])})
    if surface:
        own = Surface.of(mesh.face(surface))
        against = own if surface == other else Surface.of(mesh.face(other))
        body.add(ContactPair(own, against, stiffness=20.0, reach_mm=0.2, segments=segments))
    return body, last(SolidPath(body, {"top": Motion().step(ways={"y": -0.15}).step(ways={"y": -0.15})}).run())


def test_a_slot_that_closes_bears_the_same_as_two_faces_that_are_told_to_meet():
    _, apart = pressed("upper", "lower", segments=True)
    body, itself = pressed("boundary", "boundary", segments=False)
    _, through = pressed(None, None, segments=False)
    force, expected, none = (-step.loads[0, 1] for step in (itself, apart, through))
    assert expected > 1.2 * none, "the slot is closed"
    # Both sides' points press in turn here, and quadrature is not cut along the other side: half a percent.
    assert force == pytest.approx(expected, rel=0.005)
    assert itself.penetration_mm < 0.005


def test_a_body_that_does_not_touch_itself_is_left_alone():
    body = SolidBody(slotted(), {"body": RUBBER}, held={"bottom": "xy"}, carried={"top": ((0, 0, 0), ["top"])})
    surface = Surface.of(body.mesh.boundary)
    body.add(ContactPair(surface, surface, stiffness=20.0, reach_mm=0.2))
    (step,) = SolidPath(body, {"top": Motion().step(ways={"y": -0.01})}).run()
    assert step.state.contacts[0].pressure.max() == 0
