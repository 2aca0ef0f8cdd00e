"""The paper: issues (Definitions 1-4), scores, detector, rewards and losses (Eq. 1-8)."""
