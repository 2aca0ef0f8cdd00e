"""Judgement for environments of other people: wrap one, say what its episodes are as services.

``Scheme`` says who is compared and what can go wrong, a facts function tells the facts of ended
episodes, and ``JudgeServices`` or ``JudgeVectorServices`` write them down, score windows of them,
judge these by a detector, and shape rewards by guidance. ``report`` writes a page of it.
"""

from __future__ import annotations

from evenhand.adapters.episodes import Ended, FactsOf
from evenhand.adapters.guidance import JudgeSettings
from evenhand.adapters.ledger import Ledger, Windows
from evenhand.adapters.sampler import Sampler, invented
from evenhand.adapters.wrappers import JudgeServices, JudgeVectorServices
from evenhand.methods.scheme import Fact, Identity, Scheme, own_issue, paper_scheme

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
