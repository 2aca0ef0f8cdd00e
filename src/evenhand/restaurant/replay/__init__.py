"""Replay: recorded services as one page that needs nothing else.

recording + table → payload (looks, services) → template + built script → one HTML file.
The page draws the same shapes as MuJoCo does: they are read from the dressed model.
"""

from evenhand.restaurant.replay.page import write
from evenhand.restaurant.replay.services import MOST, choose

__all__ = ["MOST", "choose", "write"]
