"""What every participant made of every set: ratings, and what was named, as arrays.

The rule that makes a judgement of answers is the study's first question of role "fair" about sets:
a rating on the unfair side of the scale's middle is "biased", the middle itself is not. In a study
without such a question a set is judged by what is named: "biased" where an issue or an identity
other than "none" is.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from evenhand.study.analysis.answer_columns import BETWEEN, pc
from evenhand.study.analysis.answers import Answers
from evenhand.study.design.protocol import Protocol, Question

NOTHING = "none"
MISSING, SEVERAL = -1, -2
"""Codes of an answer that is not there, and of one that names several."""


@dataclass(frozen=True, eq=False)
class Judged:
    """What P participants made of S sets.

    Attributes:
        participants: P names.
        sets: S ids, in the order of the study.
        control: bool [S], which are even controls.
        fairness: float64 [P, S], the rating, turned so that 1 is the unfair end; NaN where missing.
        middle: of the scale; NaN where the study asks for no rating.
        issue: int64 [P, S], position in ``issues``, ``MISSING`` or ``SEVERAL``.
        issues: values of the question about the worst issue; empty when it is not asked.
        identity: int64 [P, S], likewise of ``identities``.
        identities: values of the question about whom it was towards.
        place: int64 [P, S], how many sets a participant had seen before, -1 where none was judged.
    """

    participants: tuple[str, ...]
    sets: tuple[str, ...]
    control: NDArray[np.bool_]
    fairness: NDArray[np.float64]
    middle: float
    issue: NDArray[np.int64]
    issues: tuple[str, ...]
    identity: NDArray[np.int64]
    identities: tuple[str, ...]
    place: NDArray[np.int64]

    @property
    def biased(self) -> NDArray[np.float64]:
        """1 where a set was judged biased, 0 where not, NaN where that is not known, [P, S]."""
        if not np.isnan(self.middle):
            unfair = (self.fairness < self.middle).astype(np.float64)
            return np.where(np.isnan(self.fairness), np.nan, unfair)
        named = np.full(self.fairness.shape, np.nan)
        for codes, values in ((self.issue, self.issues), (self.identity, self.identities)):
            one = np.where(codes == MISSING, np.nan, self._names(codes, values))
            named = np.fmax(named, one)
        return named

    def _names(self, codes: NDArray[np.int64], values: tuple[str, ...]) -> NDArray[np.float64]:
        nothing = values.index(NOTHING) if NOTHING in values else len(values)
        return (codes != nothing).astype(np.float64)

    def contradictions(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Sets whose answers contradict each other, and sets where they could, both int64 [P].

        A contradiction is an unfair rating with "none" named throughout, or the fairest rating
        with something named throughout; a middling rating with something named is none.
        """
        asked = [
            (c, v) for c, v in ((self.issue, self.issues), (self.identity, self.identities)) if v
        ]
        if not asked or np.isnan(self.middle):
            nobody = np.zeros(len(self.participants), np.int64)
            return nobody, nobody
        there = ~np.isnan(self.fairness)
        nothing, something = there.copy(), there.copy()
        for codes, values in asked:
            there &= codes != MISSING
            names = self._names(codes, values) == 1
            nothing &= ~names
            something &= names
        fairest = self.fairness == 2 * self.middle - 1
        wrong = ((self.fairness < self.middle) & nothing) | (fairest & something)
        return (wrong & there).sum(axis=1), there.sum(axis=1)


def judge(answers: Answers, study: Protocol) -> Judged:
    """Bring the answers about sets into one place for each participant and set."""
    people, sets = answers.participants, tuple(one.id for one in study.sets)
    rows = answers.where(pc.equal(answers.table["kind"], "set")).table
    who, item = codes(rows["participant"], people), codes(rows["item"], sets)
    shape = (len(people), len(sets))
    known = item >= 0
    fairness, middle = np.full(shape, np.nan), np.nan
    fair = first(study, "fair")
    if fair is not None:
        mine = known & (codes(rows["question"], (fair.id,)) == 0)
        middle = (fair.points + 1) / 2
        rating = numbers(rows["number"])[mine]
        fairness[who[mine], item[mine]] = (
            rating if fair.lowest_is_unfair else fair.points + 1 - rating
        )
    named = {}
    for role in ("issue", "identity"):
        question = first(study, role)
        found, values = np.full(shape, MISSING), ()
        if question is not None:
            values = tuple(option.value for option in question.options)
            mine = known & (codes(rows["question"], (question.id,)) == 0)
            said = rows["value"].filter(pa.array(mine))
            code = codes(said, values)
            several = pc.fill_null(pc.match_substring(said, BETWEEN), False)
            code[np.asarray(several)] = SEVERAL
            found[who[mine], item[mine]] = code
        named[role] = (found, values)
    position = np.full(shape, np.iinfo(np.int64).max)
    position[who[known], item[known]] = numbers(rows["position"])[known].astype(np.int64)
    seen = position < np.iinfo(np.int64).max
    place = np.where(seen, np.argsort(np.argsort(position, axis=1, kind="stable"), axis=1), -1)
    return Judged(
        participants=people,
        sets=sets,
        control=np.array([one.kind == "control" for one in study.sets], dtype=bool),
        fairness=fairness,
        middle=float(middle),
        issue=named["issue"][0],
        issues=named["issue"][1],
        identity=named["identity"][0],
        identities=named["identity"][1],
        place=place.astype(np.int64),
    )


def first(study: Protocol, role: str) -> Question | None:
    """The study's first question of a role about sets."""
    return next((one for one in study.asked("set") if one.role == role), None)


def codes(column: Any, values: tuple[str, ...]) -> NDArray[np.int64]:
    """Position of each cell among values, -1 where it is missing or none of them, int64 [n]."""
    found = pc.index_in(column, pa.array(values, pa.string()))
    return np.asarray(pc.fill_null(found, MISSING), dtype=np.int64).copy()


def numbers(column: Any) -> NDArray[np.float64]:
    """A column of numbers, NaN where one is missing, float64 [n]."""
    return np.asarray(pc.fill_null(column.cast(pa.float64()), np.nan), dtype=np.float64)
