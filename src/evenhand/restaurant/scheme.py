"""The restaurant's scheme: five identities, the paper's four issues and the facts behind them."""

from __future__ import annotations

from evenhand.methods.scheme import paper_scheme
from evenhand.restaurant import people

SCHEME = paper_scheme(people.IDENTITIES)
