"""Figure 8: error against time of the policies that choose a model, and the error that was expected against the true one."""

import numpy as np

from softtact.reporting.style import MODEL_COLOURS, pyplot

CALIBRATION_SET = "indenters"
_MARKS = {"always": "s", "paper": "D", "error": "o"}


def draw(policies, presses):
    """Figure of the tables of `compare_policies`: policies over the presses that were not calibrated on, and a row per press."""
    plt = pyplot()
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 4.4), layout="constrained")
    _draw_policies(left, policies)
    _draw_expected(right, presses)
    return figure


def _draw_policies(axes, policies):
    for kind, mark in _MARKS.items():
        rows = policies[policies.policy.str.startswith(kind)]
        axes.plot(rows.time_per_press_s, 1e3 * rows.mean_error_mm.clip(lower=1e-5), mark, ms=6,
                  color={"always": "0.55", "paper": "#b22222", "error": "#1f7a4d"}[kind], ls="-" if kind == "error" else "none")
    axes.set(xscale="log", xlabel="time per press, s", ylabel="mean error of the maps, um", ylim=(0, None),
             title=f"{policies.presses.iloc[0]} presses that were not calibrated on")
    axes.margins(x=0.35, y=0.1)
    for (time, error), names in _places(policies, width=0.05 * 1e3 * policies.mean_error_mm.max()).items():
        axes.annotate("\n".join(names), (time, error), xytext=(8, 2), textcoords="offset points", fontsize=8)


def _places(policies, *, width):
    """{(time, error in um): names} of the policies, those that would print over each other at one place."""
    places = {}
    for _, row in policies.sort_values("mean_error_mm").iterrows():
        time, error = row.time_per_press_s, 1e3 * row.mean_error_mm
        here = next((place for place in places if abs(np.log(place[0] / time)) < 0.7 and abs(place[1] - error) < width), None)
        places.setdefault(here or (time, error), []).append(row.policy)
    return places


def _draw_expected(axes, presses):
    for model in ("elastic", "foundation"):
        for calibrated, rows in presses.groupby(presses.set == CALIBRATION_SET):
            axes.scatter(1e3 * rows[f"{model}_error_mm"], 1e3 * rows[f"{model}_expected_mm"], s=22, edgecolors=MODEL_COLOURS[model],
                         facecolors="none" if calibrated else MODEL_COLOURS[model],
                         label=f"{model}, {'calibrated on' if calibrated else 'not seen'}")
    low, high = 0.8 * min(axes.get_xlim()[0], axes.get_ylim()[0]), 1.25 * max(axes.get_xlim()[1], axes.get_ylim()[1])
    low = max(low, 0.5)
    axes.plot([low, high], [low, high], color="0.6", lw=0.8)
    axes.set(xscale="log", yscale="log", xlim=(low, high), ylim=(low, high), aspect="equal",
             xlabel="true error of a press, um", ylabel="expected error, um")
    axes.legend(frameon=False, fontsize=8, loc="upper left")
