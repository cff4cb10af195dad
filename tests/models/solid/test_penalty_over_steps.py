"""The penalty of a contact stays what it is over many steps, however small the overlaps of the steps before were."""

import trimesh

from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.fem.structured_meshes import box
from softtact.materials.laws.registry import make_law
from softtact.models.solid.body import SolidBody
from softtact.models.solid.path import SolidPath


def test_the_penalty_of_a_plate_pressed_in_eight_steps_is_no_larger_than_in_one():
    mesh = box((-1, -1, 0), (1, 1, 1), (3, 3, 2))
    plate = trimesh.creation.box((4, 4, 1))
    plate.apply_translation([0, 0, 1.5])
    body = SolidBody(mesh, {"body": make_law("neo_hooke", {"c10": 0.1})}, held={"z0": "xyz"},
                     rigid={"plate": ((0, 0, 1), plate.triangles)})
    body.add_pair(ContactPair(Surface.of(mesh.face("z1")), Surface.of({"triangle": body.surface_nodes("plate")}), stiffness=20.0,
                              reach_mm=0.5, rigid=True))
    motion = Motion()
    for _ in range(8):
        motion = motion.step(ways={"z": -0.02})
    largest = [step.state.histories[0].stiffness for step in SolidPath(body, {"plate": motion}).run()]
    (once,) = SolidPath(body, {"plate": Motion().step(ways={"z": -0.16})}).run()
    assert max(largest) <= once.state.histories[0].stiffness
