"""Sparse Cholesky factors: structure compared with elimination by hand, values with NumPy."""

import numpy as np
import pytest
from scipy.linalg import ldl
from scipy.sparse import block_diag, bsr_array, csc_array, csr_array, diags_array, eye_array, kron

from fastcontact.errors import ModelError
from fastcontact.linear.cholesky import factorisation, triangular_kernels

pytestmark = pytest.mark.pairwise

EXACT = np.array([4]), np.array([0.0, 0.0])
JOINED = np.array([4, 16]), np.array([1.0, 0.6, 0.3])


def positive(n, density, seed):
    """A sparse symmetric positive definite matrix."""
    rng = np.random.default_rng(seed)
    A = np.where(rng.random((n, n)) < density, rng.normal(size=(n, n)), 0.0)
    A = A + A.T
    return csc_array(A + np.diag(np.abs(A).sum(axis=1) + 1.0))


def apart(seed):
    """One of several pieces, some of them a single unknown."""
    return csc_array(block_diag([positive(n, 0.2, seed + n) for n in (1, 12, 1, 9, 1)]))


MATRICES = [
    *(positive(n, density, seed) for n, density in [(1, 0), (9, 0), (30, 0.05), (60, 0.04), (40, 1)] for seed in (0, 1)),
    apart(5),
]  # fmt: skip


def filled(A):
    """The pattern of the factor, column after column."""
    pattern = A.toarray() != 0.0
    for j in range(len(pattern)):
        below = np.flatnonzero(pattern[j + 1 :, j]) + j + 1
        pattern[np.ix_(below, below)] = True
    return np.tril(pattern)


@pytest.mark.parametrize("A", MATRICES)
@pytest.mark.parametrize("rule", [EXACT, JOINED], ids=["exact", "joined"])
def test_supernodes_hold_every_entry_and_no_more_zeros_than_asked(A, rule, monkeypatch):
    n, late = A.shape[0], np.arange(A.shape[0]) > 0.7 * A.shape[0]
    monkeypatch.setattr(factorisation, "WIDTHS", rule[0])
    monkeypatch.setattr(factorisation, "SHARES", rule[1])
    found = factorisation.elimination_tree(A)
    first, begin, rows = factorisation.supernodes(A, found, late[found.order])
    L = filled(A[found.order][:, found.order])
    shown = np.zeros((n, n), bool)
    for s in range(len(first) - 1):
        own, below = np.arange(first[s], first[s + 1]), rows[begin[s] : begin[s + 1]]
        assert (np.diff(below) > 0).all()
        assert len(set(late[found.order][own])) == 1
        shown[np.ix_(own, own)] = np.tri(len(own), dtype=bool)
        shown[np.ix_(below, own)] = True
    assert (shown >= L).all()
    if rule is EXACT:
        np.testing.assert_array_equal(shown, L)


def factors(K, last):
    """Of a matrix twice as large, then of the matrix: order and pattern are those of the first."""
    symbolic = factorisation.SymbolicFactors(K, last)
    symbolic.factors(2.0 * K)
    assert symbolic.matches(K, last)
    return symbolic.factors(K)


@pytest.mark.parametrize("A", [*MATRICES, *(positive(n, 1.0, n) for n in (2, 47, 48, 49)), positive(300, 0.3, 7)])
@pytest.mark.parametrize("m", [0, 1, 7])
def test_factors_are_those_of_the_matrix(A, m):
    n = A.shape[0]
    last = np.sort(np.random.default_rng(m).permutation(n)[:m])
    made = factors(bsr_array(A, blocksize=(1, 1)), last)
    L, wanted = np.zeros((n, n)), np.arange(n)
    triangular_kernels.copy_block(*made._L, wanted, L)
    order = np.argsort(made._position)
    dense = A.toarray()[np.ix_(order, order)]
    np.testing.assert_allclose((L * made._d) @ L.T, dense, atol=1e-13 * np.abs(dense).max())
    np.testing.assert_allclose(L, ldl(dense, lower=True)[0], atol=1e-13)
    late = np.zeros(n, bool)
    late[made._position[last]] = True
    assert not L[np.ix_(~late, late)].any()
    np.testing.assert_allclose(A @ made.solve(np.ones(n)), np.ones(n), atol=1e-12)
    np.testing.assert_allclose(made.last_inverse(), np.linalg.inv(A.toarray())[np.ix_(last, last)], atol=1e-13)


@pytest.mark.parametrize("m", [0, 30])
def test_factors_reuse_what_has_not_changed(m):
    """Matrices of a grid that change in places that grow, shrink and move have the factors of a new factorisation."""
    n, rng = 24, np.random.default_rng(0)
    line = diags_array([2.1, -1.0, -1.0], offsets=[0, 1, -1], shape=(n, n))
    K = csr_array(kron(line, eye_array(n)) + kron(eye_array(n), line))
    last = np.arange(m)
    reusing = factorisation.SymbolicFactors(bsr_array(K, blocksize=(2, 2)), last)
    reused = []
    corners = (0, 0), (0, 40), (0, 40), (0, 80), (0, 60), (300, 320), (300, 320), (0, 0)
    for corner in (slice(*ends) for ends in corners):
        there = np.zeros(n * n)
        there[corner] = rng.random(corner.stop - corner.start)
        changed = bsr_array(csr_array(K + diags_array(there)), blocksize=(2, 2))
        found = reusing.factors(changed)
        reused.append(float(np.mean(reusing._previous.offsets >= 0)) if reusing._previous.entries.size else 0.0)
        fresh = factorisation.SymbolicFactors(changed, last).factors(changed)
        for a, b in zip((*found._L, found._d), (*fresh._L, fresh._d), strict=True):
            np.testing.assert_array_equal(a, b)
    assert min(reused[2:]) > 0.0


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        ([[1.0, -1.0], [-1.0, 1.0]], "singular: support the rigid-body motions"),
        ([[1.0, 2.0], [2.0, 1.0]], "not positive definite"),
        ([[np.nan, 0.0], [0.0, 1.0]], "not positive definite"),
    ],
)
def test_what_is_not_positive_definite_is_refused(matrix, message):
    with pytest.raises(ModelError, match=message):
        factors(bsr_array(np.array(matrix), blocksize=(1, 1)), np.array([1]))
