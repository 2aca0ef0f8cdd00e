"""Judgement for environments of other people: wrap one, say what its episodes are as services.

``Scheme`` says who is compared and what can go wrong, a facts function tells the facts of ended
episodes, and ``JudgeServices`` or ``JudgeVectorServices`` write them down, score windows of them,
judge these by a detector, and shape rewards by guidance. ``report`` writes a page of it.
"""

from __future__ import annotations

from evenhand.adapters.ended import Ended, FactsOf
from evenhand.adapters.ledger import Ledger, Windows
from evenhand.adapters.people import Sampler, invented
from evenhand.adapters.shaping import JudgeSettings
from evenhand.adapters.wrappers import JudgeServices, JudgeVectorServices
from evenhand.schemes import Fact, Identity, Scheme, own_issue, paper_scheme

__all__ = [
    "Ended",
    "Fact",
    "FactsOf",
    "Identity",
    "JudgeServices",
    "JudgeSettings",
    "JudgeVectorServices",
    "Ledger",
    "Sampler",
    "Scheme",
    "Windows",
    "invented",
    "own_issue",
    "paper_scheme",
]
