"""The restaurant's scheme: five identities, the paper's four issues and the facts behind them."""

from __future__ import annotations

from evenhand.methods.scheme import Identity, paper_scheme
from evenhand.restaurant import people

SCHEME = paper_scheme([Identity(one.name, one.categories) for one in people.IDENTITIES])
