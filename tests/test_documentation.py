"""What the README and the pages of docs/ say to type is typed: every `softtact` line and block of Python runs, on small data.

A block that cannot run here has `<!-- not run: reason -->` before it. Of other commands (make, snakemake, benchmarks) it is checked
that what they name is there.
"""

import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pandas as pd
import pytest
import torch
import trimesh
from simulated_recordings import HiddenConstants, simulate_recording, staircase_force

import softtact
from softtact.calibration.ladder import Presses
from softtact.cli import main
from softtact.fem.files.solids import write_mesh
from softtact.fem.structured_meshes import cylinder
from softtact.imaging.frames import Camera, render_frame
from softtact.learning.network import TactileNetwork, save_network
from softtact.materials.prony import PronySeries
from softtact.readout.tsf85 import write_recording

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"(?P<mark><!-- not run: [^>]+ -->\n\n?)?"
                   r"(?:^```(?P<kind>\w+)\n(?P<fenced>.*?)^```|(?P<indented>(?:^    [^\n]*\n)+))", re.MULTILINE | re.DOTALL)


def blocks(page):
    """(marked as not run, "python" or "shell", text) of each block of code."""
    for block in BLOCK.finditer(page.read_text(encoding="utf-8") + "\n"):
        marked = block["mark"] is not None
        if block["kind"] == "python":
            yield marked, "python", block["fenced"]
        elif block["kind"] in (None, "sh", "shell"):
            yield marked, "shell", block["fenced"] or block["indented"]


def python_blocks(*, run):
    """The blocks of each page as one program, for a later one goes on from an earlier one."""
    programs = {page.name: "\n".join(text for marked, kind, text in blocks(page) if kind == "python" and marked != run)
                for page in PAGES if page.name != "gallery.md"}     # tests/test_gallery.py draws what it shows
    return [pytest.param(text, id=name) for name, text in programs.items() if text]


def shell_lines(*, run):
    """Each line once."""
    found = dict.fromkeys(line.strip() for page in PAGES for marked, kind, text in blocks(page)
                          if kind == "shell" and marked != run
                          for line in text.splitlines() if line.strip().startswith("softtact "))
    return list(found)


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """A folder with the files that the pages speak of, all made up and small."""
    folder = tmp_path_factory.mktemp("desk")
    (folder / "config").symlink_to(ROOT / "config")
    part = trimesh.creation.box((8, 8, 4))
    part.export(folder / "part.stl")
    part.export(folder / "block.stl")
    softtact.load_sensor("coro").press(part, force_n=[5], model="elastic", threads=1).write(folder / "press.nc")
    stretch = np.linspace(1.02, 1.6, 12)
    curves = {"uniaxial": stretch - stretch**-2, "equibiaxial": stretch - stretch**-5, "planar": stretch - stretch**-3}
    curves |= {"tension": curves["uniaxial"], "shear": curves["planar"]}
    for name, shape in curves.items():
        table = np.column_stack([stretch, 0.35 * shape])
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header="stretch,nominal_stress_mpa", comments="")
    for name, shape in (("a", "tension"), ("b", "shear")):
        table = np.column_stack([100 * (stretch - 1), 350 * curves[shape]])
        np.savetxt(folder / f"{name}.csv", table, delimiter=",", header="Strain [%],Stress", comments="")
    table = np.column_stack([25 * (stretch - 1), 20 * 0.35 * curves["tension"]])
    np.savetxt(folder / "forces.csv", table, delimiter=",", header="Extension [mm],Force [N]", comments="")
    back = stretch[::-1][1:]
    cycles = np.column_stack([np.concatenate([stretch, back]), 0.35 * np.concatenate([curves["tension"], 0.7 * (back - back**-2)])])
    np.savetxt(folder / "cycles.csv", cycles, delimiter=",", header="stretch,nominal_stress_mpa", comments="")
    times, series = np.geomspace(0.01, 10, 15), PronySeries((0.3,), (0.5,))
    for name, header, values in (("relaxation", "time_s,force_n", [series.relaxation(times)]),
                                 ("dma", "frequency_hz,storage_modulus_mpa,loss_modulus_mpa", series.storage_loss(times))):
        np.savetxt(folder / f"{name}.csv", np.column_stack([times, *values]), delimiter=",", header=header, comments="")
    rows = [f"{x:.4f};{350 * y:.3f}" for x, y in zip(stretch, curves["tension"], strict=True)]
    machine = ["Test 7", "Operator: X", "Streckung;Spannung", "-;kPa", *(row.replace(".", ",") for row in rows)]
    (folder / "machine.csv").write_text("\n".join([*machine, ""]))
    table.T[:] = stretch, 0.35 * curves["tension"]
    with pd.ExcelWriter(folder / "machine.xlsx") as book:
        pd.DataFrame(table, columns=["stretch", "nominal_stress_mpa"]).to_excel(book, sheet_name="Test", index=False)
        pd.DataFrame({"operator": ["X"]}).to_excel(book, sheet_name="Notes")
    camera = Camera(pixel_mm=0.03, blur_mm=0.05, noise=0.02, falloff=0.2)
    frames = [render_frame([-0.8, 0.8], [0.2, -0.2], [area] * 2, camera, footprint_mm=(4.2, 3.0), seed=0) for area in (0.2, 0.4)]
    iio.imwrite(folder / "press.mp4", np.repeat(np.stack(frames)[..., None], 3, axis=3), plugin="pyav", codec="libx264", fps=2)
    (folder / "frames").mkdir()
    iio.imwrite(folder / "frames/0.png", frames[0])
    torch.manual_seed(0)
    network = TactileNetwork(map_shape=(57, 33), taxels=(7, 4), filters=(2, 2, 2), dense=4)
    for path in (folder / "model.pt", folder / "results/default/learning/elastic/model.pt"):
        path.parent.mkdir(parents=True, exist_ok=True)
        save_network(path, network, facts={"model": "elastic", "seed": 0, "source": "nothing: a test's"})
    np.save(folder / "map.npy", np.full((57, 33), 0.1))
    _record(folder)
    _body(folder)
    return folder


def _body(folder):
    """A coarse cylinder as a sensor of kind solid, in place of the fingertip on its page, and the ball."""
    write_mesh(cylinder(8.0, 12.0, (5, 3)), folder / "fingertip.vtu")
    (folder / "fingertip.yaml").write_text("""
name: fingertip
kind: solid
mesh: {file: fingertip.vtu}
regions: {body: {law: neo_hooke, parameters: {c10: 0.1}}}
faces: {skin: "z>0.01"}
held: {z0: xyz}
contact: {face: skin}
readings: {points_mm: [[0, 0, 12]], radius_mm: 2.0}
force_range_n: [0, 20]
""")
    trimesh.creation.icosphere(2, radius=5.0).export(folder / "ball.stl")


def _record(folder):
    """A recording of a plate on the paper's sensor, its object, and the log of its force."""
    plate, sensor = trimesh.creation.box((26, 41, 4)), softtact.load_sensor("coro")
    plate.export(folder / "plate.stl")
    time_s, force_n = staircase_force([10.0, 30.0], hold_s=0.5, rate_n_per_s=50.0)
    recording = simulate_recording(Presses(sensor, model="elastic"), plate, HiddenConstants.drawn(sensor, seed=0), time_s, force_n)
    write_recording(folder / "plate.csv", recording)
    np.savetxt(folder / "force.csv", np.column_stack([time_s, force_n]), delimiter=",", header="time_s,force_n", comments="")


@pytest.mark.slow
@pytest.mark.parametrize("text", python_blocks(run=True))
def test_python_on_a_page_runs_and_prints_or_leaves_a_press(text, desk, monkeypatch, capsys):
    monkeypatch.chdir(desk)
    names = {"__name__": "page"}
    exec(compile(text, "page", "exec"), names)
    assert capsys.readouterr().out or np.isfinite(names["result"].deformation_map_mm).all()


@pytest.mark.slow
def test_every_softtact_line_on_a_page_succeeds(desk, monkeypatch, capsys):
    monkeypatch.chdir(desk)
    for line in shell_lines(run=True):
        words = [word for word in shlex.split(line, comments=True)[1:] if word not in (">", ">>")]
        arguments = words[:-1] if " > " in line or " >> " in line else words
        assert main(arguments) == 0, line
        assert capsys.readouterr().out, line
        written = [] if "--cost" in words else re.findall(r"--(out|plot) (\S+)", line)     # costs are told, and nothing is written
        for option, name in written:
            assert (desk / name).stat().st_size > 0, (line, option)


def test_most_is_run_and_every_exception_has_a_reason():
    lines, code = shell_lines(run=True), python_blocks(run=True)
    left_out = shell_lines(run=False) + python_blocks(run=False)
    assert len(lines) >= 15 and len(code) >= 3 and len(left_out) < 0.5 * len(lines + code)


def test_what_a_page_links_or_tells_to_run_is_there():
    makefile = (ROOT / "Makefile").read_text()
    for variable, value in re.findall(r"^(\w+) = (.*)$", makefile, flags=re.MULTILINE):
        makefile = makefile.replace(f"$({variable})", value)
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text):
            assert target.startswith("http") or (page.parent / target).exists(), (page.name, target)
        named = r"(?<![\w/])(?:tests|config|benchmarks|workflow|examples|scripts)/[a-z0-9_/]+\.(?:yaml|py|sh|smk)"
        for name in re.findall(named, text):
            assert (ROOT / name).exists(), (page.name, name)
        for target in re.findall(r"^    make (\w+)", text, flags=re.MULTILINE):
            assert re.search(rf"^(?:[^\s:]+ )*{target}(?: [^\s:]+)*:", makefile, flags=re.MULTILINE), (page.name, target)


def test_the_numbers_in_the_pages_are_those_of_the_records():
    write_numbers = runpy.run_path(str(ROOT / "scripts/write_numbers.py"))
    page = write_numbers["NUMBERS"].read_text(encoding="utf-8")
    counts = {folder: int(number) for folder, number in re.findall(r"^\| ([a-z_()]+) \| (\d+) \|$", page, flags=re.MULTILINE)}
    assert len(counts) > 10 and page == write_numbers["numbers_page"](counts), "run: make numbers"
    pages = write_numbers["pages"]()
    assert "| fine | 20 |" in pages[write_numbers["PERFORMANCE"]] and "| plate over" in pages[write_numbers["EDGE"]]
    for path, text in pages.items():
        assert path.read_text(encoding="utf-8") == text, f"{path.name}; run: make numbers"


def test_packages_import_downwards_only_as_the_page_about_the_code_draws_them():
    page = (ROOT / "docs/explanation/code_layout.md").read_text(encoding="utf-8")
    picture = next(block for block in page.split("```") if " commands/ " in block)
    rows = [re.findall(r"\b([a-z]+)/(?=\s|$)", row, flags=re.MULTILINE) for row in re.split("─+", picture)]
    depth = {package: number for number, row in enumerate(rows) for package in row}
    source = ROOT / "src/softtact"
    packages = {path.parent.name for path in source.glob("*/__init__.py")}
    assert set(depth) == packages
    upwards = [f"{path.relative_to(source)} imports softtact.{name}" for path in source.glob("*/**/*.py")
               for name in re.findall(r"(?:from|import) softtact\.(\w+)", path.read_text(encoding="utf-8"))
               if name in packages and depth[name] < depth[path.relative_to(source).parts[0]]]
    assert not upwards


def test_the_page_about_costs_is_short():
    assert (ROOT / "docs/performance.md").stat().st_size <= 4096 and (ROOT / "README.md").stat().st_size <= 5120


@pytest.mark.slow
def test_the_site_builds_without_a_warning_and_loads_nothing_from_elsewhere(tmp_path):
    pytest.importorskip("myst_parser", reason="pip install -e '.[docs]'")
    folders = ["-d", str(tmp_path / "trees"), str(ROOT / "docs"), str(tmp_path / "site")]
    done = subprocess.run([sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", *folders],
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    pages = {path.stem: path.read_text(encoding="utf-8") for path in (tmp_path / "site").rglob("*.html")}
    assert pages["theory"].count("<math") > 50 and "softtact.press.sensor.load_sensor" in pages["api"]
    for name, page in pages.items():
        assert not re.search(r"""(?:src=|<link[^>]*href=)["']?(?:https?:)?//""", page), name
