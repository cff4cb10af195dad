"""Figure 8: error against time of the policies that choose a model, and expected against true error."""

from typing import TYPE_CHECKING

import numpy as np

from softtact.evaluation.policies import CHANCE
from softtact.reporting.style import MODEL_COLOURS, pyplot

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

CALIBRATION_SET = "indenters"
_BELOW = {"xytext": (0, -8), "ha": "center", "va": "top"}
_ABOVE = {"xytext": (5, 5), "ha": "left", "va": "bottom"}
# For each kind of policy: mark, colour, meaning and position of its texts, below or above so that near ones do not overlap.
_KINDS = {"always": ("s", "0.45", "always the same model", _BELOW), "paper": ("D", "#b22222", "the paper's rule", _ABOVE),
          "random": ("X", "#8a5a9e", "a random choice of the rule's share", _ABOVE),
          "error": ("o", "#1f7a4d", "by expected error, tolerance of", _ABOVE)}


def draw(policies: "pd.DataFrame", presses: "pd.DataFrame") -> "Figure":
    """Figure from the tables of `compare_policies`: policies on presses outside the calibration, and a row per press."""
    plt = pyplot()
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 4.4), layout="constrained")
    _draw_policies(left, policies)
    _draw_expected(right, presses)
    return figure


def _draw_policies(axes, policies):
    highest = 1e3 * policies.mean_error_mm.max()
    for kind, (mark, colour, meaning, beside) in _KINDS.items():
        rows = policies[policies.policy.str.startswith(kind)]
        axes.plot(rows.time_per_press_s, 1e3 * rows.mean_error_mm, mark, ms=6, color=colour, ls="-" if kind == "error" else "none",
                  label=meaning)
        for place, names in _places(rows, width=0.05 * highest).items():
            axes.annotate(names, place, **beside, textcoords="offset points", fontsize=8, color=colour)
    axes.set(xscale="log", xlabel="time per press, s", ylabel="mean error of the maps, um", ylim=(-0.1 * highest, 1.45 * highest),
             title=f"{policies.presses.iloc[0]} presses that were not calibrated on")
    axes.margins(x=0.2)
    axes.legend(frameon=False, fontsize=8, loc="upper right")


def _places(policies, *, width):
    """{(time, error in um): text} of policies of one kind; overlapping texts are joined."""
    places = {}
    for _, row in policies.sort_values("mean_error_mm").iterrows():
        time, error = row.time_per_press_s, 1e3 * row.mean_error_mm
        here = next((place for place in places if abs(np.log(place[0] / time)) < 0.7 and abs(place[1] - error) < width), None)
        places.setdefault(here or (time, error), []).append(row.policy)
    return {place: _in_short(names) for place, names in places.items()}


def _in_short(names):
    """Short text for policies of one kind: a model, or tolerances in rising order."""
    if names[0] == CHANCE:
        return "random"
    if not names[0].startswith("error"):
        return ", ".join(name.removeprefix("always ") for name in names if name != "paper")
    return ", ".join(f"{tolerance:g}" for tolerance in sorted(float(name.split()[1]) for name in names)) + " um"


def _draw_expected(axes, presses):
    from matplotlib.ticker import LogLocator, NullFormatter

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
    for axis in (axes.xaxis, axes.yaxis):     # by default 2 to 9 all have texts, which overlap
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    axes.legend(frameon=False, fontsize=8, loc="upper left")
