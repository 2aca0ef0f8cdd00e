"""Tables of an older version are brought to this one, after a backup."""

from collections.abc import Callable, Mapping

from sqlalchemy import Connection, inspect, select, update

from evenhand.core.errors import InputError
from evenhand.study.server import schema

Step = Callable[[Connection], None]
STEPS: Mapping[int, Step] = {}
"""Version -> what makes tables of the next one of it. The first version has nothing before it."""


def version(connection: Connection) -> int | None:
    """Version of the tables that are there; None where there are none.

    Raises:
        InputError: when the tables are not those of a study.
    """
    if not inspect(connection).has_table(schema.about.name):
        return None
    found = connection.scalar(select(schema.about.c.value).where(schema.about.c.key == "version"))
    if found is None or not found.isdigit():
        raise InputError(
            "format database",
            f"the database has a table {schema.about.name} without a version: it is damaged, "
            "restore a backup or give another --db",
        )
    return int(found)


def check(found: int, name: str) -> None:
    """Refuse what this version of Evenhand cannot bring up to date.

    Raises:
        InputError: for tables of a newer version, or of one too old.
    """
    if found > schema.VERSION:
        raise InputError(
            "changed database",
            f"{name} was written by a newer Evenhand (tables of version {found}, this one knows "
            f"{schema.VERSION}): update Evenhand or give another --db",
        )
    missing = [one for one in range(found, schema.VERSION) if one not in STEPS]
    if missing:
        raise InputError(
            "changed database",
            f"{name} has tables of version {found}, which this Evenhand can no longer bring up to "
            "date: use an older one first",
        )


def upgrade(connection: Connection, found: int) -> None:
    """Take all steps from a version to this one; in one transaction, so all or none."""
    for step in range(found, schema.VERSION):
        STEPS[step](connection)
    key = schema.about.c.key == "version"
    connection.execute(update(schema.about).where(key).values(value=str(schema.VERSION)))
