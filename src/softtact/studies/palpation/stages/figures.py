"""Figures of a palpation sensor: mesh and deformed shape, the paper's curves, hardness, hidden lumps.

Inputs `sweeps` are a list of NetCDF; outputs of each are png and svg.
"""

from typing import Any

import matplotlib.tri as mtri
import numpy as np
from matplotlib.ticker import LogLocator, NullFormatter

from softtact.fem.solid_mesh import SolidMesh
from softtact.files import read_csv, read_dataset
from softtact.probe.design import PalpationDesign
from softtact.probe.structure import structure_mesh
from softtact.probe.sweep import Palpation, verdict
from softtact.reporting.style import pyplot, save

_COLOURS = ("#1f4e79", "#e08214", "#3f9c6d", "#8a3a8f", "#555555")
_GRID = [(0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (3, 4, 7), (3, 7, 6), (4, 5, 8), (4, 8, 7)]     # triangles of 3 x 3 nodes


def _words(name: str) -> str:
    """A tissue's name for readers."""
    return name.replace("_", " ").replace("00 ", "00-").title()


def _plane_triangles(mesh: SolidMesh) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (t, 3) of all elements (of a solid: in the section z = 0), and the four corners (e, 4) of each element."""
    triangles, corners = [], []
    for _, element, nodes in mesh.parts():
        local = element.nodes
        if local.shape[1] == 3:
            front = np.abs(mesh.points[nodes][..., 2]).min(axis=1) < 1e-9
            nodes, local = nodes[front][:, local[:, 2] < -0.5], local[local[:, 2] < -0.5, :2]
        order = np.lexsort((local[:, 0], local[:, 1]))       # rows of rising y, each of rising x
        grid = nodes[:, order]
        triangles.append(grid[:, np.array(_GRID)].reshape(-1, 3))
        corners.append(grid[:, [0, 2, 8, 6]])
    return np.concatenate(triangles), np.concatenate(corners)


def draw_shapes(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Figure 2: the mesh at rest, and deformed at the last displacement of the jaw, coloured by the vertical displacement.

    inputs: sweeps of the displacement;  settings: design
    """
    plt, sweeps, rest = pyplot(), _sweeps(inputs), structure_mesh(PalpationDesign.model_validate(settings["design"]))
    figure, axes = plt.subplots(len(sweeps) + 1, 1, figsize=(7.5, 2.0 * (len(sweeps) + 1)), sharex=True, layout="constrained")
    _draw_mesh(axes[0], rest, rest.points)
    _shade_regions(axes[0], rest)
    axes[0].set_title("At rest, with the elements")
    low = min(sweep.displacement_mm[:, 1].min() for sweep in sweeps)
    for ax, sweep in zip(axes[1:], sweeps, strict=True):
        points = rest.points + sweep.displacement_mm
        triangles, _ = _plane_triangles(rest)
        image = ax.tripcolor(mtri.Triangulation(points[:, 0], points[:, 1], triangles), sweep.displacement_mm[:, 1],
                             shading="gouraud", vmin=low, vmax=0, cmap="viridis")
        _draw_mesh(ax, rest, points, width=0.2)
        ax.set_title(f"{_words(sweep.tissue)}: jaw {sweep.jaw_mm[-1]:.3g} mm, {sweep.force_n[-1]:.3g} N, beam "
                     f"{sweep.beam_deflection_mm[-1]:.3f} mm")
    figure.colorbar(image, ax=axes[1:], label="vertical displacement, mm", shrink=0.8)
    axes[-1].set_xlabel("x, mm")
    save(figure, *outputs.values())


def _draw_mesh(ax, mesh, points, width=0.4):
    from matplotlib.collections import PolyCollection

    _, corners = _plane_triangles(mesh)
    ax.add_collection(PolyCollection(points[corners][..., :2], facecolors="none", edgecolors="0.25", linewidths=width))
    ax.autoscale_view()
    ax.set_aspect("equal")
    ax.set_ylabel("y, mm")


def _shade_regions(ax, mesh):
    from matplotlib.collections import PolyCollection

    shades = {"tissue": "#f3d9c9", "beam": "#7f7f7f", "filler": "#cfe2f3", "lump": "#b34a4a"}
    for region, element, nodes in mesh.parts():
        part = SolidMesh(mesh.points, ((region, element.meshio_name, nodes),), geometry=mesh.geometry)
        _, corners = _plane_triangles(part)
        ax.add_collection(PolyCollection(mesh.points[corners][..., :2], facecolors=shades.get(region, "#d9d9d9"), zorder=0))


def draw_curves(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Figures 3 and 4: deflection under rising load, and force against deflection for a displaced jaw, with trend lines.

    inputs: sweeps, slopes (CSV)
    """
    plt, sweeps, slopes = pyplot(), _sweeps(inputs), read_csv(inputs["slopes"])
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    tissues = list(dict.fromkeys(sweep.tissue for sweep in sweeps))
    for sweep in sweeps:
        number = tissues.index(sweep.tissue)
        colour, marker = _COLOURS[number % len(_COLOURS)], "os^v"[number % 4]
        if sweep.scenario == "load":
            left.plot(sweep.force_n, sweep.beam_deflection_mm, marker, ms=4, mfc="none", color=colour, label=_words(sweep.tissue))
            continue
        fit = slopes[(slopes.tissue == sweep.tissue) & (slopes.scenario == sweep.scenario)].iloc[0]
        right.plot(sweep.beam_deflection_mm, sweep.force_n, marker, ms=4, mfc="none", color=colour,
                   label=f"{_words(sweep.tissue)}: {fit.line_n_mm:.1f} N/mm, at rest {fit.initial_n_mm:.1f}")
        ends = np.array([0.0, sweep.beam_deflection_mm[-1]])
        right.plot(ends, fit.intercept_n + fit.line_n_mm * ends, "-", lw=0.8, color=colour)
    left.set(xlabel="load on the jaw, N", ylabel="deflection of the beam's middle, mm", title="Load (the paper's figure 3)")
    right.set(xlabel="deflection of the beam's middle, mm", ylabel="force on the jaw, N",
              title="Jaw moved (the paper's figure 4)")
    for ax in (left, right):
        ax.legend(frameon=False, fontsize=8)
        ax.set_xlim(left=0)
        ax.set_ylim(bottom=0)
    save(figure, *outputs.values())


def draw_films(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Forces on the films as shares of the jaw's force.  inputs: sweeps of the displacement."""
    plt, moved = pyplot(), _sweeps(inputs)
    figure, axes = plt.subplots(1, len(moved), figsize=(3.6 * len(moved), 3.2), sharey=True, squeeze=False, layout="constrained")
    for ax, sweep in zip(axes[0], moved, strict=True):
        for number, (name, force) in enumerate(zip(sweep.films, sweep.film_force_n.T, strict=True)):
            ax.plot(sweep.force_n, force / sweep.force_n, "-" if number % 2 else "--", label=name,
                    color=_COLOURS[number % len(_COLOURS)], zorder=2 + (number % 2 == 0))     # dashes above
        ax.set(xlabel="force on the jaw, N", title=_words(sweep.tissue))
    axes[0, 0].set_ylabel("film's force over the jaw's")
    axes[0, 0].legend(frameon=False, fontsize=8)
    save(figure, *outputs.values())


def draw_hardness(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """The paper's relative hardness and the apparent modulus against load, for each tissue and height.  inputs: table (CSV)."""
    plt, table = pyplot(), read_csv(inputs["table"])
    figure, axes = plt.subplots(1, 2, figsize=(11, 3.6), layout="constrained")
    titles = {"relative_hardness_n_mm": "F/d of the beam, N/mm", "apparent_modulus_mpa": "apparent modulus at rest, MPa"}
    tissues, styles = list(dict.fromkeys(table.tissue)), ("-", "--", ":", "-.")
    heights = sorted(set(table.tissue_height_mm))
    for ax, (column, title) in zip(axes, titles.items(), strict=True):
        for (tissue, height), rows in table.groupby(["tissue", "tissue_height_mm"], sort=False):
            ax.plot(rows.force_n, rows[column], styles[heights.index(height) % len(styles)], marker="o", ms=3,
                    color=_COLOURS[tissues.index(tissue) % len(_COLOURS)], label=f"{_words(tissue)}, {height:g} mm")
        scales = {"yscale": "log"} if (table[column] > 0).any() else {}     # matplotlib warns of a log scale without a point
        ax.set(xlabel="largest force of the sweep, N", ylabel=title, xscale="log", **scales,
               title=f"changes with load by up to {verdict(table, column).change_with_load:.0%}")
        for axis in (ax.xaxis, ax.yaxis)[:1 + len(scales)]:     # plain numbers
            axis.set_major_locator(LogLocator(subs=(1, 2, 3, 5, 7)))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())
    axes[1].legend(frameon=False, fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    save(figure, *outputs.values())


def draw_lump(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Where a lump is detected, and estimates of hidden lumps with 95 % intervals.  inputs: detection, recovery (CSV)."""
    plt, detection, recovered = pyplot(), read_csv(inputs["detection"]), read_csv(inputs["recovery"])
    figure, (left, *others) = plt.subplots(1, 4, figsize=(13, 3.2), layout="constrained", width_ratios=(1.6, 1, 1, 1))
    grid = detection.pivot(index="depth_mm", columns="x_mm", values="least_stiffness_ratio")
    seen = np.ma.masked_invalid(grid.to_numpy())
    image = left.pcolormesh(grid.columns, grid.index, seen, shading="nearest", cmap="viridis_r")
    left.invert_yaxis()
    left.set(xlabel="x of the lump, mm", ylabel="depth below the jaw, mm", title="least stiffness ratio that is seen (white: none)")
    figure.colorbar(image, ax=left)
    logs = recovered.assign(log_ratio=np.log(recovered.stiffness_ratio), found_log_ratio=np.log(recovered.found_stiffness_ratio))
    names = {"x_mm": "x, mm", "depth_mm": "depth, mm", "log_ratio": "log of the stiffness ratio"}
    for ax, (column, title) in zip(others, names.items(), strict=True):
        middle = logs[f"found_{column}"]
        around = [(middle - logs[f"{column}_low"]).clip(lower=0), (logs[f"{column}_high"] - middle).clip(lower=0)]
        ax.errorbar(logs[column], middle, yerr=around, fmt="o", ms=3, lw=0.8, color=_COLOURS[0])
        ends = [logs[column].min(), logs[column].max()]
        ax.plot(ends, ends, "-", lw=0.8, color="0.5")
        ax.set(xlabel=f"true {title}", ylabel="found")
    save(figure, *outputs.values())


def _sweeps(inputs: dict[str, Any]) -> list[Palpation]:
    return [Palpation.of(read_dataset(path)) for path in inputs["sweeps"]]
