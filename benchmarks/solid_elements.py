"""Which tetrahedron for the solid model? `python benchmarks/solid_elements.py` (some minutes on one thread).

Elements on the same hexahedral grids, each hexahedron cut into six tetrahedra where the element is one:
  tet10    quadratic, four points, J at every point: a plain displacement element
  tet10p0  quadratic, four points, J projected on a constant in each element
  tet15    quadratic with a bubble on each face and one inside, J projected on linear functions (after Crouzeix
           and Raviart, 1973)
  hex27    27 nodes, J projected on linear functions
All at nu = 0.4995:
  cook     Cook's membrane in plane strain: displacement of the upper corner
  bonded   a square block bonded to plates, as high as a quarter of its half side: force at small strain, and how far the pressure
           at the quadrature points strays from the smooth pressure of the reference, in the middle, over the greatest pressure
References: the limit that two programs' elements agree on (cook, docs/reference/verification.md); hex27 on a finer grid (bonded).
Time: processor seconds of one tangent, its factor and its solution, the shortest of three. Writes
benchmarks/results/solid_elements.json and the table in docs/explanation/solid.md.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import record

from softtact.fem.assembly import SymmetricPattern, add_upper
from softtact.fem.elements import HEX27, TET10
from softtact.fem.kernels import add_forces, project
from softtact.fem.quadrature import tetrahedron_rule4, tetrahedron_rule15
from softtact.fem.solid_block import SolidBlock, pressure_modes
from softtact.fem.structured_meshes import box, in_tetrahedra
from softtact.linalg.direct import make_solver
from softtact.materials.laws.registry import make_law

PAGE = Path(__file__).parents[1] / "docs/explanation/solid.md"
NU = 0.4995
LAW = make_law("neo_hooke", {"c10": 1 / (4 * (1 + NU))}, bulk_modulus=1 / (3 * (1 - 2 * NU)))     # E = 1 MPa
COOK = 19.4441
FACES = np.array([[0, 1, 2], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
NAMES = {"tet10": "quadratic tetrahedra, J at every point", "tet10p0": "quadratic tetrahedra, constant pressure",
         "tet15": "the same with bubbles, linear pressure", "hex27": "27-node hexahedra, linear pressure"}


class Body:
    """Elements of a kind on the grid of a mesh of HEX27; bubbles are unknowns of their own, beside the quadratic functions."""

    def __init__(self, mesh, kind):
        grid = mesh if kind == "hex27" else in_tetrahedra(mesh)
        self.mesh, self.points, nodes = grid, grid.points, grid.cells[0][2]
        if kind == "hex27":
            rule, basis = HEX27.quadrature, pressure_modes(HEX27.quadrature.points)
            slopes = HEX27.shape(rule.points)[1]
        elif kind == "tet15":
            rule = tetrahedron_rule15()
            basis = np.column_stack([np.ones(len(rule.points)), rule.points])
            slopes = np.concatenate([TET10.shape(rule.points)[1], bubbles(rule.points)], axis=1)
        else:
            rule = tetrahedron_rule4()
            basis = np.ones((4, 1)) if kind == "tet10p0" else np.eye(4)
            slopes = TET10.shape(rule.points)[1]
        self.corners = None
        width = nodes.shape[1]
        jacobian = np.einsum("emi,gmj->egij", self.points[nodes], slopes[:, :width], optimize=True)
        if kind == "tet15":
            nodes = self._with_bubbles(nodes)
        self.nodes = nodes
        gradients = np.matmul(slopes[None], np.linalg.inv(jacobian))
        self.block = SolidBlock(gradients, np.linalg.det(jacobian) * rule.weights, basis, LAW)
        values = TET10.shape(rule.points)[0] if width == 10 else HEX27.shape(rule.points)[0]
        self.places = np.einsum("gm,emi->egi", values, self.points[nodes[:, :width]])

    def _with_bubbles(self, nodes):
        count = len(self.points)
        corners = np.sort(nodes[:, FACES], axis=2).reshape(-1, 3)
        unique, inverse = np.unique(corners, axis=0, return_inverse=True)
        self.corners = unique                                       # of each face's bubble
        cells = count + len(unique) + np.arange(len(nodes))
        self.points = np.vstack([self.points, self.points[unique].mean(axis=1), self.points[nodes[:, :4]].mean(axis=1)])
        return np.hstack([nodes, count + inverse.reshape(-1, 4), cells[:, None]])

    def held_where(self, *rules):
        """Mask (n, 3) of rules (function of places, axes); a face's bubble is held where its corners are, an inner one is free."""
        held = np.zeros(self.points.shape, bool)
        count = len(self.mesh.points)
        for where, axes in rules:
            on = np.zeros(len(self.points), bool)
            on[:count] = where(self.mesh.points)
            if self.corners is not None:
                on[count:count + len(self.corners)] = on[self.corners].all(axis=1)
            held[np.ix_(on, axes)] = True
        return held

    def use(self, held):
        used = np.zeros(len(self.points), bool)
        used[self.nodes.ravel()] = True
        self.free_components = ~held & used[:, None]
        self.free = np.flatnonzero(self.free_components.ravel())
        self.pattern = SymmetricPattern(self.free_components, [self.nodes])
        self.positions, self.solver = self.pattern.positions(self.nodes), make_solver()

    def force(self, displacement):
        state, force = self.block.evaluate(displacement[self.nodes]), np.zeros_like(self.points)
        if state is None:
            return None
        add_forces(force, self.nodes, state.force.reshape(*self.nodes.shape, 3))
        return force

    def solve(self, displacement, right):
        """A solution with the tangent at a displacement, and its processor seconds."""
        began = time.process_time()
        matrix = self.pattern.matrix()
        matrix.data[:] = 0.0
        for start in range(0, len(self.nodes), 256):
            part = slice(start, start + 256)
            add_upper(matrix.data, self.block.tangent(displacement[self.nodes[part]], part), self.positions[part])
        if not self.solver.factor(matrix):
            raise ArithmeticError("the tangent is not positive definite")
        out = np.zeros_like(self.points)
        out.ravel()[self.free] = self.solver.solve(right.ravel()[self.free])
        return out, time.process_time() - began

    def timed(self, displacement, right):
        tries = [self.solve(displacement, right) for _ in range(3)]
        return tries[0][0], min(seconds for _, seconds in tries)

    def pressure(self, displacement):
        """At the quadrature points (e, g), by the element's own functions, in MPa, compression positive."""
        J = self.block.loops.deformation(displacement[self.nodes], self.block.at_rest).J
        return -LAW.bulk_modulus * project(J - 1.0, self.block.at_rest)


def bubbles(points):
    """Derivatives (g, 5, 3) of the bubbles of the four faces and of the body, each 1 at its middle."""
    L, dL = np.column_stack([1 - points.sum(axis=1), points]), np.vstack([-np.ones(3), np.eye(3)])
    out = []
    for scale, members in [(27, face) for face in FACES] + [(256, range(4))]:
        members = list(members)
        out.append(scale * sum(np.prod(L[:, [m for m in members if m != k]], axis=1)[:, None] * dL[k] for k in members))
    return np.stack(out, axis=1)


def cook(kind, cells):
    mesh = box((0, 0, 0), (1, 1, 1 / cells), (cells, cells, 1)).moved(
        lambda x: np.column_stack([48 * x[:, 0], 44 * x[:, 0] + x[:, 1] * (44 - 28 * x[:, 0]), 44 * x[:, 2]]))
    body = Body(mesh, kind)
    body.use(body.held_where((lambda x: x[:, 0] < 1e-9, [0, 1, 2]),
                             (lambda x: (x[:, 2] < 1e-9) | (x[:, 2] > 44 / cells - 1e-9), [2])))
    load = np.zeros_like(body.points)
    for facets in body.mesh.faces["x1"].values():
        _add_traction(body, facets, load)
    moved, seconds = body.timed(np.zeros_like(body.points), load)
    got = moved[np.abs(body.points - [48, 60, 0]).sum(axis=1).argmin(), 1] * 44 / cells
    return {"error": 100 * (got / COOK - 1), "unknowns": len(body.free), "seconds": seconds}


def _add_traction(body, facets, load):
    """A unit force upwards on all facets of x = 48 together, the bubbles' share of the work among it."""
    corners = body.mesh.points[facets[:, :4 if facets.shape[1] == 9 else 3]]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, -1]
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) * (1 if facets.shape[1] == 9 else 0.5)
    total = area.sum()
    if facets.shape[1] == 9:      # Simpson's rule: 1/36 of corners, 4/36 of sides, 16/36 of the middle
        shares = np.array([1, 1, 1, 1, 4, 4, 4, 4, 16]) / 36
    else:
        shares = np.array([0, 0, 0, 1, 1, 1]) / 3
    np.add.at(load[:, 1], facets, area[:, None] * shares / total)
    if body.corners is not None:
        number = {tuple(own): k for k, own in enumerate(body.corners.tolist())}
        for own, part in zip(np.sort(facets[:, :3], axis=1).tolist(), area, strict=True):
            load[len(body.mesh.points) + number[tuple(own)], 1] += 0.45 * part / total      # integral of 27 L1 L2 L3 over the area


def block(kind, cells, layers, height):
    """A quarter and upper half of a square block of half side 1 mm and half height `height`, finer at the rim and the plate."""
    rim, plate = 1 - np.linspace(1, 0, cells + 1) ** 1.5, 1 - np.linspace(1, 0, layers + 1) ** 1.5
    body = Body(box((0, 0, 0), (1, 1, height), (cells, cells, layers), grading=(rim, rim, plate)), kind)
    top = body.held_where((lambda x: x[:, 2] > height - 1e-9, [0, 1, 2]))
    body.use(top | body.held_where(*((lambda x, i=i: x[:, i] < 1e-9, [i]) for i in range(3))))
    on_top = np.zeros_like(body.points)
    count = len(body.mesh.points)
    on_top[:count][top[:count, 2], 2] = 1.0
    return body, on_top


def bonded(kind, cells, layers, reference=None):
    height = 1 / 8
    body, on_top = block(kind, cells, layers, height)
    strain = 1e-4
    start = -strain * height * on_top
    force = body.force(start)
    moved, seconds = body.timed(np.zeros_like(body.points), force)
    displacement = start - moved
    load = -(body.force(displacement) * on_top).sum() / strain
    place, pressure = body.places.reshape(-1, 3), body.pressure(displacement).ravel() / strain
    middle = (place[:, :2] < 0.7).all(axis=1)
    x, y = place[middle, :2].T ** 2
    functions = np.column_stack([x**i * y**j for i in range(4) for j in range(4 - i)])
    row = {"force": load, "unknowns": len(body.free), "seconds": seconds}
    if reference is None:
        fit = np.linalg.lstsq(functions, pressure[middle], rcond=None)[0]
        return row | {"fit": fit.tolist(), "peak": float(pressure[middle].max())}
    stray = np.sqrt(np.mean((pressure[middle] - functions @ np.array(reference["fit"])) ** 2)) / reference["peak"]
    return row | {"error": 100 * (load / reference["force"] - 1), "pressure": 100 * float(stray)}


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--small", action="store_true", help="coarse grids only, no record")
    given = options.parse_args()
    grids = [(4, 2)] if given.small else [(4, 2), (8, 3)]
    finest = (6, 3) if given.small else (12, 5)
    reference = bonded("hex27", *finest)
    rows = []
    for kind in NAMES:
        for cells, layers in grids:
            row = {"kind": kind, "cells": cells, "cook": cook(kind, cells), "bonded": bonded(kind, cells, layers, reference)}
            print(table_row(row), flush=True)
            rows.append(row)
    if not given.small:
        print(record.write("solid_elements", threads=1, reference=reference, rows=rows))
        write_table(rows)


HEAD = ("| element | grid | unknowns (bonded block) | Cook's membrane, % | bonded block, % | its pressure strays by, % "
        "| one step, processor s |\n|---|---|---|---|---|---|---|")


def table_row(row):
    """A row in Markdown."""
    return (f"| {NAMES[row['kind']]} | {row['cells']} | {row['bonded']['unknowns']:,} | {row['cook']['error']:+.2f} "
            f"| {row['bonded']['error']:+.2f} | {row['bonded']['pressure']:.1f} | {row['bonded']['seconds']:.2f} |")


def write_table(rows):
    """Put the table between the page's marks."""
    before, _, after = PAGE.read_text(encoding="utf-8").partition("<!-- elements -->")
    after = after.partition("<!-- end of elements -->")[2]
    table = "\n".join([HEAD, *(table_row(row) for row in rows)])
    PAGE.write_text(f"{before}<!-- elements -->\n{table}\n<!-- end of elements -->{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
