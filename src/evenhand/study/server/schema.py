"""The tables of a study's database."""

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    Text,
    UniqueConstraint,
)

VERSION = 1
"""Of these tables; ``migrate`` brings older ones here."""

metadata = MetaData()

about = Table(
    "study_about",
    metadata,
    Column("key", String(40), primary_key=True),
    Column("value", Text, nullable=False),
)
"""Version of the tables, the study they belong to, and whether it is closed."""

participants = Table(
    "study_participants",
    metadata,
    Column("participant", String(8), primary_key=True),
    Column("token", String(64), nullable=False, unique=True),
    Column("simulated", Boolean, nullable=False),
    Column("preview", Boolean, nullable=False),
    Column("consent_version", String(40), nullable=False),
    Column("order_number", Integer, nullable=False),
    Column("status", String(10), nullable=False),
    Column("began", BigInteger, nullable=False),
    Column("seen", BigInteger, nullable=False),
    Column("finished", BigInteger),
    Index("study_filled", "status", "order_number"),
)
"""One row a participant. ``token`` is a SHA-256; times are milliseconds of UTC since 1970."""

external = Table(
    "study_external",
    metadata,
    Column("participant", ForeignKey("study_participants.participant"), primary_key=True),
    Column("prolific_pid", String(100)),
    Column("study_id", String(100)),
    Column("session_id", String(100)),
    UniqueConstraint("prolific_pid", "study_id"),
)
"""Ids of a recruiting platform, apart from everything else."""

pages = Table(
    "study_pages",
    metadata,
    Column("participant", ForeignKey("study_participants.participant"), primary_key=True),
    Column("page", String(50), primary_key=True),
    Column("key", String(36), nullable=False),
    Column("digest", String(64), nullable=False),
    Column("position", Integer, nullable=False),
    Column("sequence", Integer, nullable=False),
    Column("shown_ms", BigInteger, nullable=False),
    Column("clip_views", Text, nullable=False),
    Column("browser_clock", String(40), nullable=False),
    Column("received", BigInteger, nullable=False),
    UniqueConstraint("participant", "key"),
)
"""One row an answered page. Its primary key is why no answer can be stored twice."""

answers = Table(
    "study_answers",
    metadata,
    Column("participant", ForeignKey("study_participants.participant"), primary_key=True),
    Column("page", String(50), primary_key=True),
    Column("question", String(40), primary_key=True),
    Column("place", Integer, nullable=False),
    Column("kind", String(10), nullable=False),
    Column("item", String(40)),
    Column("role", String(10), nullable=False),
    Column("type", String(10), nullable=False),
    Column("value", Text),
    Column("number", Float),
    Column("right", Boolean),
)
"""One row an answered question."""

ALL = (about, participants, external, pages, answers)
