"""Factors of a sparse stiffness: each library against a dense solve, and which is taken."""

import gc
from importlib.metadata import PackageNotFoundError

import numpy as np
import pytest
import scipy.sparse as sp
from skin_examples import HeldSlab

from tacdata.errors import SolveError
from tacdata.skin.linear import pardiso
from tacdata.skin.linear.cholesky import CholmodFactor, factor_of
from tacdata.skin.linear.pardiso import PardisoFactor

installed = pytest.mark.skipif(pardiso.runtime() is None, reason="MKL is not installed")


def by_pardiso(matrix):
    return PardisoFactor(matrix, pardiso.runtime())


LIBRARIES = [pytest.param(by_pardiso, marks=installed, id="pardiso"), pytest.param(CholmodFactor, id="cholmod")]


@pytest.fixture(scope="module")
def stiffness():
    body = HeldSlab()
    return body.stiffness[body.free][:, body.free]


@pytest.mark.parametrize("library", LIBRARIES)
@pytest.mark.parametrize("columns", [1, 3, 70])
def test_a_factor_solves_to_single_precision(stiffness, library, columns):
    rhs = np.random.default_rng(columns).normal(size=(stiffness.shape[0], columns)).astype(np.float32)
    exact = np.linalg.solve(stiffness.toarray(), rhs.astype(np.float64))
    found = library(stiffness).solve(rhs)
    assert found.shape == rhs.shape and found.dtype == np.float32
    assert np.linalg.norm(found - exact) < 1e-3 * np.linalg.norm(exact)


@pytest.mark.parametrize("library", LIBRARIES)
def test_order_and_layout_of_what_comes_in_do_not_matter(stiffness, library):
    """Entries of a row in any order; right-hand sides that are a transpose, or of double precision."""
    size = stiffness.shape[0]
    rows = stiffness.indptr[1:-1]
    data, columns = (
        np.concatenate([row[::-1] for row in np.split(values, rows)]) for values in (stiffness.data, stiffness.indices)
    )
    turned = sp.csr_matrix((data, columns, stiffness.indptr), shape=stiffness.shape)
    assert not turned.has_sorted_indices
    wide = np.random.default_rng(0).normal(size=(4, size))
    found = library(turned).solve(wide.T)
    plain = library(stiffness).solve(np.ascontiguousarray(wide.T, dtype=np.float32))
    np.testing.assert_allclose(found, plain, atol=1e-4 * np.abs(plain).max())


@installed
def test_two_factors_live_side_by_side_and_are_released(stiffness):
    rhs = np.ones((stiffness.shape[0], 1), dtype=np.float32)
    one, two = by_pardiso(stiffness), by_pardiso(2 * stiffness)
    before = one.solve(rhs)
    handle = two._memory._handle
    assert handle.any()
    del two
    gc.collect()
    assert not handle.any(), "what the library kept is given back"
    np.testing.assert_array_equal(one.solve(rhs), before)


@installed
def test_a_body_that_nothing_holds_is_refused():
    body = HeldSlab()
    with pytest.raises(SolveError) as caught:
        by_pardiso(body.stiffness - sp.identity(body.stiffness.shape[0]) * 1e-3 * body.stiffness.diagonal().max())
    assert "positive definite" in caught.value.allowed and "bonding" in caught.value.remedy


def test_without_mkl_it_is_cholmods(stiffness, monkeypatch):
    def missing(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr(pardiso, "files", missing)
    pardiso.runtime.cache_clear()
    try:
        assert isinstance(factor_of(stiffness), CholmodFactor)
    finally:
        pardiso.runtime.cache_clear()
    monkeypatch.undo()
    if pardiso.runtime() is not None:
        assert isinstance(factor_of(stiffness), PardisoFactor)
