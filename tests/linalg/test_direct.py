"""Direct solvers behind one interface: the same answers, and what they say of matrices that they cannot factor."""

import importlib.metadata
import os

import numpy as np
import pytest
import scipy.sparse as sp

from softtact.linalg.direct import PardisoSolver, SuperLUSolver, make_solver, point_at_mkl

pytest.importorskip("pypardiso")
from softtact.linalg.direct import PardisoSingle

SOLVERS = {"pardiso": (PardisoSolver, 1e-12), "rough": (PardisoSingle, 1e-4), "superlu": (SuperLUSolver, 1e-12)}


def box(cells=8, *, shift=0.2):
    """A Laplacian on a box of cells^3 points plus a shift: positive definite, of condition below 100; whole and upper triangle."""
    line, one = sp.diags([-1, 2 + shift, -1], [-1, 0, 1], shape=(cells, cells)), sp.eye(cells)
    whole = (sp.kron(sp.kron(line, one), one) + sp.kron(sp.kron(one, line), one) + sp.kron(sp.kron(one, one), line)).tocsr()
    upper = sp.triu(whole, format="csr")
    upper.sort_indices()
    return whole, upper


@pytest.mark.parametrize("name", SOLVERS)
def test_a_solution_balances_its_right_side(name):
    for precision in [np.float64, np.float32]:
        for columns in [None, 3]:
            make, tolerance = SOLVERS[name]
            whole, upper = box()
            right = np.random.default_rng(0).normal(size=whole.shape[0] if columns is None else (whole.shape[0], columns))
            solver = make()
            assert solver.factor(upper.astype(precision))
            found = solver.solve(right)
            solver.close()
            assert found.shape == right.shape and found.dtype == np.float64
            rounded = 1e-6 if precision is np.float32 else 0.0
            np.testing.assert_allclose(whole @ found, right, atol=(tolerance + rounded) * np.abs(right).max())


def test_on_several_threads_each_run_makes_its_sums_in_the_same_order():
    _, upper = box(16)
    found, right = set(), np.random.default_rng(0).normal(size=upper.shape[0])
    for _ in range(4):
        solver = PardisoSolver(threads=4)
        assert solver.factor(upper)
        found.add(solver.solve(right).tobytes())
        solver.close()
    assert len(found) == 1


@pytest.mark.parametrize("name", SOLVERS)
def test_a_matrix_that_is_not_positive_definite_is_reported_and_the_next_one_factored(name):
    whole, upper = box()
    make, tolerance = SOLVERS[name]
    solver, indefinite, right = make(), upper.copy(), np.ones(whole.shape[0])
    indefinite.data[indefinite.indptr[7]] = -50.0
    assert solver.factor(upper) and not solver.factor(indefinite) and solver.factor(upper)
    np.testing.assert_allclose(whole @ solver.solve(right), right, atol=tolerance)
    solver.close()


@pytest.mark.parametrize("name", ["pardiso", "rough"])
def test_one_analysis_serves_all_matrices_of_a_pattern_and_a_new_pattern_gets_its_own(name):
    make, tolerance = SOLVERS[name]
    solver = make()
    for whole, upper in (box(), box(6)):
        for factor in (1.0, 3.0):
            matrix = sp.csr_matrix((factor * upper.data, upper.indices, upper.indptr), shape=upper.shape)
            assert solver.factor(matrix)
            right = np.ones(whole.shape[0])
            np.testing.assert_allclose(factor * (whole @ solver.solve(right)), right, atol=tolerance)
    solver.close()


def test_places_of_64_bits_are_refused_before_they_are_read_as_others():
    _, upper = box(4)
    upper.indices, upper.indptr = upper.indices.astype(np.int64), upper.indptr.astype(np.int64)
    with pytest.raises(TypeError, match="32 bits"):
        PardisoSolver().factor(upper)


def test_the_solver_is_named():
    assert make_solver().name == "pardiso" and PardisoSingle().name == "pardiso, single precision"


def test_a_machine_without_mkl_takes_the_solver_that_is_there(monkeypatch):
    def nothing(name):
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.delenv("PYPARDISO_MKL_RT", raising=False)
    monkeypatch.setattr(importlib.metadata, "files", nothing)
    point_at_mkl()
    assert "PYPARDISO_MKL_RT" not in os.environ


def test_a_solver_that_nobody_closes_gives_its_memory_back(monkeypatch):
    freed = []
    monkeypatch.setattr("pypardiso.PyPardisoSolver.free_memory", lambda self, everything=False: freed.append(everything))
    solver = PardisoSolver()
    assert not freed
    del solver
    assert freed == [True]
