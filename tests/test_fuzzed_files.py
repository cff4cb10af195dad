"""Files with random faults: every reader takes them, or refuses them with the project's own error in one sentence with the name."""

import io
import json
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from softtact.errors import SofttactError
from softtact.fem.files.solids import read_body
from softtact.geometry.repair import read_mended
from softtact.learning.network import load_network
from softtact.learning.prediction import read_maps
from softtact.materials.cards import law_from_card, load_card
from softtact.materials.config import load_material
from softtact.materials.readers import read_curve
from softtact.materials.time_tests import read_time_tests
from softtact.reporting.press_view import read_view
from softtact.sensors.library import material_file, sensor_file
from softtact.sensors.specification import SensorSpec
from softtact.studies.hybrid.config import load_study
from tests.support.element_files import block, hexahedra, inp_assembly, inp_part, msh22, msh41
from tests.support.object_files import ONE, file_3mf, file_amf, file_dae, file_glb, file_off, mesh_3mf, packed
from tests.support.sound_recordings import ramp

ROOT = Path(__file__).resolve().parents[1]
BOX = trimesh.creation.box(extents=(4, 5, 6))
CURVE = b"# mode: uniaxial\nstretch,nominal_stress_mpa\n0.8,-0.3\n0.9,-0.13\n1.1,0.11\n1.3,0.28\n"
CARD = json.dumps({"material": "m", "kind": "measured", "chosen": "neo_hooke", "strain_window": {"uniaxial": [0.8, 1.3]},
                   "laws": {"neo_hooke": {"parameters": {"c10": 0.2}, "bulk_modulus_mpa": 8.0}}}).encode()
SOME = [None, True, -1, 0, 1e999, "x", "1e", [], [1], {}, {"value": 1}, float("nan"), 10**400, ["a", {}], {"a": {"b": []}}, "é\x00"]


def saved_array(array):
    """Content of the .npy file of an array."""
    file = io.BytesIO()
    np.save(file, array, allow_pickle=True)
    return file.getvalue()


def block_of_gmsh(new=False):
    """Nodes, elements and names of a block for `msh41` or `msh22`."""
    nodes, cells = block()
    return nodes, [(3, 1, [1], 4, cells)] if new else [(4, 1, 1, cells)], [(3, 1, "gel")]


quick = settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])


class Reader:
    """Calls of a reader on what may be faulty; it counts the refusals, each in one sentence that names the file."""

    def __init__(self, read, *, named):
        self.read, self.named, self.taken, self.refused = read, named, 0, 0

    def __call__(self, *arguments):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                result = self.read(*arguments)
            except SofttactError as error:
                assert "\n" not in str(error) and self.named in str(error), error
                self.refused += 1
                return None
        self.taken += 1
        return result


@st.composite
def damaged(draw, content):
    """The content with some bytes replaced, left out or added, or something else altogether."""
    if draw(st.booleans()) and draw(st.booleans()):
        return draw(st.binary(max_size=200))
    data = bytearray(content)
    for _ in range(draw(st.integers(0, 4))):
        at = draw(st.integers(0, max(len(data) - 1, 0)))
        data[at:at + draw(st.integers(0, 30))] = draw(st.one_of(st.binary(max_size=6), st.sampled_from(
            [b"nan", b"inf", b"-", b"1e999", b"\n", b",", b"\x00", b"\xff\xfe", b"9" * 30, b"{", b"]", b": ", b"- "])))
    return bytes(data[:draw(st.integers(0, len(data)))]) if draw(st.booleans()) else bytes(data)


@st.composite
def changed(draw, values):
    """Nested mappings and lists of which one value is replaced, left out, or under another key."""
    if draw(st.integers(0, 3)) == 0 or not values or not isinstance(values, (dict, list)):
        return draw(st.sampled_from(SOME))
    copy = dict(values) if isinstance(values, dict) else list(values)
    key = draw(st.sampled_from(sorted(copy, key=str) if isinstance(copy, dict) else range(len(copy))))
    kind = draw(st.integers(0, 7))
    if isinstance(copy, dict) and kind < 2:
        value = copy.pop(key)
        return copy if kind == 0 else copy | {draw(st.sampled_from([3, "", f"{key}s", None])): value}
    copy[key] = draw(changed(copy[key]))
    return copy



def damaged_objects(path, content, *, unit):
    """The `Reader` after many damaged copies of an object's file: each is refused by name, or read as a closed body."""
    reader = Reader(lambda: read_mended(path, unit=unit), named=path.name)

    @quick
    @given(damaged(content))
    def damage(data):
        path.write_bytes(data)
        mended = reader()
        if mended is not None:
            assert mended.mesh.is_watertight and mended.mesh.volume > 0

    damage()
    return reader


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "obj", "ply"])
def test_a_damaged_mesh_is_refused_by_name_or_read_as_a_closed_body(kind, tmp_path):
    content = BOX.export(file_type=kind)
    reader = damaged_objects(tmp_path / f"mesh.{kind[:3]}", content if isinstance(content, bytes) else content.encode(), unit="mm")
    assert reader.refused >= 10 and reader.taken > 0


OBJECTS = {"box.3mf": file_3mf(mesh_3mf(), ONE), "box.amf": file_amf(), "box.glb": file_glb(), "box.off": file_off(),
           "box.dae": file_dae(), "box.zip": packed(**{"a/box.off": file_off()})}


@pytest.mark.parametrize("name", OBJECTS)
def test_a_damaged_object_of_another_format_is_refused_by_name_or_read_as_a_closed_body(name, tmp_path):
    if name.endswith(".dae"):
        pytest.importorskip("collada", reason="pip install 'softtact[cad]'")
    reader = damaged_objects(tmp_path / name, OBJECTS[name], unit="mm" if name.endswith((".off", ".zip")) else None)
    assert reader.refused >= 5 and reader.taken > 0


def test_a_damaged_bag_is_refused_by_name_or_read(tmp_path):
    pytest.importorskip("rosbags", reason="pip install 'softtact[ros]'")
    from softtact.readout.bags import read_bag, write_bag

    write_bag(tmp_path / "sound.mcap", ramp().recording().isel(time=slice(30, 60)).assign_attrs(start_ms=1_764_000_000_123))
    content, path = (tmp_path / "sound.mcap").read_bytes(), tmp_path / "press.mcap"
    reader = Reader(lambda: read_bag(path), named=path.name)

    @quick
    @given(damaged(content))
    def damage(data):
        path.write_bytes(data)
        reader()

    damage()
    assert reader.refused >= 10


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "ply"])
def test_a_mesh_cut_off_anywhere_is_refused_by_name_or_whole(kind, tmp_path):
    content = BOX.export(file_type=kind)
    content = content if isinstance(content, bytes) else content.encode()
    path = tmp_path / f"mesh.{kind[:3]}"
    reader = Reader(lambda: read_mended(path, unit="mm"), named=path.name)
    for end in range(0, len(content), 7):
        path.write_bytes(content[:end])
        mended = reader()
        assert mended is None or mended.mesh.volume == pytest.approx(120)
    assert reader.refused > 0.8 * len(content) / 7


ELEMENTS = {
    "deck.inp": (inp_part("A", *hexahedra(1)) + inp_assembly(
        {"A-1": ("A", "0, 0, 1\n0, 0, 0, 0, 0, 1, 30.\n"), "A-2": ("A", "9, 0, 0\n")},
        "*ELSET, ELSET=SOME, INSTANCE=A-1, GENERATE\n1, 1\n*SURFACE, NAME=TOP\nSOME, S2\n")).encode(),
    "old.msh": msh22(*block_of_gmsh()), "old_binary.msh": msh22(*block_of_gmsh(), binary=True),
    "new.msh": msh41(*block_of_gmsh(new=True)), "new_binary.msh": msh41(*block_of_gmsh(new=True), binary=True)}


@pytest.mark.parametrize("name", ELEMENTS)
def test_damaged_elements_are_refused_by_name_or_read_as_a_body(name, tmp_path):
    path = tmp_path / name
    reader = Reader(lambda: read_body(path, unit="mm"), named=path.name)

    @quick
    @given(damaged(ELEMENTS[name]))
    def damage(data):
        path.write_bytes(data)
        body = reader()
        assert body is None or body.mesh.volume_mm3() > 0

    damage()
    assert reader.refused >= 10 and reader.taken > 0


@pytest.mark.parametrize(("name", "content", "read"), [
    ("uniaxial.csv", CURVE, read_curve),
    ("relaxation.csv", b"time_s,nominal_stress_mpa\n0,1.0\n1,0.8\n2,0.7\n5,0.6\n9,0.55\n",
     lambda path: read_time_tests([(path, "relaxation")])),
    ("card.json", CARD, lambda path: law_from_card(load_card(path))),
    ("sensor.yaml", sensor_file("coro").read_bytes(), SensorSpec.from_yaml),
    ("neoprene.yaml", material_file("neoprene").read_bytes(), load_material),
    ("map.csv", b"1,2,3\n4,5,6\n7,8,9\n", lambda path: read_maps(path, shape=(3, 3))),
    ("map.npy", saved_array(np.zeros((3, 3))), lambda path: read_maps(path, shape=(3, 3))),
    ("objects.npy", saved_array(np.array([{}, {}])), lambda path: read_maps(path, shape=(3, 3))),
    ("model.pt", b"PK\x03\x04" + bytes(60), load_network),
    ("press.vtu", b'<?xml version="1.0"?><VTKFile type="UnstructuredGrid"><UnstructuredGrid/></VTKFile>', read_view),
    ("press.nc", b"\x89HDF\r\n\x1a\n" + bytes(80), read_view),
], ids=lambda value: value if isinstance(value, str) else "")
def test_a_damaged_file_is_taken_or_refused_by_name(name, content, read, tmp_path):
    path = tmp_path / name
    reader = Reader(lambda: read(path), named="card" if name == "card.json" else name)

    @quick
    @given(damaged(content))
    def damage(data):
        path.write_bytes(data)
        reader()

    damage()
    assert reader.refused >= 25      # of 40: most damage matters


@pytest.mark.parametrize("kind", ["study", "sensor", "material", "card"])
def test_a_wrong_value_anywhere_is_taken_or_refused_by_name(kind, tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    files = {"study": ROOT / "config/config.yaml", "sensor": sensor_file("coro"), "material": material_file("neoprene")}
    values = yaml.safe_load(files[kind].read_text()) if kind in files else json.loads(CARD)
    path = tmp_path / ("card.json" if kind == "card" else f"{kind}.yaml")

    def read(wrong):
        if kind == "study":
            return load_study(wrong)
        path.write_text(json.dumps(wrong) if kind == "card" else yaml.safe_dump(wrong), encoding="utf-8")
        if kind == "card":
            return law_from_card(load_card(path))       # of a card that was read no file is known, only that it is a card
        return SensorSpec.from_yaml(path) if kind == "sensor" else load_material(path)

    reader = Reader(read, named={"study": "", "card": "card"}.get(kind, path.name))

    @settings(quick, max_examples=150 if kind != "study" else 60)
    @given(changed(values))
    def change(wrong):
        reader(wrong)

    change()
    assert reader.refused > reader.taken


def test_a_binary_stl_that_promises_more_than_it_holds_asks_for_no_memory(tmp_path):
    (tmp_path / "mesh.stl").write_bytes(b"x".ljust(80) + struct.pack("<I", 2**32 - 1) + bytes(500))
    with pytest.raises(SofttactError, match="mesh.stl"):
        read_mended(tmp_path / "mesh.stl", unit="mm")
