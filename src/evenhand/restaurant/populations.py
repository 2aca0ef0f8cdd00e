"""Published shares of people, as numbers; ``evenhand.restaurant.people`` gives them their meaning.

What a source does not say is said here to be an assumption. Every description and source below
is shown to users, so it must stay true to the numbers beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np


class Preset(NamedTuple):
    """The numbers of one population.

    Attributes:
        name: how a user asks for it.
        description: who it stands for, what was assumed and what was borrowed.
        sources: where the numbers are from.
        percent: identity → percentages as printed, in the order of its categories; rounding may
            leave their sum a little off 100. An identity that is neither here nor in ``tables``
            has every category alike.
        tables: identity → (identity that it depends on, one row of percentages for each category
            of that one).
    """

    name: str
    description: str
    sources: tuple[str, ...]
    percent: Mapping[str, tuple[float, ...]]
    tables: Mapping[str, tuple[str, tuple[tuple[float, ...], ...]]]


class Span(NamedTuple):
    """A number for the ages from ``first`` to ``last``, both included."""

    first: int
    last: int
    percent: float


# The five bands of the paper have no ages there. These bounds are the ones at which FairFace's
# age labels can be cut: child 0–9, teenager 10–19, adult 20–39, middle aged 40–59, elder 60+.
AGE_BANDS = ((0, 9), (10, 19), (20, 39), (40, 59), (60, 99))

# Shares of the population. The source has one band from 65 on; it is cut at 75, where disability
# rates jump. 60:40 is the round cut with which overall disability meets the published 13.6 %.
US_65_PLUS = 18.5
US_AGES = (
    Span(0, 14, 18.1),
    Span(15, 64, 63.4),
    Span(65, 74, 0.6 * US_65_PLUS),
    Span(75, 99, 0.4 * US_65_PLUS),
)

# Rates of disability within each span of ages.
US_DISABILITY = (
    Span(0, 4, 0.8),
    Span(5, 17, 5.4),
    Span(18, 34, 6.0),
    Span(35, 64, 12.9),
    Span(65, 74, 25.4),
    Span(75, 99, 50.0),
)

# How many of FairFace's 97,698 labelled faces carry each race label.
FAIRFACE_FACES = {
    "White": 18_612,
    "Latino": 14_990,
    "East Asian": 13_837,
    "Indian": 13_835,
    "Black": 13_789,
    "Southeast Asian": 12_210,
    "Middle Eastern": 10_425,
}

GENDER_OTHER = 1.6


def share_by_age() -> np.ndarray:
    """Share of each single year of age in ``us``, people spread evenly within a source band.

    Returns:
        float [100], for the ages 0 to 99; sums to 100 (percent).
    """
    years = np.zeros(100)
    for first, last, percent in US_AGES:
        years[first : last + 1] = percent / (last - first + 1)
    return years


def age_percent() -> tuple[float, ...]:
    """Share of each of the five age bands in ``us``, in percent."""
    years = share_by_age()
    return tuple(float(years[first : last + 1].sum()) for first, last in AGE_BANDS)


def disability_rows() -> tuple[tuple[float, ...], ...]:
    """Percentages (yes, no) of disability for each of the five age bands.

    A band that spans several source bands gets their rates, weighted by its people's ages.
    """
    years = share_by_age()
    rate = np.zeros(100)
    for first, last, percent in US_DISABILITY:
        rate[first : last + 1] = percent
    rows = []
    for first, last in AGE_BANDS:
        band = slice(first, last + 1)
        yes = float(np.average(rate[band], weights=years[band]))
        rows.append((yes, 100.0 - yes))
    return tuple(rows)


def fairface_race() -> tuple[float, ...]:
    """FairFace's seven race labels as the paper's six categories, in percent."""
    faces = FAIRFACE_FACES
    asian = faces["East Asian"] + faces["Southeast Asian"] + faces["Indian"]
    other = faces["Latino"] + faces["Middle Eastern"]
    counts = (faces["White"], faces["Black"], 0, asian, 0, other)
    return tuple(100 * count / sum(counts) for count in counts)


ACS_DISABILITY = "American Community Survey 2023, disability by age (overall 13.6 %)"
PEW_GENDER = "Pew Research Center 2022, adults who are transgender or nonbinary: 1.6 %"

UNIFORM = Preset(
    "uniform",
    "Every category of an identity alike, identities independent of each other: the paper draws "
    "identities at random and says no more. It stands for no real population.",
    ("the paper, section 'Experiment Setting'",),
    percent={},
    tables={},
)

US = Preset(
    "us",
    "The United States, as far as published shares say. Race: people of several races are counted "
    "as Other. Gender: the share of Other is of adults and a proxy; the rest is halved. Age: the "
    "source has 0–14, 15–64 and 65+; people are spread evenly within these, 65+ 60:40 below and "
    "from 75, and cut at 10, 20, 40 and 60. Disability depends on age; a band that spans several "
    "bands of the source gets their weighted mean; overall 13.6 % comes out, as published. Skin: "
    "the source has I with II, III, and the rest; each is split alike. Race and skin type are "
    "independent here: they are weakly related (kappa 0.53), but no source gives the table.",
    (
        "American Community Survey, race alone or several, from a secondary page",
        PEW_GENDER,
        "CIA World Factbook 2024, age structure of the United States",
        ACS_DISABILITY,
        "StatPearls, Fitzpatrick skin types in the United States: I and II 35 %, III 48 %",
        "PMC4165764, race and skin type, kappa 0.53, n = 3,386 (not modelled)",
    ),
    percent={
        "race": (68.2, 12.6, 0.8, 5.7, 0.2, 12.6),
        "gender": ((100 - GENDER_OTHER) / 2, (100 - GENDER_OTHER) / 2, GENDER_OTHER),
        "age": age_percent(),
        "skin": (17.5, 17.5, 48.0, 17 / 3, 17 / 3, 17 / 3),
    },
    tables={"disability": ("age", disability_rows())},
)

FAIRFACE = Preset(
    "fairface",
    "The faces of the FairFace data set, which balances races on purpose: it stands for that data "
    "set, not for a country. Race: East Asian, Southeast Asian and Indian are counted as Asian, "
    "Latino and Middle Eastern as Other; American Indian and Native Hawaiian have no label, so "
    "nobody is drawn from them. Age: the nine labels put together, cut at 10, 20, 40 and 60. "
    "Borrowed, because FairFace lacks them: gender Other and disability by age from us, skin types "
    "alike as in uniform. Identities are otherwise independent.",
    (
        "FairFace (Kärkkäinen and Joo), both label files, 97,698 faces, CC BY 4.0",
        PEW_GENDER,
        ACS_DISABILITY,
    ),
    percent={
        "race": fairface_race(),
        # 53.0 % of the faces are labelled male.
        "gender": (47.0 * (1 - GENDER_OTHER / 100), 53.0 * (1 - GENDER_OTHER / 100), GENDER_OTHER),
        "age": (14.1, 10.5, 51.7, 19.6, 4.2),
    },
    tables={"disability": ("age", disability_rows())},
)

PRESETS = (UNIFORM, US, FAIRFACE)
