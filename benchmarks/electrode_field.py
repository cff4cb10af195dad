"""What the gap formula and the assumed edges leave out: `python benchmarks/electrode_field.py` from the project's folder.

Maps of the foundation model are read three ways: by the gap alone (ideal counts), by the virtual sensor's electrodes with their
assumed edges and coupling, and by finite elements of the field around the whole grid (`tests/readout/naive_grid.py`), once with all
electrodes driven together and once one by one with their neighbours grounded. Counts as the default study's (2600 for dC / C0 = 1).
Writes benchmarks/results/electrode_field.json; some minutes.
"""

import sys
from pathlib import Path

import numpy as np
import record
import trimesh

import softtact
from softtact.geometry.meshes import read_mesh
from softtact.readout.capacitance import equivalent_air_gap, ideal_counts
from softtact.readout.electrodes import edge_excess, electrode_sides
from softtact.readout.virtual_sensor import VirtualSensorSettings, read_branches

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "readout"))
from naive_grid import EPSILON_0_PF_PER_MM, Fineness, GridField

GAIN = 2600.0
OBJECTS = {"circle_m, middle": (None, (0, 0, 0, 0, 0, 0), [10.0, 50.0]),
           "ball R 8, corner": (trimesh.creation.icosphere(subdivisions=4, radius=8.0), (6.0, 12.0, 0, 0, 0, 0), [2.0, 5.0]),
           "box 30 x 8, across the rim": (trimesh.creation.box((30.0, 8.0, 6.0)), (0, 5.0, 0, 0, 0, 0), [10.0, 50.0])}


def by_virtual_electrodes(spec, maps, forces):
    """Counts (force, rows, columns) with the electrodes' assumed edges and coupling, and nothing else of the virtual sensor."""
    default = VirtualSensorSettings()
    settings = VirtualSensorSettings.ideal(counts_per_relative_change=GAIN, **{name: getattr(default, name) for name in (
        "electrode_spacing_mm", "outer_fringe", "inner_fringe", "coupling")})
    return read_branches(spec, maps, force_n=forces, trials=1, seed=0, item="", settings=settings).loading[0]


def by_field(spec, maps, rest):
    """Counts (2, force, rows, columns): electrodes driven together, and alone."""
    out = []
    for deformation in maps:
        pressed = GridField(spec, deformation)
        out.append([GAIN * (now / before - 1) for now, before in ((pressed.driven_together, rest.driven_together),
                                                                  (pressed.driven_alone, rest.driven_alone))])
    return np.swapaxes(out, 0, 1)


def differences(one, other):
    """Root mean square and largest difference in counts, the best common gain of `other`, and the rms that it leaves."""
    gain = float((one * other).sum() / (other**2).sum())
    apart, left = one - other, one - gain * other
    return {"rms_counts": round(float(np.sqrt(np.mean(apart**2))), 1), "largest_counts": round(float(np.abs(apart).max()), 1),
            "gain": round(gain, 4), "rms_counts_left": round(float(np.sqrt(np.mean(left**2))) / gain, 1)}


def at_rest(spec, rest):
    """Capacitances (pF) of a corner's, a side's and an inner electrode; shares of a free edge that inner and outer edges have."""
    together, gap = rest.driven_together, float(equivalent_air_gap(spec, 0.0))
    sides = np.array(electrode_sides(spec, spacing_mm=0.3))
    factor = together / (EPSILON_0_PF_PER_MM * sides.prod() / gap)
    excess = edge_excess(sides, gap)
    inner = (factor[3, 1] - 1) / excess.sum()
    outer = 2 * (factor[3, 0] - 1 - inner * (excess.sum() - excess[0] / 2)) / excess[0]
    return {"corner_side_inner_pf": [round(float(together[k]), 4) for k in ((0, 0), (3, 0), (3, 1))],
            "over_plates": [round(float(factor[k]), 4) for k in ((0, 0), (3, 0), (3, 1))],
            "share_of_a_free_edge": {"inner": round(float(inner), 3), "outer": round(float(outer), 3)},
            "neighbours_share": [round(float(-rest.maxwell[13, k] / rest.maxwell[13, 13]), 4) for k in (12, 9, 8)]}


def main():
    """Press, read, compare, write."""
    sensor = softtact.load_sensor("coro")
    spec, rest, rows = sensor.spec, GridField(sensor.spec, np.zeros(sensor.spec.map_shape)), []
    for name, (mesh, pose, forces) in OBJECTS.items():
        mesh = read_mesh("config/objects/indenters/circle_m.stl", unit="mm") if mesh is None else mesh
        maps = sensor.press(mesh, pose=pose, force_n=forces, model="foundation").deformation_map_mm
        plain = ideal_counts(spec.model_copy(update={"largest_counts": np.inf}), maps, counts_per_relative_change=GAIN)
        assumed, (together, alone) = by_virtual_electrodes(spec, maps, forces), by_field(spec, maps, rest)
        for k, force in enumerate(forces):
            row = {"object": name, "force_n": force, "largest": round(float(together[k].max()), 1)}
            for label, counts in (("gap", plain), ("assumed", assumed), ("alone", alone)):
                row[label] = differences(counts[k], together[k])
            rows.append(row)
            print(row, flush=True)
    coarser = GridField(spec, np.zeros(spec.map_shape), fineness=Fineness().finer(2 / 3))
    mesh_error = float(np.abs(coarser.driven_together / rest.driven_together - 1).max())
    print(record.write("electrode_field", gain=GAIN, rest=at_rest(spec, rest), mesh_error=round(mesh_error, 5), rows=rows))


if __name__ == "__main__":
    main()
