"""A robot skin as a sensor: presses by name or design, the same counts as the design's study, its files, and what it refuses."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from support.small_sensors import SKIN, small_skin

import softtact
from softtact.cli import main
from softtact.errors import ConvergenceError, InputError, TimeLimitError
from softtact.press.result import read_press
from softtact.press.skin import prepared_design
from softtact.skin.analysis import CoarseSkin, Skin, analyse
from softtact.skin.contact import contact_load, force_at_depth, placed_over

BALL = trimesh.creation.icosphere(subdivisions=3, radius=8.0)
TAXEL = (15.0, 5.66)     # the seventh


@pytest.fixture(scope="module")
def skin(tmp_path_factory):
    return softtact.load_sensor(small_skin(tmp_path_factory.mktemp("skin")))


@pytest.fixture(scope="module")
def pressed(skin):
    return skin.press(BALL, pose=[*TAXEL, 20, 0, 0, 0], force_n=[0.2, 0.5], label="")


def test_a_press_has_the_counts_and_the_depth_that_the_skins_own_analysis_finds(skin, pressed):
    design, body = prepared_design(skin.spec), skin.prepared_models["elastic"]
    load = contact_load(body, BALL, TAXEL, force_n=0.5, elastomer=design.elastomer)
    readings = analyse(body, [load], elastomer=design.elastomer, converter=design.converter)
    reading = pressed.readings["skin"]
    np.testing.assert_array_equal(reading.values[-1], readings.counts[0])
    assert reading.values[-1].argmax() == 6 and reading.values[-1].max() > 20 and reading.attrs["units"] == "counts"
    assert pressed.indentation_mm[-1] == pytest.approx(load.indentation_mm) and pressed.normal_force_n.tolist() == [0.2, 0.5]
    assert pressed.solid.displacement_mm[-1][:, 2].min() == pytest.approx(-load.indentation_mm, rel=0.05)
    assert pressed.load("object")[-1, 2] == pytest.approx(-0.5)


def test_the_inside_of_the_elastomer_moves_with_its_upper_side(skin, pressed):
    design, body = prepared_design(skin.spec), skin.prepared_models["elastic"]
    load = contact_load(body, BALL, TAXEL, force_n=0.5, elastomer=design.elastomer)
    whole = body.layer.displacement(load, young_mpa=design.elastomer.young_mpa(load.pressure_mpa))
    np.testing.assert_allclose(pressed.solid.displacement_mm[-1], whole, atol=1e-12)


def test_contact_pressure_times_area_is_the_force(skin, pressed):
    layer = skin.prepared_models["elastic"]
    of_a_node = layer.layout.area_mm2 / len(layer.layer.mesh.top)
    np.testing.assert_allclose(np.nansum(pressed.solid.contact_pressure_mpa, axis=(1, 2)) * of_a_node, [0.2, 0.5], rtol=1e-9)


def test_a_force_beyond_the_elastomer_leaves_the_result_of_the_forces_before(skin):
    seen = []
    with pytest.raises(ConvergenceError, match=r"^small_skin at 4.5 N: .*twice") as ended:
        skin.press(BALL, force_n=[0.2, 0.5, 4.5], label="", on_step=seen.append)
    assert ended.value.result.normal_force_n.tolist() == [0.2, 0.5] and [one.steps for one in seen] == [1, 2]
    assert ended.value.result.readings["skin"].shape == (2, 12) and ended.value.result.solid.displacement_mm.shape[0] == 2


def test_a_time_limit_ends_a_press(skin):
    with pytest.raises(TimeLimitError, match="small_skin at 0.2 N"):
        skin.press(BALL, force_n=0.2, label="", time_limit_s=1e-9)


def test_volume_strained_beyond_the_elastomers_tests_is_flagged(skin, monkeypatch):
    from softtact.skin import contact

    small = contact.contact_load
    monkeypatch.setattr(contact, "press_at_finite_strains", lambda *args, **given: replace(small(*args, **given), beyond_tests=0.2))
    pressed = skin.press(BALL, force_n=0.2, model="solid", label="")
    assert not pressed.within_validity[0] and "extrapolated" in pressed.validity_reason[0]
    assert pressed.extrapolated_volume_fraction[0] == 0.2


def test_a_press_at_finite_strains_is_not_flagged_for_a_secant_modulus_that_it_does_not_use(skin, monkeypatch):
    from softtact.skin import contact

    small = contact.contact_load

    def finite(body, *args, **given):
        load = small(body, *args, **given)
        return replace(load, pressure_mpa=1e-4, displacement_mm=body.layer.displacement(load, young_mpa=0.2))

    monkeypatch.setattr(contact, "press_at_finite_strains", finite)
    pressed = skin.press(BALL, force_n=0.2, model="solid", label="")
    assert pressed.within_validity[0] and pressed.validity_reason[0] == ""


def test_a_contact_of_few_points_is_flagged(skin):
    mesh = skin.prepared_models["elastic"].layer.mesh
    x, y, _ = min(mesh.nodes_mm[mesh.top], key=lambda node: np.hypot(*(node[:2] - TAXEL)))
    tip = skin.press(trimesh.creation.icosphere(subdivisions=2, radius=0.3), pose=[x, y, 5, 0, 0, 0], force_n=0.003, label="")
    assert not tip.within_validity[0] and "points of the elastomer's mesh" in tip.validity_reason[0]


def test_an_object_between_the_points_of_the_mesh_is_refused_with_its_size(skin):
    with pytest.raises(InputError, match=r"between the points of the mesh of small_skin: it is 0.1 x 0.1 mm"):
        skin.press(trimesh.creation.box([0.1, 0.1, 1.0]), force_n=0.003, pose=[15.3, 8.8, 5, 0, 0, 0], label="")


def test_no_number_of_a_load_is_minus_zero(pressed):
    assert not np.signbit(pressed.load("object")[:, :2]).any() and not np.signbit(pressed.force_n[:, :2]).any()


@pytest.mark.parametrize(("use", "words"), [(lambda skin: skin.with_friction(0.3), "pressed without friction"),
                                            (lambda skin: skin.prepared("foundation"), "a skin has no map of a plane")])
def test_what_a_skin_does_not_have_is_refused_in_a_sentence(skin, use, words):
    with pytest.raises(InputError, match=f"small_skin, a sensor of kind skin: .*{words}"):
        use(skin)


def test_a_load_that_pulls_is_refused(skin):
    with pytest.raises(InputError, match="small_skin: a load of fz 5 N does not press; give one below 0, or force_n"):
        skin.press(BALL, motion="fz 5", label="")


def test_a_result_is_read_back_as_it_was_written(pressed, tmp_path):
    pressed.write(tmp_path / "press.nc")
    kept = read_press(tmp_path / "press.nc")
    np.testing.assert_array_equal(kept.readings["skin"].values, pressed.readings["skin"].values)
    np.testing.assert_array_equal(kept.readings["skin"].attrs["modules_mm"], pressed.readings["skin"].attrs["modules_mm"])
    np.testing.assert_array_equal(kept.solid.displacement_mm, pressed.solid.displacement_mm)
    pressed.plot(tmp_path / "press.png")


def test_an_object_without_a_pose_is_centred_over_the_elastomer(skin):
    x, y = skin.press(BALL, force_n=0.2, label="").solid.mesh.points[:, :2].T
    pressed = skin.press(BALL, force_n=0.2, label="")
    deepest = pressed.solid.displacement_mm[-1][:, 2].argmin()
    assert (x[deepest], y[deepest]) == pytest.approx((15.0, 8.66), abs=1.5)


def test_coarse_taxels_are_parallel_plates():
    layout = prepared_design(softtact.load_sensor("skin_module").spec).layout
    skin = CoarseSkin(layout, thickness_mm=2.0, poisson=0.3, permittivity=3.0)
    lowered = np.zeros_like(skin.layer.mesh.nodes_mm)
    lowered[:, 2] = -0.5
    plate = 8.8541878128 * 3.0 * np.pi * 2.1**2
    assert skin.at_rest_ff == pytest.approx(plate / 2.0, rel=1e-9)
    assert skin.capacitance_ff(lowered) == pytest.approx(plate / 1.5, rel=1e-6)
    with pytest.raises(InputError, match="presses the elastomer through"):
        skin.capacitance_ff(4.1 * lowered)


def test_kept_columns_of_the_compliance_are_those_of_a_new_skin(skin):
    body, top = skin.prepared_models["elastic"], skin.prepared_models["elastic"].layer.mesh.top
    body.compliance(top[:7])
    np.testing.assert_allclose(body.compliance(top[3:20]), new_skin(skin).compliance(top[3:20]), rtol=1e-9, atol=1e-12)


def new_skin(sensor):
    design = prepared_design(sensor.spec)
    return Skin(design.layout, thickness_mm=2.0, poisson=design.elastomer.poisson, permittivity=design.elastomer.permittivity_fe,
                mesh=design.design.mesh.sizes())


@pytest.mark.parametrize("depth", [0.1, 0.5])
def test_the_force_at_a_depth_presses_to_that_depth(skin, depth):
    body, elastomer = skin.prepared_models["elastic"], prepared_design(skin.spec).elastomer
    force = force_at_depth(body, placed_over(BALL, TAXEL, (0, 0, 0)), depth, elastomer=elastomer)
    assert contact_load(body, BALL, TAXEL, force_n=force, elastomer=elastomer).indentation_mm == pytest.approx(depth, rel=5e-3)


def test_the_command_line_presses_a_skin_and_prints_its_counts(tmp_path, capsys):
    BALL.export(tmp_path / "ball.stl")
    press = ["press", str(tmp_path / "ball.stl"), "--unit", "mm", "--sensor", str(small_skin(tmp_path)), "--pose=15,5.66,20,0,0,0"]
    assert main([*press, "--force", "0.5", "--out", str(tmp_path / "press.nc")]) == 0
    assert "skin at the last step: 0, 0, 0, " in capsys.readouterr().out
    for arguments, words in ((["--force", "0.5", "--model", "foundation"], "only with the elastic or the solid model"),
                             (["--motion", "z -0.3"], "straight down by forces, not by this motion"),
                             (["--force", "9"], "out of the range of sensor small_skin"),
                             (["--force", "0.5", "--device", "auto"], "--device auto: it has no effect on a sensor of kind skin"),
                             (["--force", "4.5"], "small_skin at 4.5 N: ")):
        assert main([*press, *arguments]) == 1
        assert words in capsys.readouterr().err


@pytest.mark.parametrize(("change", "words"), [("elastomer: SomaFoma\n", "there is no elastomer 'SomaFoma'"),
                                               ("pitch: 3\n", "'pitch'"), ("force_range_n: [3, 1]\n", "at 'force_range_n'")])
def test_a_fault_of_a_design_is_told_with_its_file(tmp_path, change, words):
    (tmp_path / "wrong.yaml").write_text(SKIN + change)
    with pytest.raises(InputError, match=f"wrong.yaml.*{words}"):
        softtact.load_sensor(tmp_path / "wrong.yaml")


@pytest.mark.slow
def test_finite_strains_read_nearly_what_small_ones_do_under_a_light_press(skin, pressed):
    solid = skin.press(BALL, pose=[*TAXEL, 20, 0, 0, 0], force_n=0.2, model="solid", label="")
    assert solid.model == "solid" and solid.indentation_mm[0] == pytest.approx(pressed.indentation_mm[0], rel=0.3)
    assert solid.readings["skin"].values[0].max() == pytest.approx(pressed.readings["skin"].values[0].max(), rel=0.3)
