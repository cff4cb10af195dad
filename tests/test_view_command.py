"""`softtact view` and the VTU of a press: the pressed sensor in a page, in a picture and as ParaView reads it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
import xarray
from support.sensors import CORO

import softtact
from softtact.cli import main
from softtact.commands import view as view_command
from softtact.models.elastic.tangential import surface_compliance
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.press.vtu import LAYERS, of_bodies, of_map, read_vtu
from softtact.reporting.press_view import _draw_with_matplotlib, read_view, write_page

ROOT = Path(__file__).resolve().parents[1]
X, Y = np.linspace(-2, 2, 5), np.linspace(-3, 3, 7)
MAPS = np.stack([k * np.outer(np.hanning(7), np.hanning(5)) for k in (0.2, 0.5)])


@pytest.fixture
def press_nc(tmp_path):
    data = xarray.Dataset({"deformation_map_mm": (("step", "y", "x"), MAPS), "normal_force_n": ("step", [5.0, 20.0])},
                          coords={"x": X, "y": Y}, attrs={"thickness_mm": 2.5})
    data.to_netcdf(tmp_path / "press.nc", engine="h5netcdf")
    return tmp_path / "press.nc"


@pytest.fixture(scope="module")
def hyperelastic(tmp_path_factory):
    """A press on four frusta whose mesh was kept, as result and as VTU."""
    sensor = softtact.load_sensor("coro")
    spec = CORO.model_copy(update={"footprint_mm": (2.4, 2.4)})
    sensor = replace(sensor, spec=spec, mesh=MeshSettings.draft())
    ball = trimesh.creation.icosphere(subdivisions=3, radius=3.0)
    result = sensor.press(ball, force_n=[0.2, 0.5], model="hyperelastic", label="", threads=1, keep_body=True)
    path = tmp_path_factory.mktemp("press") / "press.vtu"
    result.write_vtu(path)
    return result, path


def test_paraview_reads_the_whole_mesh_with_displacements_and_the_pressure_of_the_force(hyperelastic):
    pyvista = pytest.importorskip("pyvista")
    result, path = hyperelastic
    mesh = pyvista.read(path)
    assert set(mesh.cell_data["layer"]) == {LAYERS[name] for name in ("frusta", "sheet", "cover", "pressed face")}
    sizes = mesh.compute_cell_sizes(length=False, area=True, volume=True).cell_data
    face = mesh.cell_data["layer"] == LAYERS["pressed face"]
    assert sizes["Volume"][~face].sum() > 2.4**2 * 2.0 and (sizes["Volume"][~face] > 0).all()
    pressed = (sizes["Area"] * mesh.cell_data["contact_pressure_mpa_0.5N"])[face].sum()
    assert pressed == pytest.approx(0.5, rel=0.05)     # under a ball the pressure is not quite vertical
    assert np.isnan(mesh.cell_data["contact_pressure_mpa_0.5N"][~face]).all()
    top = np.abs(mesh.points[:, 2]) < 1e-9
    deepest = -mesh.point_data["displacement_mm_0.5N"][top, 2].min()
    assert 0.95 * result.indentation_mm[1] < deepest < result.indentation_mm[1]     # no node lies under the ball's lowest point
    assert len(result.bodies) == 2


def test_cover_sheet_and_frusta_move_alike_where_they_meet(hyperelastic):
    mesh = of_bodies(hyperelastic[0].bodies, hyperelastic[0].normal_force_n)
    _, place = np.unique(np.round(mesh.points, 6), axis=0, return_inverse=True)
    most, least = (np.full((place.max() + 1, 3), start) for start in (-np.inf, np.inf))
    np.maximum.at(most, place.ravel(), mesh.displacement_mm[1])
    np.minimum.at(least, place.ravel(), mesh.displacement_mm[1])
    assert (np.bincount(place.ravel()) > 1).sum() > 4 * 25 + 4
    assert (most - least).max() < 1e-6 < 0.1 < np.abs(mesh.displacement_mm[1]).max()


def test_the_surface_of_the_whole_mesh_is_drawn_and_its_inside_is_not(hyperelastic):
    mesh = read_vtu(hyperelastic[1])
    points, triangles, used = mesh.surface()
    assert len(used) < 0.5 * len(mesh.points) and mesh.displacement_mm.shape == (2, len(mesh.points), 3)
    area = trimesh.triangles.area(points[triangles])[np.abs(points[triangles][..., 2]).max(axis=1) < 1e-9].sum()
    assert area == pytest.approx(2 * 2.4**2)     # the cover's top, and the pressed faces on it


def test_a_map_becomes_a_closed_block_whose_top_is_pressed():
    mesh = of_map(MAPS, X, Y, [5, 20], thickness_mm=2.5)
    points, triangles, used = mesh.surface()
    block = trimesh.Trimesh(points + mesh.displacement_mm[1][used], triangles)
    below = MAPS[1][1:-1, 1:-1].sum() * (X[1] - X[0]) * (Y[1] - Y[0])
    assert block.is_watertight and block.volume == pytest.approx(4 * 6 * 2.5 - below, rel=0.01)


@pytest.fixture(scope="module")
def beside(tmp_path_factory):
    """A ball that slides while it is pressed, kept with its result; and the folder of its files."""
    spec = CORO.model_copy(update={"footprint_mm": (7.2, 7.2), "map_shape": (13, 13)})
    sensor = softtact.Sensor(spec, {}, prepared_models={"elastic_surface": surface_compliance(spec)})
    result = sensor.press(trimesh.creation.icosphere(subdivisions=2, radius=3.0), pose=[0.5, 0, 7, 0, 0, 0], model="elastic",
                          motion=softtact.Motion().press(depth_mm=0.2).slide(x_mm=0.4), label="", keep_object=True)
    folder = tmp_path_factory.mktemp("beside")
    result.write(folder / "press.nc")
    result.write_vtu(folder / "press.vtu")
    return result, folder


def test_the_object_is_shown_where_it_stands_at_each_step(beside):
    for name in ("press.nc", "press.vtu"):
        view = read_view(beside[1] / name)
        at = view.points_mm[:, np.unique(view.object_triangles)]
        assert at[..., 2].min(axis=1) == pytest.approx([-0.2, -0.2], abs=1e-6), name
        assert at[..., 0].mean(axis=1) == pytest.approx([0.5, 0.9], abs=1e-5), name
        assert np.isnan(view.values[:, np.unique(view.object_triangles)]).all()
        assert np.isfinite(view.values[:, view.triangles]).all()


def test_the_object_comes_back_from_the_file_and_is_drawn_see_through(beside, tmp_path):
    result, folder = beside
    again = softtact.read_press(folder / "press.nc").placed_object
    assert np.array_equal(again.points_mm, result.placed_object.points_mm)
    assert np.array_equal(again.way_mm, result.placed_object.way_mm)
    view = read_view(folder / "press.nc")
    write_page(view, tmp_path / "p.html")
    assert f'"seeThrough": {len(again.triangles)}' in (tmp_path / "p.html").read_text()
    _draw_with_matplotlib(view, tmp_path / "with.png")
    _draw_with_matplotlib(replace(view, object_triangles=view.object_triangles[:0]), tmp_path / "without.png")
    assert (tmp_path / "with.png").read_bytes() != (tmp_path / "without.png").read_bytes()


def test_view_writes_a_page_and_a_picture_and_says_so_in_json(press_nc, tmp_path, capsys):
    page, picture = tmp_path / "p.html", tmp_path / "p.png"
    assert main(["view", str(press_nc), "--page", str(page), "--save", str(picture), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["page"] == str(page) and told["picture"] == str(picture) and not told["opened"]
    assert "20 N" in page.read_text() and picture.stat().st_size > 10_000


def test_view_opens_a_browser_where_there_is_one_and_draws_where_there_is_none(press_nc, tmp_path, monkeypatch, capsys):
    opened = []
    monkeypatch.chdir(tmp_path)
    browser = type("B", (), {"open": lambda self, url: opened.append(url) or True})()
    monkeypatch.setattr(view_command, "find_browser", lambda: browser)
    assert main(["view", str(press_nc)]) == 0 and "opened:" in capsys.readouterr().out
    assert opened[0].startswith("file://") and opened[0].endswith("press.html")
    monkeypatch.setattr(view_command, "find_browser", lambda: None)
    assert main(["view", str(press_nc)]) == 0
    assert "no browser" in capsys.readouterr().err and Path("press.nc.png").stat().st_size > 10_000


def test_without_pyvista_matplotlib_draws(press_nc, tmp_path):
    _draw_with_matplotlib(read_view(press_nc), tmp_path / "plain.png")
    assert (tmp_path / "plain.png").stat().st_size > 10_000


def test_what_is_no_press_is_refused(tmp_path, capsys):
    for name, content, said in [
        ("press.txt", b"1,2", "give the .nc or .vtu file"), ("press.csv", b"1,2\n", "as the maker's recorder writes it"),
        ("press.nc", b"x", "not a readable NetCDF"),
        ("press.vtu", b"<", "not readable as VTU"),
    ]:
        (tmp_path / name).write_bytes(content)
        assert main(["view", str(tmp_path / name), "--save", str(tmp_path / "p.png")]) == 1, name
        message = capsys.readouterr().err
        assert said in message and name in message and not (tmp_path / "p.png").exists(), name


def test_steps_of_one_force_stay_apart_and_in_their_order(tmp_path):
    """A slide under a load has one force at every step; arrays named by the force alone would overwrite each other."""
    of_map(np.stack([MAPS[1], MAPS[0]]), X, Y, [5, 5], thickness_mm=2.5).write(tmp_path / "slide.vtu")
    again = read_vtu(tmp_path / "slide.vtu")
    assert again.force_n.tolist() == [5, 5] and again.displacement_mm.shape[0] == 2
    assert -again.displacement_mm[0].min() == pytest.approx(MAPS[1].max()) and -again.displacement_mm[1].min() == pytest.approx(
        MAPS[0].max())
