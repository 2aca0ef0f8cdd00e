"""The words of the method, each said once: issues, identities, discriminations, sources."""

NEAREST, FARTHEST = 1.0, 1.5
"""The paper's limits ("Experiment Setting"): proper distances of a response, metres."""
LATE = 200
"""Physics steps after which a response is late."""
RISK = 0.5
"""Distance below which any step is risky, metres."""
WINDOW = 30
"""Services that are scored together: the paper's epoch."""
MANUAL_THRESHOLD = 0.5
"""The paper's manual rule: a total issue score above it is biased."""

ISSUES = ("willingness", "quality", "priority", "risk")
"""The paper's four issues, in the order of Eq. 2."""

IDENTITIES = ("race", "gender", "age", "disability")
"""The identities that respondents are asked about; the paper's study left skin colour out."""

DISCRIMINATIONS = ("racism", "sexism", "ageism", "ableism")
"""What unevenness between the groups of each of ``IDENTITIES`` is called."""

SIMULATED = "simulated respondents"
SOURCES = (SIMULATED, "respondents")
"""Where judgements can come from; told wherever a detector or its evaluation is shown."""


LEAST = 30
"""Services that a group needs before it can be called the one served worst: of many small groups
one has bad luck."""
