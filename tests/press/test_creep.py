"""Presses over time: sensors whose stiffness relaxes, bodies whose materials do, and what cannot follow is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh
import yaml

import softtact
from softtact.cli import main
from softtact.contact.motion import Motion
from softtact.errors import InputError
from softtact.fem.files.solids import write_mesh
from softtact.fem.structured_meshes import box
from softtact.materials.inelastic import Inelastic
from softtact.materials.laws.registry import make_law
from softtact.materials.prony import PronySeries
from softtact.press.creep import at_times, effective_forces, slow_press
from softtact.press.result import read_press
from softtact.sensors.library import sensor_file

SERIES = PronySeries((0.3, 0.2), (0.2, 5.0), "relaxed")
BALL = trimesh.creation.icosphere(4, radius=8.0)
HELD = Motion().press(force_n=2.0, over_s=0.2).hold(0.3).hold(2.0).hold(200.0)


def relaxing_sheet(folder, **more):
    spec = yaml.safe_load(sensor_file("sheet").read_text()) | {"relaxation": {"g": [0.3, 0.2], "tau_s": [0.2, 5.0]}} | more
    (folder / "mine.yaml").write_text(yaml.safe_dump(spec))
    return folder / "mine.yaml"


def test_a_force_at_once_acts_as_the_creep_function_and_a_ramp_as_its_mean():
    shares, late = SERIES.retardation()
    held = effective_forces(np.array([3.0, 3.0, 3.0]), np.array([1e-9, 1.0, 50.0]), shares, late)
    np.testing.assert_allclose(held, 3 * SERIES.creep(np.array([0.0, 1.0, 50.0])), rtol=1e-7)
    time = np.linspace(0, 4, 4001)
    mean = np.trapezoid(SERIES.creep(time), time) / 4     # of a ramp of 4 s
    assert effective_forces(np.array([3.0]), np.array([4.0]), shares, late)[0] == pytest.approx(3 * mean, rel=1e-6)
    np.testing.assert_allclose(effective_forces(np.array([1.0, 4.0]), np.array([1.0, 2.0]), np.zeros(0), np.zeros(0)), [1.0, 4.0])


def test_a_reading_creeps_after_a_press_to_that_of_a_slow_one(tmp_path):
    sensor = softtact.load_sensor(relaxing_sheet(tmp_path))
    timed = sensor.press(BALL, motion=HELD, model="elastic", label="")
    slow = sensor.press(BALL, force_n=2.0, model="elastic", label="")
    counts = timed.tactile_map.sum(axis=(1, 2))
    assert (np.diff(counts) > 0).all() and counts[-1] == pytest.approx(slow.tactile_map.sum(), rel=1e-6)
    np.testing.assert_allclose(timed.time_s, [0.2, 0.5, 2.5, 202.5])
    np.testing.assert_allclose(timed.normal_force_n, 2.0, rtol=1e-9)
    np.testing.assert_allclose(timed.force_n[:, 2], -2.0, rtol=1e-9)


def test_a_sensor_that_does_not_relax_reads_the_same_for_as_long_as_it_is_held():
    held = softtact.load_sensor("sheet").press(BALL, motion="fz -2 over 1; hold 10 in 2", model="elastic", label="")
    at_once = softtact.load_sensor("sheet").press(BALL, force_n=2.0, model="elastic", label="")
    np.testing.assert_array_equal(held.deformation_map_mm, np.repeat(at_once.deformation_map_mm, 3, axis=0))


@pytest.mark.slow
def test_the_creep_of_layers_is_that_of_a_solid_whose_material_relaxes(tmp_path):
    # K/mu 200, so that all of the stiffness that counts relaxes; the models' meshes differ by 0.4 %
    ball, held = trimesh.creation.icosphere(5, radius=8.0), Motion().press(force_n=2.0, over_s=0.2).hold(2.3)
    law = make_law("neo_hooke", {"c10": 0.22}, bulk_over_shear=200)
    layers = replace(softtact.load_sensor(relaxing_sheet(tmp_path)), laws={"dielectric": law})
    relaxing = law.scaled(1.0)
    relaxing.inelastic = Inelastic(prony=SERIES)
    solid = replace(softtact.load_sensor("sheet"), laws={"dielectric": relaxing})
    one = layers.press(ball, motion=held, model="hyperelastic", label="")
    other = solid.press(ball, motion=held, model="solid", label="")
    np.testing.assert_allclose(one.indentation_mm, other.indentation_mm, rtol=6e-3)
    np.testing.assert_allclose(one.time_s, other.time_s)


def test_presses_over_time_that_are_not_known_are_refused(tmp_path):
    sensor = softtact.load_sensor(relaxing_sheet(tmp_path))
    for motion, model, sentence in [
        ("fz -2 over 1; fz -1 over 1", "elastic", "the force falls at step 2 of 2"),
        ("fz 0 over 1; fz -2 over 1", "elastic", "the load of step 1, fz 0 N, does not press; give one below 0"),
        ("fz 5 over 1; fz -2 over 1", "elastic", "the load of step 1, fz 5 N, does not press; give one below 0"),
        ("z -0.1 over 1", "elastic", "sheet relaxes, which over time is known for presses straight down by force"),
        ("fz -2 over 1; rz 5 over 1", "solid", "sheet relaxes")]:
        with pytest.raises(InputError, match=sentence):
            sensor.press(BALL, motion=motion, model=model, label="")
    law = make_law("neo_hooke", {"c10": 0.22}, bulk_over_shear=20)
    law.inelastic = Inelastic(prony=SERIES)
    for model in ("hyperelastic", "auto"):
        with pytest.raises(InputError, match="the material of 'dielectric' softens or relaxes"):
            replace(softtact.load_sensor("sheet"), laws={"dielectric": law}).press(BALL, force_n=2.0, model=model, label="")
    with pytest.raises(InputError, match="at 'relaxation': the sum of g is 1"):
        softtact.load_sensor(relaxing_sheet(tmp_path, relaxation={"g": [1.0], "tau_s": [1.0]}))


def test_a_partial_result_of_a_press_over_time_has_its_times_and_forces(tmp_path):
    sensor = softtact.load_sensor(relaxing_sheet(tmp_path))
    slow, load_step, effective = slow_press(HELD, sensor.spec.creep)
    reached = sensor.press(BALL, force_n=slow.forces_n[:2], model="elastic", label="")
    partial = at_times(reached, load_step, effective, HELD)
    np.testing.assert_allclose(partial.time_s, [0.2, 0.5])
    np.testing.assert_allclose(partial.normal_force_n, 2.0)
    np.testing.assert_allclose(partial.pad_force_n + partial.shell_force_n, 2.0)


def test_pressures_that_are_read_are_those_of_the_load_and_not_of_its_creep(tmp_path):
    # A circle that holds the whole contact reads the force over its area, at every time; its area is that of faces, which differ by
    # some tenths of a per cent between depths. The press that has crept least is that of 0.56 of the load.
    tip = {"tip": {"kind": "points", "points_mm": [[0, 0, 0]], "radius_mm": 6.0}, "taxels": {"kind": "capacitance"}}
    sensor = softtact.load_sensor(relaxing_sheet(tmp_path, readouts=tip))
    slow = softtact.load_sensor("sheet")
    slow = replace(slow, spec=sensor.spec.model_copy(update={"relaxation": None}))
    timed, at_rest = (one.press(BALL, motion=motion, model="hyperelastic", label="")
                      for one, motion in ((sensor, "fz -2 over 0.2"), (slow, "fz -2")))
    pressure = [result.readings["tip"].values[-1, 0, 0] for result in (timed, at_rest)]
    assert pressure[0] == pytest.approx(pressure[1], rel=1e-2) and timed.indentation_mm < at_rest.indentation_mm


BLOCK = {"name": "block", "kind": "solid", "mesh": {"file": "block.vtu"}, "held": {"z0": "xyz"}, "contact": {"face": "z1"},
         "regions": {"body": {"law": "neo_hooke", "parameters": {"c10": 0.1}, "bulk_over_shear": 1000,
                              "prony": {"g": [0.4], "tau_s": [2.0], "moduli": "instantaneous"}}},
         "readings": {"points_mm": [[1, 1, 1]], "radius_mm": 2.0}, "force_range_n": [0, 2]}


@pytest.fixture
def block(tmp_path):
    """A block of 2 x 2 x 1 mm that relaxes by 0.4 of its stiffness, and a plate."""
    write_mesh(box((0, 0, 0), (2, 2, 1), (2, 2, 1), region="body"), tmp_path / "block.vtu")
    (tmp_path / "block.yaml").write_text(yaml.safe_dump(BLOCK))
    trimesh.creation.box((4, 4, 1)).export(tmp_path / "plate.stl")
    return tmp_path


def test_the_force_under_a_plate_at_a_held_depth_relaxes_as_the_material_of_its_region(block, capsys):
    # nearly incompressible and at one depth: all stress but the pressure relaxes, and that follows; surfaces may overlap by 1 um
    assert main(["press", str(block / "plate.stl"), "--unit", "mm", "--sensor", str(block / "block.yaml"), "--motion",
                 "z -0.25 over 0.001; hold 2; hold 40", "--out", str(block / "held.nc"), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    force = np.array([load[2] for load in summary["load"]])
    assert summary["time_s"] == pytest.approx([0.001, 2.001, 42.001])
    assert force / force[0] == pytest.approx([1.0, 0.6 + 0.4 * np.exp(-1), 0.6], rel=8e-3)
    np.testing.assert_allclose(read_press(block / "held.nc").time_s, summary["time_s"])


def test_the_table_of_a_press_over_time_begins_with_the_time(block, tmp_path, capsys):
    assert main(["press", str(block / "plate.stl"), "--unit", "mm", "--sensor", str(relaxing_sheet(tmp_path)), "--motion",
                 "fz -2 over 0.5; hold 9.5", "--model", "elastic"]) == 0
    lines = capsys.readouterr().out.splitlines()
    head = next(k for k, line in enumerate(lines) if line.split()[:2] == ["time,", "s"])
    assert [line.split()[0] for line in lines[head + 1:head + 3]] == ["0.5", "10"]


def test_a_deck_of_a_material_that_relaxes_is_refused(block):
    from softtact.decks.keywords import law_card

    law = softtact.load_sensor(block / "block.yaml").laws["body"]
    with pytest.raises(InputError, match="softens or relaxes .* which decks do not take"):
        law_card(law, no_term=0.0, dialect="abaqus")
