"""A deck read back holds what was meant: nodes, elements, laws, constraints, surfaces, contacts and steps."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from support.laws import NEOPRENE, POLYURETHANE
from support.read_deck import read_deck
from support.sensors import CORO

from softtact.contact.penalty import penalty
from softtact.decks.keywords import law_card
from softtact.decks.model import deck_model
from softtact.decks.sensor import deck_text, export_press, write_deck
from softtact.errors import InputError
from softtact.fem.elements import HEX20
from softtact.geometry.meshes import place
from softtact.models.hyperelastic.build import build_unit_cell
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.press.sensor import Sensor
from softtact.sensors.frusta import Friction

SMALL = CORO.model_copy(update={"footprint_mm": (2.4, 3.6), "map_shape": (7, 5)})   # 2 x 3 frusta
SENSOR = Sensor(SMALL, {"dielectric": POLYURETHANE, "cover": NEOPRENE},
                mesh=MeshSettings(cover_heights=(0.0, 1.0), cover_splits=(0,), far_pitches=1))
SPHERE = trimesh.creation.icosphere(subdivisions=2, radius=2.0)
# Corner nodes of faces, and ends of the edges that the further nodes halve: Abaqus Elements Guide, "Three-dimensional solid element
# library"; ccx has the same.
ABAQUS_FACES = {1: {1, 2, 3, 4}, 2: {5, 8, 7, 6}, 3: {1, 5, 6, 2}, 4: {2, 6, 7, 3}, 5: {3, 7, 8, 4}, 6: {4, 8, 5, 1}}
WEDGE_FACES = {1: {1, 2, 3}, 2: {4, 5, 6}}
BRICK_EDGES = [(1, 2), (2, 3), (3, 4), (4, 1), (5, 6), (6, 7), (7, 8), (8, 5), (1, 5), (2, 6), (3, 7), (4, 8)]
WEDGE_EDGES = [(1, 2), (2, 3), (3, 1), (4, 5), (5, 6), (6, 4), (1, 4), (2, 5), (3, 6)]


one_dialect = pytest.mark.parametrize("dialect", ["calculix"], indirect=True)     # for what does not depend on it


@pytest.fixture(scope="module", params=["calculix", "abaqus"])
def dialect(request):
    return request.param


@pytest.fixture(scope="module")
def pair(dialect, tmp_path_factory):
    """The model meant, and the deck read back."""
    path = tmp_path_factory.mktemp("decks") / "press.inp"
    model = export_press(SENSOR, SPHERE, force_n=[1.0, 2.5], dialect=dialect, path=path, name="sphere")
    return model, read_deck(path)


@one_dialect
def test_the_heading_states_the_units(pair):
    assert pair[1].title == "sphere on sensor coro; units: mm, N, MPa"


def test_nodes_and_elements_come_back(pair, dialect):
    model, deck = pair
    rubber = np.array([deck.nodes[n + 1] for n in range(len(model.points))])
    assert rubber == pytest.approx(model.points, abs=1e-11)       # 12 digits are written
    kinds = {"calculix": ("C3D20R", "C3D20R", "C3D15"), "abaqus": ("C3D20RH", "C3D20H", "C3D15H")}[dialect]
    for part in model.parts:
        expected = {kinds[part.name == "FRUSTA"]: (part.hex_elements, part.hexes)}
        if part.name == "SHEET":
            expected[kinds[2]] = (part.wedge_elements, part.wedges)
        assert list(deck.elements[part.name]) == list(expected)
        for kind, (numbers, nodes) in expected.items():
            elements = deck.elements[part.name][kind]
            assert list(elements) == (numbers + 1).tolist()
            assert list(elements.values()) == (nodes + 1).tolist()
        assert deck.node_sets[part.name] == (part.nodes + 1).tolist()


@one_dialect
def test_nodes_beyond_the_corners_halve_the_edges_that_abaqus_says(pair):
    """An arc of a quarter circle is 0.21 of its chord away from it; a node of another edge would be half an edge away."""
    model, _ = pair
    for part in model.parts:
        for elements, edges in ((part.hexes, BRICK_EDGES), (part.wedges, WEDGE_EDGES)):
            corners = model.points[elements]
            for middle, (a, b) in enumerate(edges, start=elements.shape[1] - len(edges)):
                length = np.linalg.norm(corners[:, b - 1] - corners[:, a - 1], axis=1)
                off = np.linalg.norm(corners[:, middle] - 0.5 * (corners[:, a - 1] + corners[:, b - 1]), axis=1)
                assert (off < 0.22 * length).all()


@one_dialect
def test_sheet_and_frusta_share_the_roots_and_no_node_is_idle(pair):
    model, _ = pair
    sheet, cover, frusta = (set(part.nodes.tolist()) for part in model.parts)
    assert len(sheet & frusta) == 6 * 20 - 7        # a root of five quads; the seven pairs of neighbours touch in one node
    assert len(sheet & cover) > 0
    assert sheet | cover | frusta == set(range(len(model.points)))


def test_laws_come_back(pair, dialect):
    model, deck = pair
    for part in model.parts:
        form, constants = deck.materials[deck.sections[part.name]]
        card = law_card(part.law, no_term=0.0, dialect=dialect)
        assert form == card.form and constants == pytest.approx(card.constants, rel=1e-11)
    assert [part.law for part in model.parts] == [POLYURETHANE, NEOPRENE, POLYURETHANE]


def test_constraints_come_back_and_carry_a_quadratic_field(pair):
    """The sheet's top follows 8-node faces, quarters of walls follow parabolas: both hold a quadratic field in the plane."""
    model, deck = pair
    ours = [eq for eq in deck.equations if eq[0][2] == -1 and len(eq) > 2]
    assert len(ours) == 3 * len(model.ties) > 0
    x, y = model.points[:, :2].T
    field = 1 + 2 * x - y + 3 * x**2 - 2 * x * y + 0.5 * y**2
    for k, tie in enumerate(model.ties):
        for component in (1, 2, 3):
            slave, *masters = ours[3 * k + component - 1]
            assert slave == (tie.slave + 1, component, -1.0)
            assert [m[:2] for m in masters] == [(n + 1, component) for n in tie.masters]
            assert [m[2] for m in masters] == pytest.approx(tie.weights, rel=1e-11)
        assert model.points[tie.masters, 2] == pytest.approx(model.points[tie.slave, 2])
        assert tie.weights @ field[tie.masters] == pytest.approx(field[tie.slave], abs=1e-9)


@one_dialect
def test_a_hanging_node_is_no_master_and_is_not_fixed(pair):
    """Both programs eliminate it, and refuse chains and further conditions on it."""
    model, deck = pair
    slaves = {tie.slave + 1 for tie in model.ties}
    assert slaves == set(deck.node_sets["TIED"]) and len(slaves) == len(model.ties)
    assert not slaves & {master + 1 for tie in model.ties for master in tie.masters.tolist()}
    assert not slaves & set(deck.node_sets["HELD"])
    assert {node + 1 for node in model.held[:, 0].tolist()} == set(deck.node_sets["HELD"])


def test_steps_and_supports_come_back(pair):
    model, deck = pair
    assert [step.name for step in deck.steps] == ["TOUCH", "FORCE_1", "FORCE_2"]
    touch, *pushed = deck.steps
    driven = [row for row in touch.boundary if row[3] != 0]
    (reference, first, last, depth), = driven
    assert (first, last, depth) == (3, 3, pytest.approx(-model.steps[0].value))
    assert [step.loads for step in pushed] == [[(reference, 3, -1.0)], [(reference, 3, -2.5)]]
    held = {(node + 1, component + 1) for node, component in model.held.tolist()}
    for step in deck.steps:
        rows = {(int(node), first) for node, first, last, _ in step.boundary if node.isdigit() and first == last}
        assert held <= rows
    for step in pushed:
        assert not any(node == reference and first <= 3 <= last for node, first, last, _ in step.boundary)


def test_surfaces_name_the_faces_that_touch(pair):
    model, deck = pair
    for name, faces in model.surfaces.items():
        assert deck.surfaces[name] == [(str(element + 1), f"S{face}") for element, face in faces]

    def corners(name):
        return np.vstack(face_corners(model, name))

    assert corners("TOP")[:, 2] == pytest.approx(0.0, abs=1e-12)
    assert corners("FRUSTA_TIPS")[:, 2] == pytest.approx(-2.5)
    centres = SENSOR.body().support.geometry.centres
    sides = corners("FRUSTA_SIDES")
    assert np.linalg.norm(sides[:, None, :2] - centres, axis=2).min(axis=1) == pytest.approx(cone_radius(sides), rel=1e-6)
    even, odd = ({tuple(face) for face in model.surfaces[f"FRUSTA_SIDES_{half}"].tolist()} for half in ("EVEN", "ODD"))
    assert not even & odd and even | odd == {tuple(face) for face in model.surfaces["FRUSTA_SIDES"].tolist()}


def face_corners(model, name):
    """Corners (3 or 4, 3) of each face of a surface, by the numbering of Abaqus."""
    elements = {}
    for part in model.parts:
        for numbers, rows, table in ((part.hex_elements, part.hexes, ABAQUS_FACES),
                                     (part.wedge_elements, part.wedges, WEDGE_FACES)):
            elements |= {n: (row, table) for n, row in zip(numbers.tolist(), rows, strict=True)}
    return [np.array([model.points[elements[e][0][n - 1]] for n in sorted(elements[e][1][face])])
            for e, face in model.surfaces[name].tolist()]


def cone_radius(points):
    """Radius (n,) in mm of a frustum at points (n, 3) of a sensor."""
    return 0.3 + 0.3 * (points[:, 2] + 2.5) / 0.5


def test_contacts_have_the_penalty_of_the_press(pair, dialect):
    model, deck = pair
    assert [(slave, master) for slave, master, *_ in deck.contacts] == [
        ("TOP", "OBJECT_SURFACE"), ("FRUSTA_FOOT", "BOARD_SURFACE"), ("FRUSTA_SIDES_EVEN", "FRUSTA_SIDES_ODD")]
    laws = MeshSettings().object_contact, MeshSettings().contact, MeshSettings().contact
    for (_, _, behaviour, table), law in zip(deck.contacts, laws, strict=True):
        if dialect == "calculix":
            assert (behaviour, table) == ("LINEAR", [[law.stiffness]])
        else:
            pressure, overlap = np.array(table).T
            assert behaviour == "TABULAR"
            assert pressure == pytest.approx(penalty(-overlap, stiffness=law.stiffness, smoothing=law.smoothing)[1])


def test_a_deck_has_the_friction_of_the_sensor_and_none_without(pair, dialect, tmp_path):
    """Abaqus: elastic slip and coefficient;  CalculiX: coefficient and stick slope, mu times 1 MPa over our slip tolerance."""
    assert pair[1].friction == {}
    rough = replace(SENSOR, spec=SMALL.model_copy(update={"tips_bonded": False, "friction": Friction(object=0.2, board=0.3)}))
    export_press(rough, SPHERE, force_n=[1.0], dialect=dialect, path=tmp_path / "rough.inp")
    deck = read_deck(tmp_path / "rough.inp")
    numbers = {"abaqus": lambda mu: [5e-4, mu], "calculix": lambda mu: [mu, mu / 5e-4]}[dialect]
    assert deck.friction == {("TOP", "OBJECT_SURFACE"): pytest.approx(numbers(0.2)),
                             ("FRUSTA_FOOT", "BOARD_SURFACE"): pytest.approx(numbers(0.3))}
    assert len(deck.contacts) == 3                                # neighbouring frusta glide on each other


def test_the_normals_of_the_objects_facets_point_to_the_rubber(pair, dialect):
    model, deck = pair
    body, = (rigid for rigid in model.rigid if rigid.name == "OBJECT")
    (kind, elements), = deck.elements["OBJECT"].items()
    corners = np.array([[deck.nodes[n] for n in nodes] for nodes in elements.values()])
    if dialect == "calculix":
        assert kind == "C3D4" and deck.surfaces["OBJECT_SURFACE"][0][1] == "S1"
        edges = corners[:, 1:] - corners[:, :1]
        assert (np.linalg.det(edges) > 0).all()                   # not inside out
        facets = corners[:, [2, 1, 0]]                            # a first face's outward normal: nodes 1, 3, 2
    else:
        assert kind == "R3D3" and deck.surfaces["OBJECT_SURFACE"] == [("OBJECT", "SPOS")]
        assert deck.rigid_bodies["OBJECT"] in deck.node_sets["OBJECT_REFERENCE"]
        facets = corners
    assert facets == pytest.approx(body.points[body.facets], abs=1e-11)
    assert (np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])[:, 2] < 0).all()


def test_our_faces_are_those_of_abaqus():
    """S1 bottom, S2 top, S3 to S6 the sides eta = -1, xi = 1, eta = 1, xi = -1."""
    ours = [HEX20.bottom, HEX20.top, *HEX20.sides]
    assert [set((face[:4] + 1).tolist()) for face in ours] == list(ABAQUS_FACES.values())


@one_dialect
def test_a_unit_cell_has_planes_of_contact_for_the_neighbours_it_lacks(tmp_path, dialect):
    body = build_unit_cell(CORO, dielectric_law=POLYURETHANE)
    model = deck_model(body, place(trimesh.creation.box((5.0, 5.0, 1.0))), indentations_mm=[0.02, 0.05])
    write_deck(tmp_path / "cell.inp", model, dialect=dialect)
    deck = read_deck(tmp_path / "cell.inp")
    assert [part.name for part in model.parts] == ["SHEET", "FRUSTA"]
    top = face_corners(model, "TOP")                              # without a cover: the sheet's bricks and wedges
    assert sorted(map(len, top)) == 4 * [3] + 5 * [4] and np.vstack(top)[:, 2] == pytest.approx(0.0)
    assert [contact[:2] for contact in deck.contacts][-1] == ("FRUSTA_SIDES", "WALLS_SURFACE")
    assert [step.boundary[-1][1:] for step in deck.steps] == [(3, 3, -0.02), (3, 3, -0.05)]
    walls, = (rigid for rigid in model.rigid if rigid.name == "WALLS")
    corners = walls.points[walls.facets]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("fi,fi->f", normal, corners.mean(axis=1) * [1, 1, 0]) < 0).all()    # inwards


@one_dialect
def test_a_refined_cell_has_finer_sides_and_no_constrained_edges(dialect):
    body = build_unit_cell(CORO, dielectric_law=POLYURETHANE, mesh=MeshSettings(refinement=1))
    model = deck_model(body, place(trimesh.creation.box((5.0, 5.0, 1.0))), indentations_mm=[0.02])
    sides = np.vstack(face_corners(model, "FRUSTA_SIDES")) - [0, 0, 1.5]      # no cover: 1.5 mm higher than in a sensor
    assert len(sides) == 4 * 8 * body.support.mesh.layers
    assert np.linalg.norm(sides[:, :2], axis=1) == pytest.approx(cone_radius(sides), rel=0.01)   # parabolic arcs: 0.8 %
    assert {model.points[tie.slave, 2] for tie in model.ties} == {0.0}


def test_a_refusal_leaves_no_file(tmp_path):
    path = tmp_path / "press.inp"
    for arguments, said in (({"dialect": "nastran"}, "'nastran' is unknown; use one of calculix, abaqus"),
                            ({"dialect": "calculix", "frustum_element": "C3D20RH"}, "none for CalculiX; use one of C3D20R, C3D20"),
                            ({"dialect": "abaqus", "control": "pressure"}, "'pressure' is unknown")):
        with pytest.raises(InputError, match=said):
            export_press(SENSOR, SPHERE, force_n=1.0, path=path, **arguments)
    assert list(tmp_path.iterdir()) == []


def test_an_object_beside_the_body_is_refused():
    far = place(SPHERE)
    far.apply_translation([50.0, 0, 0])
    with pytest.raises(InputError, match="misses the sensor"):
        deck_model(SENSOR.body(), far, forces_n=[1.0])


def test_a_sliver_among_the_facets_is_left_out():
    plate = trimesh.creation.box((3.0, 3.0, 1.0))
    below = np.flatnonzero(plate.face_normals[:, 2] < -0.5)[0]
    a, b, c = plate.faces[below]
    middle = len(plate.vertices)                 # a corner 0.001 mm from a side cuts off a facet that is no wider
    side = 0.5 * (plate.vertices[a] + plate.vertices[b])
    towards = plate.vertices[c] - side
    points = np.vstack([plate.vertices, side + 1e-3 * towards / np.linalg.norm(towards)])
    faces = np.vstack([np.delete(plate.faces, below, axis=0), [[a, b, middle], [b, c, middle], [c, a, middle]]])
    model = deck_model(SENSOR.body(), place(trimesh.Trimesh(points, faces, process=False)), forces_n=[1.0])
    assert len(model.rigid[0].facets) == 3        # of four that look down


@one_dialect
def test_the_same_press_gives_the_same_bytes(dialect):
    model = deck_model(SENSOR.body(), place(SPHERE), forces_n=[1.0])
    assert deck_text(model, dialect=dialect) == deck_text(deck_model(SENSOR.body(), place(SPHERE), forces_n=[1.0]), dialect=dialect)
