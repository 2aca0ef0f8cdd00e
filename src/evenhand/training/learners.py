"""What learns, by name: an algorithm, and which answers it credits."""

from __future__ import annotations

from collections.abc import Mapping

LEARNERS: Mapping[str, tuple[str, str]] = {
    "ppo": ("ppo", "sampled"),
    "reinforce": ("reinforce", "sampled"),
    "ppo-all": ("ppo", "all_answers"),
    "reinforce-all": ("reinforce", "all_answers"),
}
"""Algorithm and credit of ``training.update.UpdateSettings``."""
LABELS = {
    "ppo": "PPO",
    "reinforce": "REINFORCE",
    "ppo-all": "PPO, all answers",
    "reinforce-all": "REINFORCE, all answers",
}
"""For readers."""
