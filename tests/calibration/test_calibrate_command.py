"""`softtact calibrate` and `softtact view` on recordings: what they write, say and refuse."""

import json

import numpy as np
import pytest
from support.calibration import BAR, PLATE, small_sensor_file

import softtact
from softtact.calibration.ladder import placed_at
from softtact.cli import main
from softtact.readout.taxels import relative_change
from softtact.readout.tsf85 import read_recording, write_recording


@pytest.fixture
def folder(bench, tmp_path, monkeypatch):
    """A folder with a recording of each of two presses, their objects, logs of the force, and the sensor."""
    for name, mesh, place in (("plate", PLATE, (0, 0, 0)), ("bar", BAR, (-0.8, -1.2, 0))):
        recording = bench.recording(mesh, place)
        write_recording(tmp_path / f"{name}.csv", recording)
        mesh.export(tmp_path / f"{name}.stl")
        log = np.column_stack([recording.time.values, recording.force_n.values[:, 0]])
        np.savetxt(tmp_path / f"{name}_force.csv", log, delimiter=",", header="time_s,force_n", comments="", fmt="%.6f")
        if name == "plate":
            late = np.column_stack([log[:, 0], np.interp(log[:, 0] - 0.3, *log.T)])
            np.savetxt(tmp_path / "late.csv", late, delimiter=",", header="time_s,force_n", comments="", fmt="%.6f")
    small_sensor_file(tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


OPTIONS = "--unit mm --sensor small.yaml --model elastic --fit none --out mine.yaml"
BOTH = f"calibrate plate.csv bar.csv --press plate.stl --press bar.stl --force plate_force.csv --force bar_force.csv {OPTIONS}"


def test_calibrate_writes_a_sensor_that_presses_and_a_page_with_its_residuals(folder, capsys):
    line = f"{BOTH} --place 0,0,0 --place=-0.8,-1.2,0 --report page.html --candidate bar.stl --json"
    assert main(line.split()) == 0
    told = json.loads(capsys.readouterr().out)
    assert np.shape(told["gain"]) == (7, 4) and len(told["next_press"]) == 5 and told["written"] == ["mine.yaml", "page.html"]
    assert told["not_identifiable"] == [] and not any("turned round" in note for note in told["notes"])
    sensor = softtact.load_sensor("mine.yaml")
    assert sensor.spec.calibration.counts_per_relative_change == pytest.approx(told["common_gain"], abs=1e-3)
    assert sensor.press(PLATE, force_n=[2.0], model="elastic", label="").tactile_map.max() > 50
    page = (folder / "page.html").read_text()
    assert page.count("data:image/png;base64,") == 3 and "Which press would help most" in page and "plate.csv; bar.csv" in page
    assert main([*line.replace("small.yaml", "mine.yaml").replace("--out mine", "--out again").split()]) == 1
    assert "is already calibrated" in capsys.readouterr().err and not (folder / "again.yaml").exists()


@pytest.mark.parametrize(("line", "sentence"), [
    (BOTH.replace("--press bar.stl", "--press bar.stl --press bar.stl"), "--press was given 3 times for 2 recordings"),
    (BOTH.replace("--fit none", "--fit friction"), "The elastic model is one layer and errs by more than friction changes"),
    (BOTH.replace("--fit none", "--fit gap"), "no unknown 'gap'"),
    (BOTH.replace("--fit none", "--fit cover"), "The elastic model is one layer and knows no cover"),
    (BOTH.replace("--force plate_force.csv --force bar_force.csv", "--force 2000"), "--force 2000: its largest force is 2000 N"),
    (BOTH.replace("--force plate_force.csv", "--force late.csv"), "late.csv: the counts of finger 0 follow its forces best when"),
    (BOTH + " --place 1,2", "--place 1,2: it is not three finite numbers"),
    (BOTH + " --place nan,0,0", "--place nan,0,0: it is not three finite numbers"),
    (BOTH + " --finger 1", "plate.csv: finger 1 changes by"),
    (BOTH, "bar.csv: the press explains"),     # the bar did not lie in the middle
    (BOTH.replace("mine.yaml", "small.yaml"), "--out small.yaml: it is the input"),
    (BOTH.replace("mine.yaml", "mine.txt"), "mine.txt: the file is written as .yaml or .yml"),
])
def test_what_cannot_be_calibrated_is_refused_and_nothing_is_written(folder, capsys, line, sentence):
    before = set(folder.iterdir())
    assert main(line.split()) == 1
    assert sentence in capsys.readouterr().err and set(folder.iterdir()) == before


@pytest.mark.slow
def test_calibrate_tells_how_far_the_hyperelastic_model_lies_from_the_calibrated_sensor(folder, capsys):
    line = (f"calibrate bar.csv --press bar.stl --force bar_force.csv --place=-0.8,-1.2,0 {OPTIONS} "
            "--hyperelastic-check --json")
    assert main(line.split()) == 0
    told = json.loads(capsys.readouterr().out)
    sensor, gain = softtact.load_sensor("small.yaml"), told["common_gain"] * np.array(told["gain"])
    presses = [sensor.press(placed_at(BAR, (-0.8, -1.2, 0)), pose=np.zeros(6), force_n=5.0, model=model, label="")
               for model in ("elastic", "hyperelastic")]
    apart = gain * np.subtract(*(relative_change(sensor.spec, one.deformation_map_mm[0]) for one in presses))
    assert told["hyperelastic_difference_counts"] == [pytest.approx(np.sqrt(np.mean(apart**2)), rel=1e-3)]
    assert told["hyperelastic_difference_counts"][0] > 100      # the elastic model is of the surface, not of the electrodes' plane


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bar.png", "bar.gif", "bar.mp4"])
def test_view_plays_a_recording(folder, capsys, name):
    iio = pytest.importorskip("imageio.v3")
    recording = read_recording("bar.csv")
    write_recording("short.csv", recording.isel(time=slice(40, 90)))
    assert main(["view", "short.csv", "--force-log", "bar_force.csv", "--save", name, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["picture"] == name and told["findings"] == [] and told["readings"] == 50
    frames = iio.imread(folder / name) if name != "bar.mp4" else iio.imread(folder / name, plugin="pyav")
    assert frames.std() > 5
    if name != "bar.png":
        assert len(frames) == int(20 * told["seconds"])
        assert np.abs(frames[-1].astype(int) - frames[0].astype(int)).max() > 50


@pytest.mark.parametrize(("line", "sentence"), [
    ("view bar.csv --page p.html", "--page p.html: a recording is drawn as .png, .gif or .mp4"),
    ("view bar.csv --save p.svg", "p.svg: the file is written as .png or .gif or .mp4"),
    ("view press.nc --force-log bar_force.csv --save p.png", "--force-log, --baseline and --topic have an effect only on a rec"),
    ("view plate.stl.csv --save p.png", "plate.stl.csv: there is no such file"),
])
def test_view_refuses_what_it_cannot_play(folder, capsys, line, sentence):
    assert main(line.split()) == 1
    assert sentence in capsys.readouterr().err and not list(folder.glob("p.*"))
