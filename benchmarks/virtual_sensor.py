"""What each effect of the virtual sensor is worth: `python benchmarks/virtual_sensor.py` from the project's folder.

Writes docs/virtual_sensor.png and benchmarks/results/virtual_sensor.json in half a minute: circle_m is pressed by the elastic
model, 20 load steps to 50 N.
"""

import numpy as np
import record

import softtact
from softtact.geometry.meshes import read_mesh
from softtact.readout.capacitance import capacitance_per_area, ideal_counts
from softtact.readout.virtual_sensor import VirtualSensorSettings, read_branches
from softtact.reporting.style import pyplot, save

FORCES = np.arange(2.5, 51.0, 2.5)
OBJECT, SEED, TRIALS, TAXEL = "circle_m", 20250, 5, (3, 1)
EFFECTS = {"electrodes apart": ["electrode_spacing_mm"], "outer edges": ["outer_fringe"], "inner edges": ["inner_fringe"],
           "coupling": ["coupling"], "sheet's thickness": ["sheet_scatter"],
           "creep": ["relaxation", "relaxation_s", "cycles_before", "rest_s"], "placement": ["placement_mm"],
           "force": ["force_scatter"], "gain": ["gain_scatter"], "zero": ["offset_counts"], "gain's drift": ["drift"],
           "zero's drift": ["drift_counts"], "noise": ["noise_counts"], "steps": ["step_counts"]}


def readings(press, settings):
    """`Branches` of the press with the default specimen."""
    spec, maps = press
    return read_branches(spec, maps, force_n=FORCES, trials=TRIALS, seed=SEED, item=OBJECT, settings=settings)


def alone(press, names):
    """Root mean square and largest change of the counts at the highest force by the effects `names` at their defaults."""
    default = VirtualSensorSettings()
    changed = readings(press, VirtualSensorSettings.ideal(**{name: getattr(default, name) for name in names}))
    change = changed.loading[:, -1] - readings(press, VirtualSensorSettings.ideal()).loading[:, -1]
    return {"rms_counts": round(float(np.sqrt(np.mean(change**2))), 2), "largest_counts": round(float(np.abs(change).max()), 1)}


def loop(press, **changes):
    """Counts (2 branches, force) of one taxel with the lag alone, the way up first."""
    default = VirtualSensorSettings()
    lag = {name: getattr(default, name) for name in (*EFFECTS["creep"], "rate_n_per_s", "level_s")}
    both = readings(press, VirtualSensorSettings.ideal(**lag | changes))
    return np.stack([both.loading[0][:, *TAXEL], both.unloading[0][:, *TAXEL]])


def draw(press, effects):
    """The figure of four panels."""
    figure, axes = pyplot().subplots(2, 2, figsize=(9.6, 7.4), layout="constrained")
    _draw_capacitance(axes[0, 0], press[0])
    _draw_loops(axes[0, 1], press)
    _draw_effects(axes[1, 0], effects)
    _draw_trials(axes[1, 1], press)
    for axis, letter in zip(axes.flat, "abcd", strict=True):
        axis.set_title(f"{letter}  {axis.get_title()}", loc="left", fontsize=9)
        axis.set_title("")
    save(figure, "docs/virtual_sensor.png")


def _draw_capacitance(axis, spec):
    moved, pocket = np.linspace(0, 0.5, 201), 0.271
    change = capacitance_per_area(spec, moved) / capacitance_per_area(spec, 0.0) - 1
    axis.plot(moved, change, "k-", label="air and solid side by side, slices in series")
    axis.plot(moved, 1 / (1 - moved / spec.dielectric_thickness_mm) - 1, "--", color="0.5", label="plates with one permittivity")
    axis.axvline(pocket, ymax=0.8, color="0.7", lw=0.8)
    axis.text(pocket + 0.006, 0.03, "no air left", color="0.35")
    axis.set(xlabel="electrode plane towards the PCB (mm)", ylabel="dC / C0", title="one place of the dielectric")
    axis.legend(frameon=False)


def _draw_loops(axis, press):
    ideal = ideal_counts(*press)[:, *TAXEL]
    for colour, marker, rate in (("#1f4e79", "o", 10.0), ("#e08214", "s", 1.0)):
        up, down = loop(press, rate_n_per_s=rate) - ideal
        axis.plot(FORCES, up, "-", color=colour, marker=marker, ms=3.5, label=f"{rate:g} N/s, up")
        axis.plot(FORCES, down, "--", color=colour, marker=marker, ms=3.5, mfc="white", label=f"{rate:g} N/s, down")
    axis.axhline(0, color="0.6", lw=0.8)
    axis.set(xlabel="force (N)", ylabel="counts above those without creep",
             title=f"loop by creep alone, row {TAXEL[0]}, column {TAXEL[1]}")
    axis.legend(frameon=False, ncols=2, loc="lower left")
    axis.set_ylim(-75, 45)


def _draw_effects(axis, effects):
    place = np.arange(len(effects))[::-1]
    axis.barh(place, [effect["rms_counts"] for effect in effects.values()], color="#9db8d2", edgecolor="0.3", lw=0.6,
              label="root mean square, 28 taxels")
    axis.plot([effect["largest_counts"] for effect in effects.values()], place, "k|", ms=8, label="largest")
    axis.set_yticks(place, effects)
    axis.set(xlabel=f"change at {FORCES[-1]:g} N (counts), each effect alone", title="effects at their defaults")
    axis.legend(frameon=False, loc="lower right")


def _draw_trials(axis, press):
    every = readings(press, VirtualSensorSettings())
    for trial in every.loading[:5]:
        up, = axis.plot(FORCES, trial[:, *TAXEL], "-", color="#1f4e79", lw=0.8)
    for trial in every.unloading[:5]:
        down, = axis.plot(FORCES, trial[:, *TAXEL], "--", color="#e08214", lw=0.8)
    ideal, = axis.plot(FORCES, ideal_counts(*press)[:, *TAXEL], "k:")
    axis.set(xlabel="force (N)", ylabel="counts", title="all effects, five trials of one specimen")
    axis.legend([up, down, ideal], ["up", "down", "ideal counts"], frameon=False)


def main():
    """Press, measure, draw, and write the record."""
    sensor = softtact.load_sensor("coro")
    mesh = read_mesh(f"config/objects/indenters/{OBJECT}.stl", unit="mm")
    press = sensor.spec, sensor.press(mesh, force_n=FORCES, model="elastic").deformation_map_mm
    effects = {name: alone(press, names) for name, names in EFFECTS.items()}
    width = {}
    for rate in (1.0, 10.0, 100.0):
        up, down = loop(press, rate_n_per_s=rate)
        width[f"{rate:g} N/s"] = round(float((down - up).max() / up.max()), 4)
    every = readings(press, VirtualSensorSettings()).loading[:, -1]
    summary = {"ideal_largest_counts": round(float(ideal_counts(*press).max())), "loop_width_of_largest": width,
               "sd_over_trials_counts": round(float(every.std(axis=0, ddof=1).mean()), 1)}
    draw(press, effects)
    path = record.write("virtual_sensor", object=OBJECT, model="elastic", trials=TRIALS, effects_at_50_n=effects, **summary)
    print(*(f"{name}: {effect}" for name, effect in effects.items()), summary, f"written: {path}", sep="\n")


if __name__ == "__main__":
    main()
