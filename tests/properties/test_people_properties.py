"""Laws of people that hold for every population and everybody."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from evenhand.core.errors import InputError
from evenhand.restaurant import people
from evenhand.restaurant.people import GROUPS, IDENTITIES, Population, Table
from support.refusals import refused

SIZES = [len(identity.groups) for identity in IDENTITIES]


@st.composite
def rows_of_codes(draw, least=1):
    """Codes of a few people, every combination possible."""
    columns = [st.integers(0, size - 1) for size in SIZES]
    rows = draw(st.lists(st.tuples(*columns), min_size=least, max_size=12))
    return np.array(rows, dtype=np.int64).reshape(-1, 5)


@st.composite
def shares(draw, size):
    """Shares that sum to 1, some of them 0."""
    weights = np.array(draw(st.lists(st.integers(0, 5), min_size=size, max_size=size)))
    assume(weights.any())
    return tuple((weights / weights.sum()).tolist())


@st.composite
def populations(draw):
    """Any population, its disability given age or not."""
    rows = {
        identity.name: draw(shares(size)) for identity, size in zip(IDENTITIES, SIZES, strict=True)
    }
    if draw(st.booleans()):
        del rows["disability"]
        table = Table("age", tuple(draw(shares(2)) for _ in range(5)))
        return Population("any", "", (), rows, {"disability": table})
    return Population("any", "", (), rows)


@given(rows_of_codes())
def test_names_lead_back_to_codes(codes):
    np.testing.assert_array_equal(people.codes_of(people.labels(codes)), codes)


@given(rows_of_codes())
def test_a_one_hot_row_names_exactly_the_groups_of_a_person(codes):
    named = people.labels(codes)
    for row, onehot in enumerate(people.encode(codes)):
        ones = {GROUPS[group] for group in np.flatnonzero(onehot)}
        assert ones == {(identity, named[identity][row]) for identity in named}


@given(rows_of_codes(), st.randoms(use_true_random=False))
def test_the_order_of_people_does_not_matter(codes, random):
    order = list(range(len(codes)))
    random.shuffle(order)
    np.testing.assert_array_equal(people.encode(codes[order]), people.encode(codes)[order])


@given(rows_of_codes(), st.integers(0, 4), st.sampled_from([-1, 0, 1, 1000]))
def test_a_code_out_of_range_is_never_encoded(codes, column, beyond):
    codes[-1, column] = -1 if beyond < 0 else SIZES[column] + beyond
    with pytest.raises(InputError, match=f"row {len(codes) - 1}: .*{IDENTITIES[column].name}"):
        people.encode(codes)


@given(populations(), st.integers(1, 200), st.integers(0, 2**32 - 1))
def test_people_are_valid_and_nobody_comes_from_an_empty_group(population, n, seed):
    codes = people.sample(population, n, np.random.default_rng(seed))
    assert codes.shape == (n, 5)
    assert people.encode(codes).sum() == 5 * n
    for column, identity in enumerate(IDENTITIES):
        marginal = np.array(population.marginal(identity.name))
        assert marginal.sum() == pytest.approx(1)
        assert (marginal[codes[:, column]] > 0).all()


@given(hnp.arrays(np.float64, 6, elements=st.floats(1e-12, 1)))
def test_shares_meet_their_sum_or_are_refused(weights):
    rows = {
        identity.name: (1 / size,) * size for identity, size in zip(IDENTITIES, SIZES, strict=True)
    }
    rows["race"] = tuple((weights / weights.sum()).tolist())
    assert Population("any", "", (), rows).marginal("race") == rows["race"]
    rows["race"] = tuple((1.01 * weights / weights.sum()).tolist())
    with refused("range shares", "1"):
        Population("any", "", (), rows)
