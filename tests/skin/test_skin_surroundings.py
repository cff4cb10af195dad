"""What a skin meets: objects in contact, links that it is laid on, places of fingers, other programs."""

import dataclasses
from xml.etree import ElementTree as xml

import numpy as np
import pandas as pd
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from support.skins import small_skin

from softtact.errors import InputError
from softtact.skin.analysis import CONVERTERS
from softtact.skin.contact import contact_load
from softtact.skin.elastomers import read_elastomers
from softtact.skin.layout import module_layout
from softtact.skin.link import GeodesicMesh, icub_text, lay_modules, mujoco_xml, upright, urdf
from softtact.skin.maps import patch_maps

FOAM = read_elastomers()["SomaFoama"]


def test_a_ball_touches_where_it_is_lowest_and_pushes_with_its_whole_force():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=10.0)
    load = contact_load(small_skin(), ball, (10.0, 5.5), force_n=0.2, elastomer=FOAM)
    assert load.total_n == pytest.approx(0.2) and (load.force_n > 0).all()
    assert load.force_n @ load.points_mm / 0.2 == pytest.approx((10.0, 5.5), abs=0.15)  # nodes are 0.77 mm apart
    reach = np.linalg.norm(load.points_mm - (10, 5.5), axis=1).max()
    assert 0.5 < reach < 4.0


def test_an_object_beside_the_skin_is_refused():
    with pytest.raises(InputError, match="lies beside the elastomer"):
        contact_load(small_skin(), trimesh.creation.box((2, 2, 2)), (40.0, 0.0), force_n=1.0, elastomer=FOAM)


@pytest.fixture(scope="module")
def cylinder():
    return trimesh.creation.cylinder(radius=40.0, height=200.0, sections=128)


def test_a_straight_way_around_a_cylinder_comes_back(cylinder):
    """Around the prism's circumference, to 1e-6 of it."""
    surface = GeodesicMesh(cylinder)
    start = surface.at(np.array([40.0, 1.0, 5.0]), np.array([0.0, 1.0, 0.0]))
    around = 128 * 2 * 40.0 * np.sin(np.pi / 128)
    end = surface.walk(start, angle=0.0, length_mm=around)
    assert end.point == pytest.approx(start.point, abs=1e-3) and end.direction == pytest.approx(start.direction, abs=1e-6)


def test_modules_on_a_cylinder_leave_no_gaps_and_bend_with_its_radius(cylinder):
    laid = lay_modules(cylinder, module_layout(), start_mm=None, direction=np.array([0.0, 0.0, 1.0]), rings=2)
    assert len(laid.fits) == 10 and laid.fits.all() and laid.left_out == 0
    assert np.abs(laid.seams.gap_mm).max() < 1e-6  # it unrolls
    assert laid.modules.bend_radius_mm.to_numpy() == pytest.approx(40, rel=0.1)  # of 128 facets around
    assert len(laid.positions_mm) == 120 and np.linalg.norm(laid.positions_mm[:, :2], axis=1) == pytest.approx(40, rel=1e-3)
    outwards = laid.positions_mm * (1, 1, 0) / 40
    assert (laid.normals * outwards).sum(axis=1) == pytest.approx(1, abs=2e-3)


def test_modules_on_a_ball_overlap_and_it_is_told():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=60.0)
    laid = lay_modules(ball, module_layout(), start_mm=None, direction=np.array([0.0, 0.0, 1.0]), rings=3)
    assert laid.seams.gap_mm.min() < -0.1 and laid.left_out > 0


def test_a_link_that_bends_too_much_is_refused():
    with pytest.raises(InputError, match="bends with a radius of .* mm, and the boards bear 10 mm"):
        lay_modules(
            trimesh.creation.cylinder(radius=8.0, height=200.0, sections=64),
            module_layout(),
            start_mm=None,
            direction=np.array([0.0, 0.0, 1.0]),
            rings=1,
        )


def test_a_finger_is_felt_best_over_a_taxel_and_two_taxels_cannot_tell_place_and_force():
    converter = CONVERTERS["paper"]
    maps = patch_maps(
        small_skin(), finger_mm2=7.0, pressure_mpa=0.02, young_mpa=0.1, converter=converter, detected_counts=3.0, spacing_mm=0.5
    )
    at = {place: np.linalg.norm(maps.places_mm - place, axis=1).argmin() for place in ((8.0, 4.0), (10.5, 4.0), (10.0, 14.0))}
    over, between, far = (maps.smallest_force_n[k] for k in at.values())
    assert over < between < far and far > 20 * over
    assert np.isinf(maps.localisation_mm).all()


def of_noise(counts):
    """Maps of three taxels, which give place and force, with a converter's noise."""
    converter = dataclasses.replace(CONVERTERS["paper"], noise_counts=counts)
    skin = small_skin(centres=((8.0, 4.0), (13.0, 4.0), (10.5, 9.0)))
    return patch_maps(skin, finger_mm2=7.0, pressure_mpa=0.02, young_mpa=0.1, converter=converter, detected_counts=3.0,
                      spacing_mm=2.0)


def test_the_error_of_localisation_is_in_proportion_to_the_noise_and_none_without_noise():
    none, one, two = (of_noise(counts).localisation_mm for counts in (0.0, 1.0, 2.0))
    given = np.isfinite(one)
    assert given.any() and (none[given] == 0).all() and np.isinf(none[~given]).all()
    np.testing.assert_allclose(two, 2 * one, rtol=1e-12)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("places", "half_way_mm"), [(1, 0.2), (4, 0.2), (4, 0.0)])
def test_maps_of_taxels_that_do_not_tell_a_place_are_drawn_and_it_is_said(places, half_way_mm, tmp_path, monkeypatch):
    from softtact.studies.skin.stages import figures

    drawn = []
    monkeypatch.setattr(figures, "save", lambda figure, *_: drawn.append(figure) or figure.canvas.draw())
    x, y = np.array([[12.0, 14.0, 12.0, 14.0], [6.0, 6.0, 8.0, 8.0]])[:, :places]
    pd.DataFrame({"x_mm": x, "y_mm": y, "smallest_force_n": 0.1, "localisation_mm": np.inf}).to_csv(tmp_path / "d.csv")
    pd.DataFrame({"pitch_mm": [5.0, 6.0], "crosstalk": 0.1, "localisation_mm": half_way_mm}).to_csv(tmp_path / "c.csv")
    figures.draw_maps(inputs={"detection": tmp_path / "d.csv", "crosstalk": tmp_path / "c.csv"}, outputs={},
                      settings={"module": {"centres_mm": [[15.0, 9.0]]}, "patch": "none", "force_n": 0.5})
    titles = [axes.get_title() for axes in drawn[0].axes]
    assert [title for title in titles if title] == ["error of localisation at 0.5 N (mm): not given by these taxels"]
    (marks,) = drawn[0].axes[0].collections
    assert np.isfinite(marks.get_sizes()).all()


def test_exports_hold_the_places_and_normals_in_metres():
    places, normals = np.array([[15.0, 20.0, 0.0], [0.0, 0.0, -40.0]]), np.array([[0.0, 0.0, 1.0], [0.48, 0.6, -0.64]])
    lines = icub_text("arm", places, normals).splitlines()
    assert lines[3] == "[calibration]" and np.array([line.split() for line in lines[4:]], dtype=float) == pytest.approx(
        np.column_stack([1e-3 * places, normals])
    )
    joints = xml.fromstring(urdf("arm", places, normals)).findall("joint")
    for joint, place, normal in zip(joints, places, normals, strict=True):
        origin = joint.find("origin")
        assert np.array(origin.get("xyz").split(), dtype=float) == pytest.approx(1e-3 * place)
        turn = Rotation.from_euler("xyz", np.array(origin.get("rpy").split(), dtype=float))
        assert turn.apply([0, 0, 1]) == pytest.approx(normal, abs=1e-6)
        assert upright(normal).apply([0, 0, 1]) == pytest.approx(normal)


def test_mujoco_loads_the_sites_and_their_sensors():
    mujoco = pytest.importorskip("mujoco")
    places, normals = np.array([[15.0, 20.0, 0.0], [0.0, 0.0, -40.0]]), np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    model = mujoco.MjModel.from_xml_string(mujoco_xml("arm", places, normals, radius_mm=2.0))
    assert model.nsite == 2 and model.nsensor == 2 and model.site_pos == pytest.approx(1e-3 * places)
