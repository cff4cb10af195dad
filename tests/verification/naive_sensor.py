"""The layered sensor without any device: every unknown in one sparse matrix, contact as plain sums, whole Newton steps.

It takes from the fast sensor what defines the problem (elements and the nodes they hang on, contact points with their weights and
areas) and solves that problem by itself.
"""

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from fe import assemble


class NaiveSensor:
    """One object over the sensor; its planes are those at rest, so it has to be a plane itself."""

    def __init__(self, body, surface):
        self.body = body
        self.nodes = body.slab.nodes + body.support.count * body.support.nodes       # slab first, then frustum by frustum
        self.projection = body.slab.project(np.zeros((body.slab.nodes, 3)), surface)
        self.T = self._unknowns_to_nodes()
        self.parts = self._elements()
        self.board, self.board_gap0, self.board_area = self._board_points()
        self.top, self.top_area = self._top_points()
        self.u, self.depth, self.history = np.zeros(3 * self.nodes), 0.0, body.fresh_history()

    def _frustum_node(self, frustum, node):
        return self.body.slab.nodes + frustum * self.body.support.nodes + node

    def _unknowns_to_nodes(self):
        """Sparse matrix (3 nodes, unknowns): free slab nodes, inner frustum nodes, and roots that are slab nodes."""
        body, support = self.body, self.body.support
        full = sp.lil_matrix((3 * self.nodes, 3 * self.nodes))
        full.setdiag(1.0)
        for f in range(support.count):
            for r, root in enumerate(support.root):
                for i in range(3):
                    row = 3 * self._frustum_node(f, root) + i
                    full[row, row] = 0.0
                    full[row, 3 * body.cells.roots[f, r] + i] = 1.0
        inner = [3 * self._frustum_node(f, 0) + dof for f in range(support.count) for dof in support.inner]
        self.unknowns = np.concatenate([body.slab.free, inner]).astype(int)      # the third of three is vertical
        return full.tocsc()[:, self.unknowns].tocsr()

    def _elements(self):
        """(node numbers (e, m), block) of slab and frusta."""
        support = self.body.support
        frusta = np.concatenate([self._frustum_node(f, support.mesh.hexes) for f in range(support.count)])
        return [*self.body.slab.solids, (frusta, support.block)]

    def _board_points(self):
        """Matrix (points, 3 nodes) of the gaps at the frusta, gaps at rest, areas (mm2)."""
        support = self.body.support
        points = len(support.point_axis)
        B = sp.lil_matrix((support.count * points, 3 * self.nodes))
        for f in range(support.count):
            for p in range(points):
                for node, weight in zip(support.point_nodes[p], support.point_weights[p], strict=True):
                    B[f * points + p, 3 * self._frustum_node(f, node) + support.point_axis[p]] += weight
        return B.tocsr(), support.gap0.ravel(), support.point_area.ravel()

    def _top_points(self):
        """Matrix (points, 3 nodes) of the gaps to the object, areas (mm2)."""
        slab = self.body.slab
        B = sp.lil_matrix((len(slab.top.area), 3 * self.nodes))
        for t, face in enumerate(slab.top.faces):
            for g, values in enumerate(slab.top.values[t]):
                point = slab.top.values.shape[1] * t + g
                for node, value in zip(face, values, strict=True):
                    for i in range(3):
                        B[point, 3 * node + i] += value * self.projection.normals[point, i]
        return B.tocsr(), slab.top.area * self.projection.covered

    def _contacts(self, u, depth):
        """(matrix, gaps, areas, settings, gap's slope by depth) of board and object."""
        body = self.body
        rest = np.einsum("pd,pd->p", self.projection.normals, body.slab.top.reference - self.projection.anchors)
        indentation_increment = self.projection.normals[:, 2]
        below = replace(self.history.support.contact, offset=np.ravel(self.history.support.contact.offset))
        return [(self.board, self.board_gap0 + self.board @ u, self.board_area, below, 0.0 * self.board_gap0),
                (self.top, rest + self.top @ u + depth * indentation_increment, self.top_area, self.history.top.contact,
                 indentation_increment)]

    def _potential(self, u, depth):
        """Energy (mJ), its gradient by u and depth; energy infinite where an element is inside out."""
        energy, gradient, by_depth = 0.0, np.zeros(3 * self.nodes), 0.0
        for hexes, block in self.parts:
            state = block.evaluate(u.reshape(-1, 3)[hexes])
            if state is None:
                return np.inf, None, None
            energy += state.energy
            np.add.at(gradient.reshape(-1, 3), hexes.ravel(), state.force.reshape(-1, 3))
        for B, gaps, area, contact, indentation_increment in self._contacts(u, depth):
            density, pressure, _ = contact.response(gaps)
            energy += density @ area
            gradient -= B.T @ (pressure * area)
            by_depth -= indentation_increment @ (pressure * area)
        return energy, gradient, by_depth

    def _hessian(self, u, depth):
        """Second derivatives (unknowns + 1, unknowns + 1) by the unknowns and the depth."""
        K, border, corner = 0, 0, 0.0
        for hexes, block in self.parts:
            K = K + assemble(block.tangent(u.reshape(-1, 3)[hexes]), hexes, self.nodes)
        for B, gaps, area, contact, indentation_increment in self._contacts(u, depth):
            weight = contact.response(gaps)[2] * area
            K = K + B.T @ sp.diags(weight) @ B
            border = border + B.T @ (weight * indentation_increment)
            corner += weight @ indentation_increment**2
        border = (self.T.T @ border)[:, None]
        return sp.bmat([[self.T.T @ K @ self.T, border], [border.T, np.array([[corner]])]], format="csc")

    def press_to(self, force, history, *, tolerance=1e-10, iterations=60):
        """Minimise energy - force * depth from the present state, with the contacts' history of another solver; tolerance in N."""
        self.history = history
        if self.depth == 0.0:
            self._touch()
        energy, gradient, by_depth = self._potential(self.u, self.depth)
        for _ in range(iterations):
            residual = np.append(self.T.T @ gradient, by_depth - force)
            if np.abs(residual).max() < tolerance:
                self.energy = energy
                return
            step = -spla.spsolve(self._hessian(self.u, self.depth), residual)
            share = min(1.0, 0.1 / np.abs(step).max())
            while True:                                                   # halve the step until the residual or energy falls
                u, depth = self.u + share * (self.T @ step[:-1]), self.depth + share * step[-1]
                trial = self._potential(u, depth)
                if trial[0] - force * depth < energy - force * self.depth or self._smaller(trial, residual, force):
                    break
                share *= 0.5
                if share < 1e-6:
                    raise ArithmeticError("the naive press finds no descent")
            self.u, self.depth, (energy, gradient, by_depth) = u, depth, trial
        raise ArithmeticError(f"the naive press did not converge: {np.abs(residual).max():.1e} N")

    def _touch(self, *, object_mm=0.02, board_mm=1e-3):
        """A start at which object and board touch: without touch nothing holds the object, or the slab where it may glide."""
        self.depth = self.projection.anchors[:, 2].min() + object_mm
        self.u = self.T @ np.where(self.unknowns % 3 == 2, -board_mm, 0.0)

    def _smaller(self, trial, residual, force):
        """Whether a trial's residual is smaller: energies no longer tell close to equilibrium."""
        if not np.isfinite(trial[0]):
            return False
        return np.abs(np.append(self.T.T @ trial[1], trial[2] - force)).max() < np.abs(residual).max()

    @property
    def slab(self):
        """Displacement (n, 3) of the slab, mm."""
        return self.u.reshape(-1, 3)[:self.body.slab.nodes]

    @property
    def support(self):
        """Displacement (f, nodes, 3) of the frusta, mm."""
        return self.u.reshape(-1, 3)[self.body.slab.nodes:].reshape(self.body.support.count, -1, 3)

    def board_force(self, state):
        """Force (N) of the frusta on the board in a `FrustaState`."""
        support = self.body.support
        pressure = state.history.contact.response(state.gaps)[1]
        return float((pressure * support.point_area)[:, support.point_neighbour < 0].sum())

    def side_reaction(self, state):
        """Upward force (N) of the shell on the slab's held nodes."""
        body = self.body
        total = np.concatenate([state.slab.force, state.support.force.reshape(-1, 3)]).ravel()
        spread = total[:3 * body.slab.nodes].reshape(-1, 3).copy()
        roots = total[3 * body.slab.nodes:].reshape(body.support.count, -1, 3)[:, body.support.root]
        np.add.at(spread, body.cells.roots.ravel(), roots.reshape(-1, 3))
        held = np.ones(3 * body.slab.nodes, dtype=bool)
        held[body.slab.free] = False
        return float(spread.ravel()[held].reshape(-1, 3)[:, 2].sum())
