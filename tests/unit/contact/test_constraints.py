"""Stacked constraints of several pairs: each keeps its rows and has zeros for the others."""

import numpy as np
import pytest
from models import DenseCompliance
from scipy.sparse import csr_array

from fastcontact.contact.constraints import Constraints, stacked

N_DOFS = 7


def part(m, seed, compliance=False, tangents=0, **given):
    random = np.random.default_rng(seed)
    G = random.normal(size=(m, m))
    return Constraints(
        csr_array(random.normal(size=(m, N_DOFS))), random.normal(size=m), random.normal(size=(m, 3)),
        DenseCompliance(G @ G.T) if compliance else None,
        tuple(csr_array(random.normal(size=(m, N_DOFS))) for _ in range(tangents)),
        tuple(random.normal(size=(m, 3)) for _ in range(tangents)), **given,
    )  # fmt: skip


@pytest.fixture
def parts():
    random = np.random.default_rng(9)
    return [
        part(2, 1, equality=np.array([True, False])),
        part(
            3,
            2,
            compliance=True,
            tangents=2,
            friction=np.full(3, 0.3),
            low_rank_compliance=random.normal(size=(3, 3, 2)),
        ),
        part(4, 3, softness=np.full(4, 0.1)),
        part(
            2,
            4,
            compliance=True,
            tangents=2,
            slip0=random.normal(size=(2, 2)),
            low_rank_compliance=random.normal(size=(3, 2, 1)),
        ),
    ]


def stack(parts):
    return stacked({f"pair {k}": each for k, each in enumerate(parts)})


def test_one_part_stays_what_it_is(parts):
    whole = stack(parts[:1])
    assert whole.B is parts[0].B
    assert whole.rows == {"pair 0": slice(0, 2)}


def test_rows_and_numbers_follow_each_other(parts):
    whole = stack(parts)
    np.testing.assert_array_equal(whole.B.toarray(), np.vstack([p.B.toarray() for p in parts]))
    np.testing.assert_array_equal(whole.gap0, np.concatenate([p.gap0 for p in parts]))
    assert whole.friction.tolist() == [0.0] * 2 + [0.3] * 3 + [0.0] * 6
    assert whole.equality.tolist() == [True] + [False] * 10
    assert whole.softness.tolist() == [0.0] * 5 + [0.1] * 4 + [0.0] * 2
    np.testing.assert_array_equal(whole.slip0[:, 9:], parts[3].slip0)
    assert not whole.slip0[:, :9].any()
    for k in range(2):
        rows = whole.tangents[k].toarray()
        np.testing.assert_array_equal(rows[2:5], parts[1].tangents[k].toarray())
        np.testing.assert_array_equal(rows[9:], parts[3].tangents[k].toarray())
        assert not rows[:2].any()
        assert not rows[5:9].any()
        np.testing.assert_array_equal(whole.directions[k][2:5], parts[1].directions[k])
        assert not whole.directions[k][5:9].any()


def test_what_no_part_has_the_whole_has_not():
    whole = stack([part(2, 1), part(3, 2)])
    assert whole.compliance is None
    assert whole.tangents == whole.directions == ()
    assert whole.slip0 is whole.equality is whole.softness is whole.low_rank_compliance is None


def test_compliances_do_not_couple_parts(parts):
    whole = stack(parts)
    C = np.zeros((11, 11))
    C[2:5, 2:5], C[9:, 9:] = parts[1].compliance.C, parts[3].compliance.C
    rows = np.array([0, 2, 4, 5, 9, 10])
    np.testing.assert_array_equal(whole.compliance.block(rows), C[np.ix_(rows, rows)])
    multiplier = np.arange(11.0)
    np.testing.assert_allclose(whole.compliance.apply(multiplier), C @ multiplier, rtol=1e-14)
    soft = C + np.diag(whole.softness)
    np.testing.assert_array_equal(whole.normal_compliance.block(rows), soft[np.ix_(rows, rows)])
    np.testing.assert_allclose(whole.normal_compliance.apply(multiplier), soft @ multiplier, rtol=1e-14)


def test_factors_of_compliances_lie_side_by_side(parts):
    Z = stack(parts).low_rank_compliance
    assert Z.shape == (3, 11, 3)
    np.testing.assert_array_equal(Z[:, 2:5, :2], parts[1].low_rank_compliance)
    np.testing.assert_array_equal(Z[:, 9:, 2:], parts[3].low_rank_compliance)
    assert np.count_nonzero(Z) == parts[1].low_rank_compliance.size + parts[3].low_rank_compliance.size
