"""What a choice of model costs, and what error it accepts, held against the fine mesh: `python benchmarks/choice.py`, a minute.

The hyperelastic maps and times are those that `objects.py --mesh fine` left, of indenters and of the paper's objects; the fast
models are pressed here. The error to expect is calibrated on the indenters and tested on the objects; the constants of
`softtact.press.choice.FoundationError` are not of this run but of `expected_error.py`. Prints the tables of
docs/explanation/fast_models.md, draws docs/policies.png, writes benchmarks/results/choice.json.
"""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import record
from objects import CONFIG, MAPS

import softtact
from softtact.evaluation.policies import MODELS, expected_over_true, policy_table, press_table
from softtact.geometry.complexity import choose_model, score
from softtact.geometry.meshes import place, read_mesh
from softtact.reporting.style import save
from softtact.sensors.fields import Edge
from softtact.studies.hybrid.figures.fig8_policies import draw

MESH, FAST = "fine", MODELS[:2]
TOLERANCES_MM = [0.003, 0.006, 0.008, 0.02, 0.04, 0.08]
SETS = {"indenters": "indenters", "grasped": "grasps", "unseen": "unseen"}     # of folders; the last is in neither fit nor test
FIGURE = Path(__file__).resolve().parents[1] / "docs/policies.png"


def presses_of(sensor, name, processor_s):
    """{model: data set} of one object, the hyperelastic model's with the maps of the fine mesh and its time."""
    file = next((CONFIG / "objects").glob(f"*/{name}.stl"))
    mesh = read_mesh(file, unit="mm")
    with np.load(MAPS / MESH / f"{name}.npz") as kept:
        forces, maps = kept["force_n"], kept["map_mm"].astype(float)
    found = {model: sensor.press(mesh, force_n=forces, model=model, label="", threads=1).to_dataset() for model in FAST}
    found["hyperelastic"] = found["foundation"].copy(deep=True)
    found["hyperelastic"].deformation_map_mm.values[:] = maps
    found["hyperelastic"].wall_time_s.values[:] = processor_s / len(forces)
    return {model: data.assign_attrs(set=SETS[file.parent.name], item=name) for model, data in found.items()}


def paper_choice(sensor, name):
    """The model that the paper's count of mesh points takes."""
    placed = place(read_mesh(next((CONFIG / "objects").glob(f"*/{name}.stl")), unit="mm"), pose=None)
    counts = score(placed.triangles, footprint_mm=sensor.spec.footprint_mm, reach_mm=sensor.spec.thickness_mm)
    return choose_model(counts.NPt, counts.CHt, counts.NPo, counts.CHo)


def main():
    """Press, calibrate, compare, and write."""
    coro = softtact.load_sensor("coro")      # with the sides that the kept maps were pressed with
    sensor = replace(coro, spec=coro.spec.model_copy(update={"edge": Edge(held="sides")}))
    rows = record.read("objects")["rows"]
    seconds = {row["object"]: row["processor_s"] for row in rows if row["mesh"] == MESH}
    names = sorted(path.stem for path in (MAPS / MESH).glob("*.npz"))
    presses_of(sensor, names[0], 0.0)     # compiled, loaded
    table, calibrated = press_table([presses_of(sensor, name, seconds[name]) for name in names],
                                    {name: paper_choice(sensor, name) for name in names},
                                    height_mm=sensor.spec.dielectric.frusta.height_mm)
    policies = policy_table(table, TOLERANCES_MM, sets=["grasps"])
    unseen = table[table.set == "grasps"]
    ratios = {model: {key: float(value) for key, value in expected_over_true(unseen, model).items()} for model in FAST}
    print(table.to_string(), policies.to_string(), calibrated, ratios, sep="\n\n")
    save(draw(policies, table), FIGURE, FIGURE.with_suffix(".svg"))
    FIGURE.with_suffix(".svg").unlink()
    print(record.write("choice", against=MESH, calibrated=asdict(calibrated), told_over_true=ratios, presses=rows_of(table),
                       policies=rows_of(policies)))


def rows_of(table):
    """A data frame as JSON takes it, with null where there is no number."""
    return json.loads(table.to_json(orient="records"))


if __name__ == "__main__":
    main()
