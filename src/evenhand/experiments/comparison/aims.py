"""Room: the aims of the comparison. Takes: estimates. Gives: reached, not reached, cannot be told.

Pure. The measured number decides, as the aims are worded; only "not lower" asks for an interval,
since a wide one would always pass. Where the interval of a decided number holds the limit, the
verdict says that these seeds do not settle it. One seed decides nothing.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan, nan

from evenhand.core.wording import percent
from evenhand.report.table import say
from evenhand.statistics.means import Estimate

REACHED, MISSED, UNKNOWN = "reached", "not reached", "cannot be told"
STATES = (REACHED, MISSED, UNKNOWN)
SHARE, LEAST_SHARE = 0.8, 0.75
"""Of the attainable reduction of the corrected total, and its lower end."""
ALIKE = 0.02
"""Two corrected totals whose difference lies within this are alike: half a point in each issue,
less than anybody sees in a robot."""
HALF = 0.5
"""Of the corrected total of service alone, where that much is attainable."""
POINT = -0.01
"""Above this the interval of the difference in perfect services has to lie."""
FEWER = 0.9
"""Biased epochs in training, where the policy begins prejudiced."""
EIGHT = (
    "even", "prejudiced", "perception", "minority", "tips", "everyday", "hidden", "hurry",
)  # fmt: skip
"""Scenarios that the aim for the hypervolume counts."""
MOST = 6
"""Of these eight."""
SCARCE = ("hidden", "hurry")
"""Scenarios in which nobody can serve all well: there evenness is a question of its own."""
ONE_SEED = "one seed has no interval"


@dataclass(frozen=True)
class Verdict:
    """What an aim came to.

    Attributes:
        state: one of ``STATES``.
        number: what the aim is about, with its interval as far as there is one.
        why: a few words: what else belongs to the number, or why nothing can be told.
    """

    state: str
    number: Estimate
    why: str = ""


def evenness(share: Estimate, service: float, found: float, reference: float) -> Verdict:
    """At least 80 % of what is attainable (lower end 75 %), and half less where that can be.

    Args:
        share: of the way from service alone to the reference robot, 1 is all of it.
        service: corrected total of training on service alone.
        found: corrected total of the method.
        reference: corrected total of the reference robot, which shows what is attainable.
    """
    if service <= reference:
        return Verdict(UNKNOWN, share, "nothing to attain: service alone is as even as that robot")
    if isnan(share.mean) or isnan(found) or isnan(service) or isnan(reference):
        return Verdict(UNKNOWN, share, "a number is missing")
    if isnan(share.low):
        why = "chance alone may be all there is to attain" if share.n > 1 else ONE_SEED
        return Verdict(UNKNOWN, share, why)
    words = [_unsettled(share.low < SHARE <= share.high, f"{100 * SHARE:.0f}\N{NO-BREAK SPACE}%")]
    enough = share.mean >= SHARE and share.low >= LEAST_SHARE
    if service > 0:
        lower, attainable = 1 - found / service, 1 - reference / service
        way = "lower" if lower >= 0 else "higher"
        words.insert(0, f"{percent(abs(lower))} {way} than service alone")
        if attainable >= HALF:
            enough = enough and lower >= HALF
        else:
            words.insert(1, f"{percent(attainable)} at most")
    return Verdict(REACHED if enough else MISSED, share, _joined(words))


def perfect(difference: Estimate) -> Verdict:
    """Not lower: the whole interval lies above −1 point.

    Args:
        difference: of the shares of perfect services, method minus service alone.
    """
    if isnan(difference.mean):
        return Verdict(UNKNOWN, difference, "a number is missing")
    if isnan(difference.low):
        return Verdict(UNKNOWN, difference, ONE_SEED)
    if difference.low > POINT:
        return Verdict(REACHED, difference)
    if difference.mean <= POINT:
        held = difference.high > POINT
        return Verdict(MISSED, difference, "not settled: the interval goes above" if held else "")
    return Verdict(UNKNOWN, difference, "the interval goes below \N{MINUS SIGN}1 point")


def against_blind(difference: Estimate, perfect: Estimate, scarce: bool) -> Verdict:
    """Not less even than a cost without groups; where time or knowledge is scarce, more even.

    Args:
        difference: of the corrected totals, method minus the cost without groups.
        perfect: of the shares of perfect services, likewise.
        scarce: whether the method has to be more even, at perfect services within 1 point.
    """
    if isnan(difference.mean):
        return Verdict(UNKNOWN, difference, "a number is missing, or blind was not run")
    if isnan(difference.low):
        return Verdict(UNKNOWN, difference, ONE_SEED)
    if difference.low > 0.0:
        return Verdict(MISSED, difference, "less even than a cost without groups")
    if not scarce:
        alike = difference.high < ALIKE
        why = "" if alike else f"the interval goes above {ALIKE:g}"
        return Verdict(REACHED if alike else UNKNOWN, difference, why)
    if difference.high >= 0.0:
        return Verdict(MISSED, difference, "a cost without groups may do as well")
    if isnan(perfect.mean):
        return Verdict(UNKNOWN, difference, "a number is missing")
    if perfect.mean < POINT:
        return Verdict(MISSED, difference, f"{percent(-perfect.mean)} fewer perfect services")
    return Verdict(REACHED, difference)


def biased(service: Estimate, found: Estimate) -> Verdict:
    """At least 90 % fewer epochs of training that the detector judges as biased.

    Returns:
        With the share by which they are fewer; it has no interval.
    """
    n = min(service.n, found.n)
    if isnan(service.mean) or isnan(found.mean):
        return Verdict(UNKNOWN, Estimate(nan, nan, nan, n), "a number is missing")
    words = f"{service.mean:.1f} with service alone, {found.mean:.1f} with this"
    if service.mean <= 0:
        return Verdict(UNKNOWN, Estimate(nan, nan, nan, n), f"nothing to lower: {words}")
    fewer = Estimate(1 - found.mean / service.mean, nan, nan, n)
    if n < 2:
        return Verdict(UNKNOWN, fewer, f"{words}; {ONE_SEED}")
    return Verdict(REACHED if fewer.mean >= FEWER else MISSED, fewer, words)


def hypervolume(own: Estimate, rivals: Mapping[str, Estimate]) -> Verdict:
    """At least that of every rival."""
    known = {name: one for name, one in rivals.items() if not isnan(one.mean)}
    if isnan(own.mean) or not known:
        return Verdict(UNKNOWN, own, "no rival" if not rivals else "a number is missing")
    name, best = max(known.items(), key=lambda pair: pair[1].mean)
    words = [f"best rival {name} {say(best.mean)}"]
    if say(own.mean) == say(best.mean) and own.mean != best.mean:
        way = "higher" if best.mean > own.mean else "lower"
        words = [f"{words[0]}, {way} by {abs(best.mean - own.mean):.1g}"]
    if min(own.n, best.n) < 2:
        return Verdict(UNKNOWN, own, _joined([*words, ONE_SEED]))
    if own.mean >= best.mean and len(known) < len(rivals):
        return Verdict(UNKNOWN, own, _joined([*words, "a rival's number is missing"]))
    if own.low <= best.high and best.low <= own.high:
        words.append("intervals overlap")
    return Verdict(REACHED if own.mean >= best.mean else MISSED, own, _joined(words))


def in_most(states: Mapping[str, str]) -> Verdict:
    """An aim for at least six of the eight scenarios.

    Args:
        states: by scenario; one that was not run counts as one that cannot be told, and one that
            is none of the eight does not count.

    Returns:
        With the number of scenarios in which it is reached.
    """
    found = [states.get(name, UNKNOWN) for name in EIGHT]
    reached, unknown = found.count(REACHED), found.count(UNKNOWN)
    state = UNKNOWN
    if reached >= MOST:
        state = REACHED
    elif reached + unknown < MOST:
        state = MISSED
    why = f"cannot be told in {unknown}" if unknown else ""
    return Verdict(state, Estimate(float(reached), nan, nan, len(EIGHT)), why)


def _unsettled(held: bool, limit: str) -> str:
    """A remark where the interval holds the limit, so that other seeds may say otherwise."""
    return f"not settled: the interval holds {limit}" if held else ""


def _joined(words: list[str]) -> str:
    return "; ".join(word for word in words if word)
