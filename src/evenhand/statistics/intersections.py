"""Rates of tiny intersections, such as elder Black women: shrunk towards what is common to all.

With a thousand combinations of identities most have a handful of services, and the most extreme
raw rates are those of the smallest. A beta-binomial model says what the rates have in common: each
is drawn from Beta(a, b), fitted to all combinations (empirical Bayes). Every rate is shown with its
raw number of services beside it. The intervals take a and b as known, so that they are somewhat
too narrow when there are few combinations.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import betaln, expit, logit

from evenhand.core.errors import InputError
from evenhand.statistics.chance import check_level

PRECISION = (0.1, 1e5)
"""Least and greatest a + b: nothing in common, and all rates the same."""


@dataclass(frozen=True, eq=False)
class ShrunkRates:
    """Rates of the issue in each of M combinations, shrunk towards what they have in common.

    Attributes:
        rate: posterior mean, [M].
        low: lower limit of the equal-tailed posterior interval.
        high: upper limit.
        raw: cases / n, [M]; NaN where n is 0.
        n: services, [M].
        a: first number of the prior.
        b: second number of the prior; a + b is worth so many services.
    """

    rate: np.ndarray
    low: np.ndarray
    high: np.ndarray
    raw: np.ndarray
    n: np.ndarray
    a: float
    b: float


def fit_prior(cases: np.ndarray, n: np.ndarray) -> tuple[float, float]:
    """The Beta(a, b) that makes the counts most probable.

    Maximises Σ log B(x + a, n − x + b) − log B(a, b) over the mean and the precision a + b, the
    precision within ``PRECISION``, the mean within what half an issue more or less would give, so
    that an issue that was never or always seen does not count as impossible or certain.

    Args:
        cases: services with the issue, [M].
        n: services, [M].

    Raises:
        InputError: for impossible counts, or fewer than two combinations with services.
    """
    x, size = _checked(cases, n)
    if (size > 0).sum() < 2:
        raise InputError(
            "empty combinations",
            "fewer than two combinations have services: there is nothing in common to learn from",
        )
    edge = 0.5 / (size.sum() + 1)
    bounds = [(logit(edge), logit(1 - edge)), tuple(np.log(PRECISION))]

    def cost(point: np.ndarray) -> float:
        mean, precision = expit(point[0]), np.exp(point[1])
        a, b = mean * precision, (1 - mean) * precision
        return float(-(betaln(x + a, size - x + b) - betaln(a, b)).sum())

    from scipy import optimize  # takes long to load

    centre = logit(np.clip(x.sum() / size.sum(), edge, 1 - edge))
    fits = [
        optimize.minimize(cost, [centre, np.log(guess)], method="L-BFGS-B", bounds=bounds)
        for guess in (1.0, 30.0, 1000.0)
    ]
    best = min(fits, key=lambda fit: fit.fun).x
    mean, precision = float(expit(best[0])), float(np.exp(best[1]))
    return mean * precision, (1 - mean) * precision


def shrink(
    cases: np.ndarray,
    n: np.ndarray,
    level: float = 0.95,
    prior: tuple[float, float] | None = None,
) -> ShrunkRates:
    """Posterior mean (x + a) / (n + a + b) and interval of each combination's rate.

    Args:
        cases: services with the issue, [M].
        n: services, [M]; 0 gives the prior.
        level: of each interval.
        prior: a and b; fitted by :func:`fit_prior` if not given.

    Raises:
        InputError: for impossible counts; as :func:`fit_prior` if it is asked; for a prior that
            is not positive, or a level outside (0, 1).
    """
    check_level("level", level)
    x, size = _checked(cases, n)
    a, b = fit_prior(x, size) if prior is None else prior
    if not (np.isfinite(a) and np.isfinite(b) and a > 0 and b > 0):
        raise InputError("range prior", f"prior ({a}, {b}) is not positive and finite")
    from scipy import stats  # takes long to load

    tail = (1 - level) / 2
    return ShrunkRates(
        rate=(x + a) / (size + a + b),
        low=stats.beta.ppf(tail, x + a, size - x + b),
        high=stats.beta.isf(tail, x + a, size - x + b),
        raw=x / np.where(size > 0, size, np.nan),
        n=size,
        a=a,
        b=b,
    )


def _checked(cases: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x, size = np.asarray(cases, float), np.asarray(n, float)
    if x.shape != size.shape or not (np.isfinite(x) & np.isfinite(size)).all():
        raise InputError(
            "shape cases", "cases and services do not match or are not finite: give one pair a cell"
        )
    if (x < 0).any() or (x > size).any():
        raise InputError(
            "range cases", "a combination has fewer services than issues, or fewer than 0"
        )
    return x, size
