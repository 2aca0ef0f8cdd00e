"""People: the published numbers, typed here by hand, and what is drawn from them."""

import pickle
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy import stats

from evenhand.core.errors import InputError
from evenhand.restaurant import people
from evenhand.restaurant.people import IDENTITIES, Population, Table, population
from support.refusals import refused

COLUMN = {identity.name: column for column, identity in enumerate(IDENTITIES)}
ALIKE = {
    "race": (1 / 6,) * 6,
    "gender": (1 / 3,) * 3,
    "age": (1 / 5,) * 5,
    "disability": (1 / 2,) * 2,
    "skin": (1 / 6,) * 6,
}


def made(**changed) -> Population:
    """A population with some of its shares changed, or left out by None."""
    shares = {name: row for name, row in {**ALIKE, **changed}.items() if row is not None}
    return Population("made", "", (), shares)


class TestCategories:
    def test_the_papers_categories_in_order(self):
        assert [(identity.name, len(identity.groups)) for identity in IDENTITIES] == [
            ("race", 6),
            ("gender", 3),
            ("age", 5),
            ("disability", 2),
            ("skin", 6),
        ]
        assert IDENTITIES[0].groups == (
            "White",
            "Black",
            "American Indian",
            "Asian",
            "Native Hawaiian",
            "Other",
        )
        assert IDENTITIES[2].groups == ("Child", "Teenager", "Adult", "Middle Aged", "Elder")

    def test_groups_are_numbered_through_all_identities(self):
        assert len(people.GROUPS) == 22
        assert people.GROUPS[0] == ("race", "White")
        assert people.GROUPS[6] == ("gender", "Female")
        assert people.GROUPS[9] == ("age", "Child")
        assert people.GROUPS[14] == ("disability", "Yes")
        assert people.GROUPS[21] == ("skin", "VI")

    def test_each_identity_has_its_discrimination(self):
        assert dict(people.DISCRIMINATION) == {
            "race": "racism",
            "gender": "sexism",
            "age": "ageism",
            "disability": "ableism",
            "skin": "colourism",
        }


class TestPublishedShares:
    @pytest.mark.parametrize("identity", list(ALIKE))
    def test_uniform_has_every_category_alike(self, identity):
        assert population("uniform").marginal(identity) == pytest.approx(ALIKE[identity])

    # The published percentages; race is printed with a sum of 100.1.
    # Age: 0–9 is 10/15 of 18.1; 10–19 is 5/15 of 18.1 and 5/50 of 63.4; 20–39 and 40–59 are
    # 20/50 of 63.4 each; 60+ is 5/50 of 63.4 and 18.5.
    @pytest.mark.parametrize(
        ("identity", "percent"),
        [
            ("race", (68.2, 12.6, 0.8, 5.7, 0.2, 12.6)),
            ("gender", (49.2, 49.2, 1.6)),
            ("age", (12.067, 12.373, 25.36, 25.36, 24.84)),
            ("skin", (17.5, 17.5, 48.0, 5.667, 5.667, 5.667)),
        ],
    )
    def test_us(self, identity, percent):
        assert population("us").marginal(identity) == pytest.approx(
            np.array(percent) / 100, abs=1e-3
        )

    # FairFace: 18,612 White, 13,789 Black, 39,882 Asian (three labels), 25,415 Other (two labels)
    # of 97,698. Gender: 53.0 % and 47.0 % of the 98.4 % that are not Other.
    @pytest.mark.parametrize(
        ("identity", "percent"),
        [
            ("race", (19.05, 14.11, 0.0, 40.82, 0.0, 26.01)),
            ("gender", (46.25, 52.15, 1.6)),
            ("age", (14.1, 10.5, 51.7, 19.6, 4.2)),
            ("skin", (16.67,) * 6),
        ],
    )
    def test_fairface(self, identity, percent):
        assert population("fairface").marginal(identity) == pytest.approx(
            np.array(percent) / 100, abs=1e-3
        )

    # child: (5·0.8 + 5·5.4)/10. teenager: 10–17 at 5.4 (5/15 of 18.1 + 3/50 of 63.4 = 9.8373),
    # 18 and 19 at 6.0 (2/50 of 63.4 = 2.536). adult: (15·6.0 + 5·12.9)/20. middle aged: 12.9.
    # elder: 6.34 at 12.9, 11.1 at 25.4, 7.4 at 50.0, of 24.84.
    @pytest.mark.parametrize("name", ["us", "fairface"])
    def test_disability_depends_on_age(self, name):
        table = population(name).tables["disability"]
        assert table.given == "age"
        assert [row[0] for row in table.rows] == pytest.approx(
            [0.0310, 0.05523, 0.07725, 0.1290, 0.29538], abs=1e-5
        )

    def test_us_disability_meets_the_published_overall_share(self):
        assert population("us").marginal("disability")[0] == pytest.approx(0.136, abs=0.0005)

    @pytest.mark.parametrize("name", ["uniform", "us", "fairface"])
    def test_every_population_says_what_it_is(self, name):
        found = population(name)
        assert found.name == name
        assert len(found.description) > 80
        assert found.sources


class TestSampling:
    N = 60_000

    @pytest.mark.parametrize("identity", list(ALIKE))
    @pytest.mark.parametrize("name", ["uniform", "us", "fairface"])
    def test_frequencies_follow_the_shares(self, name, identity):
        codes = people.sample(population(name), self.N, np.random.default_rng(11))
        shares = np.array(population(name).marginal(identity))
        counts = np.bincount(codes[:, COLUMN[identity]], minlength=len(shares))
        assert not counts[shares == 0].any()
        drawn = shares > 0
        assert stats.chisquare(counts[drawn], self.N * shares[drawn]).pvalue > 1e-3

    def test_disability_is_drawn_given_age(self):
        codes = people.sample(population("us"), self.N, np.random.default_rng(12))
        rates = [0.0310, 0.05523, 0.07725, 0.1290, 0.29538]
        for age, rate in enumerate(rates):
            disabled = codes[codes[:, COLUMN["age"]] == age, COLUMN["disability"]] == 0
            assert stats.binomtest(int(disabled.sum()), disabled.size, rate).pvalue > 1e-3

    @pytest.mark.parametrize("pair", [("race", "skin"), ("gender", "age"), ("race", "disability")])
    def test_identities_without_a_table_are_independent(self, pair):
        codes = people.sample(population("us"), self.N, np.random.default_rng(13))
        first, second = (codes[:, COLUMN[identity]] for identity in pair)
        table = np.zeros((first.max() + 1, second.max() + 1))
        np.add.at(table, (first, second), 1)
        # Cells with a few expected people only would break the chi-square approximation.
        table = table[table.sum(axis=1) > 400]
        assert np.asarray(stats.chi2_contingency(table)[1]) > 1e-3

    def test_a_table_is_followed_row_by_row(self):
        shares = {name: row for name, row in ALIKE.items() if name != "skin"}
        diagonal = tuple(tuple(float(i == j) for j in range(6)) for i in range(6))
        linked = Population("linked", "", (), shares, {"skin": Table("race", diagonal)})
        codes = people.sample(linked, 500, np.random.default_rng(0))
        np.testing.assert_array_equal(codes[:, COLUMN["skin"]], codes[:, COLUMN["race"]])
        assert len(np.unique(codes[:, COLUMN["race"]])) == 6

    def test_a_chain_of_tables_has_the_marginal_of_its_product(self):
        shares = {name: ALIKE[name] for name in ("race", "gender", "skin")}
        young = ((0.6, 0.4, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0, 0.0))
        able = ((0.5, 0.5), (0.25, 0.75), (0.1, 0.9), (0.0, 1.0), (0.0, 1.0))
        tables = {"age": Table("gender", young), "disability": Table("age", able)}
        chained = Population("chained", "", (), shares, tables)
        # Child 0.6/3 = 0.2, Teenager 0.4/3, Adult 2/3; Yes = 0.1 + 0.4/12 + 0.2/3 = 0.2.
        assert chained.marginal("age") == pytest.approx((0.2, 0.4 / 3, 2 / 3, 0, 0))
        assert chained.marginal("disability") == pytest.approx((0.2, 0.8))

    @pytest.mark.parametrize("table", [False, True])
    @pytest.mark.parametrize(("draw", "race"), [(0.0, 1), (np.nextafter(1, 0), 3)])
    def test_the_outermost_draws_stay_with_people_who_exist(self, draw, race, table):
        # 0.7 + 0.2 + 0.1 is a little less than 1 in floats: the empty groups after it are close.
        row = (0.0, 0.7, 0.2, 0.1, 0.0, 0.0)
        shares = {**ALIKE, "race": row, "skin": row}
        tables = {"skin": Table("race", (shares.pop("skin"),) * 6)} if table else {}
        edge = Population("edge", "", (), shares, tables)
        rng = SimpleNamespace(random=lambda shape: np.full(shape, draw))
        codes = people.sample(edge, 2, cast(np.random.Generator, rng))
        assert (codes[:, [COLUMN["race"], COLUMN["skin"]]] == race).all()

    def test_same_seed_same_people(self):
        first = people.sample(population("us"), 50, np.random.default_rng(3))
        again = people.sample(population("us"), 50, np.random.default_rng(3))
        other = people.sample(population("us"), 50, np.random.default_rng(4))
        np.testing.assert_array_equal(first, again)
        assert (first != other).any()
        assert first.dtype == np.int64
        assert first.shape == (50, 5)

    def test_the_population_does_not_move_later_random_numbers(self):
        following = []
        for name in people.POPULATIONS:
            rng = np.random.default_rng(5)
            people.sample(population(name), 30, rng)
            following.append(rng.random())
        assert len(set(following)) == 1

    def test_a_population_travels_to_another_process(self):
        sent = pickle.loads(pickle.dumps(population("us")))
        np.testing.assert_array_equal(
            people.sample(sent, 40, np.random.default_rng(1)),
            people.sample(population("us"), 40, np.random.default_rng(1)),
        )


class TestCodes:
    # An Asian boy of skin type IV; a Black woman, middle aged, disabled, of skin type VI.
    CODES = np.array([[3, 1, 0, 1, 3], [1, 0, 3, 0, 5]])

    def test_encode(self):
        onehot = people.encode(self.CODES)
        assert onehot.dtype == np.float32
        assert onehot.shape == (2, 22)
        assert np.flatnonzero(onehot[0]).tolist() == [3, 7, 9, 15, 19]
        assert np.flatnonzero(onehot[1]).tolist() == [1, 6, 12, 14, 21]
        assert set(onehot.ravel().tolist()) == {0.0, 1.0}

    def test_labels_and_back(self):
        named = people.labels(self.CODES)
        assert named == {
            "race": ["Asian", "Black"],
            "gender": ["Male", "Female"],
            "age": ["Child", "Middle Aged"],
            "disability": ["No", "Yes"],
            "skin": ["IV", "VI"],
        }
        np.testing.assert_array_equal(people.codes_of(named), self.CODES)


class TestBadInput:
    def test_an_unknown_population_offers_the_nearest(self):
        with refused("unknown population", "'unifrm'", "'uniform'"):
            population("unifrm")

    def test_nobody_cannot_be_drawn(self):
        with refused("range n", "1"):
            people.sample(population("us"), 0, np.random.default_rng(0))

    @pytest.mark.parametrize(
        ("codes", "said"),
        [
            ([[0, 0, 0, 0, 0], [0, 3, 0, 0, 0]], "row 1: 3 is no code of gender, .* 0 to 2"),
            ([[-1, 0, 0, 0, 0]], "row 0: -1 is no code of race"),
            ([[0, 0, 0, 0]], r"shape \[n, 5\], not \[1, 4\]"),
            ([0, 0, 0, 0, 0], r"shape \[n, 5\], not \[5\]"),
            ([[0.0, 1.0, 0.0, 0.0, 0.0]], "integer codes, not float64"),
        ],
    )
    @pytest.mark.parametrize("use", [people.encode, people.labels])
    def test_codes_that_stand_for_nobody(self, use, codes, said):
        with pytest.raises(InputError, match=said):
            use(np.array(codes))

    @pytest.mark.parametrize(
        ("changed", "said"),
        [
            ({"race": ["White", "Blck"]}, "unknown race in row 1 'Blck': did you mean 'Black'"),
            ({"race": ["White", None]}, "unknown race in row 1 'None'"),
            ({"gendre": ["Male", "Male"]}, "unknown identity 'gendre': did you mean 'gender'"),
            ({"gender": ["Male"]}, "same people: rows are race 2, gender 1, age 2"),
        ],
    )
    def test_labels_that_name_nobody(self, changed, said):
        good = people.labels(np.zeros((2, 5), dtype=np.int64))
        with pytest.raises(InputError, match=said):
            people.codes_of({**good, **changed})

    def test_labels_without_an_identity(self):
        named = people.labels(np.zeros((2, 5), dtype=np.int64))
        del named["age"]
        with refused("missing age", "'age'"):
            people.codes_of(named)

    @pytest.mark.parametrize(
        ("changed", "said"),
        [
            ({"gender": (0.5, 0.4, 0.2)}, "population 'made', gender: .* sum to 1, .* 1.1"),
            ({"gender": (1.5, -0.5, 0.0)}, "gender: shares must be numbers of at least 0"),
            ({"gender": (float("nan"), 0.5, 0.5)}, "gender: shares must be numbers"),
            ({"gender": (0.5, 0.5)}, "gender: 3 shares are needed, .* 2 are given"),
            ({"gender": None}, "shares or a table for 'gender'"),
            ({"sex": (0.5, 0.5)}, "unknown identity in population 'made' 'sex'"),
        ],
    )
    def test_impossible_shares(self, changed, said):
        with pytest.raises(InputError, match=said):
            made(**changed)

    @pytest.mark.parametrize(
        ("table", "said"),
        [
            (Table("skin", ((0.5, 0.5),) * 6), r"on 'skin', only on .* \(race, gender, age\)"),
            (Table("age", ((0.5, 0.5),) * 4), "'disability' needs 5 rows, .* and has 4"),
            (Table("age", ((0.5, 0.6),) * 5), "disability given Child: shares must sum to 1"),
        ],
    )
    def test_impossible_tables(self, table, said):
        shares = {name: row for name, row in ALIKE.items() if name != "disability"}
        with pytest.raises(InputError, match=said):
            Population("made", "", (), shares, {"disability": table})

    def test_shares_and_a_table_for_one_identity(self):
        table = Table("age", ((0.5, 0.5),) * 5)
        with refused("conflict disability", "'disability'"):
            Population("made", "", (), ALIKE, {"disability": table})

    def test_a_marginal_of_nothing_known(self):
        with refused("unknown identity", "'disability'"):
            population("us").marginal("disabilty")
