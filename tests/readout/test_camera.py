"""The readouts of a gel with a camera: places of markers by hand, images, depth, and what is refused when a sensor is loaded."""

from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from support.gels import dent, gel_spec, gel_values, read, surface_of

import softtact
from softtact.errors import InputError
from softtact.imaging.markers import find_markers, track
from softtact.readout.camera import Camera, MarkerGrid
from softtact.readout.depth import grey
from softtact.readout.registry import Samples, SurfaceMotion
from softtact.sensors.base import ReadoutEntry


@pytest.fixture(scope="module")
def spec():
    return gel_spec()


# --- markers ---


def test_the_markers_at_rest_are_the_printed_grid(spec):
    markers = read(spec, "markers", surface_of(spec, dent(spec)))
    assert markers.dims == ("step", "marker", "axis") and markers.shape == (1, 64, 2)
    assert markers.values[0, 0] == pytest.approx([15.7, 16.5])
    assert markers.values[0, 9] == pytest.approx([15.7 + 31.96, 16.5 + 31.96])
    assert np.allclose(markers.values[0], np.column_stack([markers.rest_x_px, markers.rest_y_px]))


def test_a_gel_that_sinks_and_slides_as_a_whole_moves_each_marker_by_hand(spec):
    """1.2 mm down and 0.5 mm aside: marker 0 from -6.9875 + 0.5 mm, magnified by 35 / 33.8, 16 px a mm; x 19.86 px, y 12.56 px."""
    moved = np.zeros((*spec.map_shape, 3)) + [0.5, 0.0, -1.2]
    markers = read(spec, "markers", surface_of(spec, moved))
    assert markers.values[0, 0] == pytest.approx([127.5 - 6.4875 * 16 * 35 / 33.8, 127.5 - 111.0 * 35 / 33.8])
    assert [markers[f"{axis}_mm"].values[0, 0] for axis in "xyz"] == pytest.approx([-6.4875, -6.9375, -1.2])


def test_places_in_mm_are_a_reading_of_their_own(spec):
    entry = {"kind": "markers", "unit": "mm"}
    values = gel_values()
    values["readouts"]["marker_mm"] = entry
    from softtact.sensors.specification import any_spec

    mine = any_spec(values)
    surface = surface_of(mine, dent(mine, depth=1.0, aside=(0.3, -0.2)))
    px, mm = (read(mine, name, surface) for name in ("markers", "marker_mm"))
    assert mm.shape == (1, 64, 3) and mm.attrs["units"] == "mm"
    assert np.array_equal(mm.values, np.stack([px.x_mm, px.y_mm, px.z_mm], axis=-1))


def test_a_grid_without_a_first_marker_lies_in_the_middle_and_can_be_turned():
    grid = MarkerGrid(rows=3, columns=5, pitch_mm=2.0, radius_mm=0.3, angle_deg=90.0)
    camera = Camera(pixels=(101, 81), mm_per_px=0.1, distance_mm=30.0, shading="digit").pinhole
    px = grid.rest_px(camera)
    assert px.mean(axis=0) == pytest.approx([50, 40])
    assert px[1] - px[0] == pytest.approx([0, 20])      # turned clockwise: the columns run down the image


def test_a_list_of_places_is_read_in_its_order(spec):
    listed = gel_spec(markers={"points_px": [[30.0, 40.5], [200.0, 17.25]], "radius_mm": 0.4})
    assert np.allclose(read(listed, "markers", surface_of(listed, dent(listed))).values[0], [[30.0, 40.5], [200.0, 17.25]])


# --- images ---


def test_the_image_at_rest_is_the_background_with_markers(spec):
    image = read(spec, "camera", surface_of(spec, dent(spec)))
    assert image.dims == ("step", "y", "x", "channel") and image.dtype == np.uint8 and image.shape == (1, 256, 256, 3)
    assert np.array_equal(image.values[0, 30, 30], [130, 135, 140])      # of the shading's file, between the markers
    assert image.values[0, 16, 16].max() < 0.3 * 140


def test_markers_of_the_image_are_found_where_the_reading_says_before_and_after(spec):
    surface = surface_of(spec, dent(spec), dent(spec, depth=1.0, aside=(0.4, -0.2)))
    images, markers = read(spec, "camera", surface), read(spec, "markers", surface)
    for image, px in zip(images.values, markers.values, strict=True):
        found = track(px, find_markers(image, radius_px=6.4).px, limit_px=3.0)
        assert not np.isnan(found).any()
        assert np.abs(found - px).max() < 0.3 and np.abs((found - px).mean(axis=0)).max() < 0.05


def test_a_slope_towards_the_red_light_is_redder(spec):
    """The shipped shading has red at azimuth 0: the dent's left side rises to the left, its right one faces it."""
    plain = gel_spec(markers="none")
    image = read(plain, "camera", surface_of(plain, dent(plain, depth=1.0))).values[0].astype(int)
    assert image[127, 127 + 32, 0] > 150 and image[127, 127 - 32, 0] < 110


def test_the_image_without_markers_is_brighter_only_where_they_were(spec):
    plain = gel_spec(markers="none")
    moved = dent(spec, depth=0.5)
    with_markers, without = (read(one, "camera", surface_of(one, moved)).values[0].astype(int) for one in (spec, plain))
    changed = (with_markers != without).any(axis=2)
    assert (without >= with_markers).all() and 0.05 < changed.mean() < 0.2


def test_a_background_image_is_taken_pixel_by_pixel(tmp_path):
    from PIL import Image

    picture = np.random.default_rng(1).integers(0, 255, (256, 256, 3), dtype=np.uint8)
    Image.fromarray(picture).save(tmp_path / "mine.png")
    mine = gel_spec(markers="none", background=str(tmp_path / "mine.png"))
    assert np.array_equal(read(mine, "camera", surface_of(mine, dent(mine))).values[0], picture)


def test_a_shading_with_lamps_darkens_the_gel_beside_a_dent_and_leaves_the_rest(tmp_path):
    from softtact.imaging.shading import Shading
    from softtact.imaging.shadows import Lamps

    plain = Shading.load("gelsight_mini")
    lamps = Lamps(np.zeros(3), np.full(3, 0.2), np.full(3, 0.1), np.array([0.4, 0.0, 0.0]))
    type(plain)(**vars(plain) | {"lamps": lamps}).save(tmp_path / "lit.yaml")
    plain.save(tmp_path / "plain.yaml")
    images = []
    for name in ("plain.yaml", "lit.yaml"):
        own = gel_spec(markers="none", shading=str(tmp_path / name), pixels=[256, 192])
        images.append(read(own, "camera", surface_of(own, dent(own, depth=1.5, width=2.0))).values[-1].astype(int))
    lost = images[0] - images[1]
    assert lost[..., 0].max() > 15 and not lost[..., 1:].any()
    assert (lost[..., 0] > 1).mean() < 0.3 and lost.min() >= 0


# --- depth ---


def test_the_depth_image_is_the_object_below_the_surface_at_rest(spec):
    """A flat punch 4 mm wide, 0.7 mm deep: the pixels under it are 0.7 mm deep, those beside it 0.

    Between the map's points the wall is a ramp: half way up, 0.35 mm deep, the punch is 4.125 mm wide.
    """
    x, y = np.meshgrid(spec.map_x_mm, spec.map_y_mm)
    under = (np.abs(x) < 2.05) & (np.abs(y) < 2.05)
    moved = dent(spec, depth=0.7)
    gap = np.where(under, -0.7 - moved[..., 2], np.inf)[None]
    depth = read(spec, "depth", surface_of(spec, moved, gap=gap))
    assert depth.shape == (1, 256, 256) and depth.attrs["units"] == "mm"
    assert depth.values[0, 127, 127] == pytest.approx(0.7, abs=1e-6)
    assert (depth.values[0, 127] > 0.35).sum() == pytest.approx(4.125 * 16 * 35 / 34.65, abs=1)     # to half way up
    assert depth.values[0, :20].max() == 0


def test_the_depth_ends_at_its_largest_value_and_grey_there_is_white(spec):
    gap = np.full((1, *spec.map_shape), -5.0)
    depth = read(spec, "depth", surface_of(spec, dent(spec), gap=gap)).values[0]
    assert depth.max() == 3.0 and depth.min() == 3.0
    assert np.array_equal(grey(np.array([0.0, 1.5, 3.0, 4.0, np.nan]), max_mm=3.0), [0, 128, 255, 255, 0])


def test_a_model_without_gap_gives_no_depth(spec):
    from dataclasses import replace

    surface = replace(surface_of(spec, dent(spec)), plane=None)
    assert np.isnan(read(spec, "depth", surface).values).all()


# --- a solid sensor ---


def test_a_solid_of_the_same_motion_shows_nearly_the_same_image_and_markers(spec):
    """Points scattered over a face, as a solid's facets have them."""
    surface = surface_of(spec, dent(spec, depth=0.8, aside=(0.3, 0.1)))
    places = np.random.default_rng(2).uniform(-11.9, 11.9, (20000, 2))
    bell = np.exp(-(places**2).sum(axis=1) / 9.0)
    rest = np.column_stack([places, np.zeros(len(places))])
    area = np.full(len(places), 24.0**2 / len(places))
    stub = SimpleNamespace(name="pad", has_layers=False, folder=spec.folder, stated_readouts=spec.stated_readouts)
    solid = SurfaceMotion(spec=stub, steps=1, pressure=lambda face: None,
                          displacement=lambda face: [Samples(rest, area, bell[:, None] * [0.3, 0.1, -0.8])])
    ours, layers = (read(spec, "markers", one).values for one in (solid, surface))
    assert np.abs(ours - layers).max() < 0.1
    difference = read(spec, "camera", solid).values.astype(int) - read(spec, "camera", surface).values
    assert np.abs(difference).mean() < 1.5


# --- refused ---


@pytest.mark.parametrize(("change", "sentence"), [
    ({"markers": {"rows": 9, "columns": 8, "pitch_px": 31.96, "first_px": [15.7, 16.5], "radius_mm": 0.4}},
     r"marker 65 of 72, at \(15.7, 272.2\) px, lies outside the image of 256 x 256 px"),
    ({"mm_per_px": 0.12}, r"marker 1 of 64, at .* mm, lies outside the gel of 24 x 24 mm"),
    ({"markers": {"rows": 8, "radius_mm": 0.4}}, "neither a grid nor a list; give rows, columns and pitch_mm, or points_px"),
    ({"markers": {"rows": 8, "columns": 8, "pitch_mm": 1.0, "pitch_px": 20, "radius_mm": 0.4}}, "two pitches"),
    ({"pixels": [320, 256], "markers": "none"}, "calibrated on images of 256 x 256 px, the camera has 320 x 256 px"),
    ({"shading": "no_such"}, "there is no such shading"),
    ({"axes": ["x", "-x"]}, "lie along one direction"),
    ({"distortion": [-9.0, 0, 0, 0, 0]}, "has no inverse in the image's corners"),
    ({"background": "no_such.png"}, "no_such.png: there is no such file")])
def test_a_camera_that_does_not_fit_is_refused_in_one_sentence_when_the_sensor_is_loaded(tmp_path, change, sentence):
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(gel_values(**change)))
    with pytest.raises(InputError, match=sentence) as refused:
        softtact.load_sensor(tmp_path / "mine.yaml")
    assert str(refused.value).startswith(str(tmp_path / "mine.yaml")) and str(refused.value).count(". ") <= 1


def test_a_shading_s_file_is_looked_for_beside_the_sensor_s_file_alone(tmp_path, monkeypatch):
    from softtact.imaging.shading import Shading

    for folder in ("sensor", "work"):
        (tmp_path / folder).mkdir()
    (tmp_path / "sensor" / "mine.yaml").write_text(yaml.safe_dump(gel_values(shading="lit.yaml")))
    monkeypatch.chdir(tmp_path / "work")
    Shading.load("gelsight_wonkdim").save("lit.yaml")
    with pytest.raises(InputError, match="sensor.lit.yaml: there is no such shading"):
        softtact.load_sensor(tmp_path / "sensor" / "mine.yaml")
    (tmp_path / "work" / "lit.yaml").rename(tmp_path / "sensor" / "lit.yaml")
    assert softtact.load_sensor(tmp_path / "sensor" / "mine.yaml")


def test_a_background_of_another_size_is_refused(tmp_path):
    from PIL import Image

    Image.new("RGB", (100, 80)).save(tmp_path / "small.png")
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(gel_values(background="small.png")))
    with pytest.raises(InputError, match="100 x 80 px and the camera 256 x 256"):
        softtact.load_sensor(tmp_path / "mine.yaml")


def test_markers_and_depth_need_a_camera(spec):
    lost = spec.model_copy(update={"readouts": {"markers": ReadoutEntry(kind="markers"), "depth": spec.readouts["depth"]}})
    for name in ("markers", "depth"):
        with pytest.raises(InputError, match="no readout 'camera' of the kind camera"):
            read(lost, name, surface_of(lost, dent(lost)))


@pytest.mark.parametrize("name", ["gelsight_mini", "gelsight_wonkdim", "digit"])
def test_the_shipped_gels_have_images_and_depths_of_their_cameras(name):
    sensor = softtact.load_sensor(name)
    entry = sensor.spec.stated_readouts["camera"].model_extra
    surface = surface_of(sensor.spec, dent(sensor.spec, depth=0.5))
    image = sensor.readouts["camera"].read(surface)
    assert image.shape == (1, entry["pixels"][1], entry["pixels"][0], 3)
    assert sensor.readouts["depth"].read(surface).shape == image.shape[:3]
