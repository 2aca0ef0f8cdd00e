"""Pages from templates: what comes from outside is escaped, a forgotten name is an error."""

from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined


def fill(template: str, *folders: Path, **context: Any) -> str:
    """A page from a template.

    Args:
        template: name of its file.
        *folders: where it and what it includes are looked for, in order.
        **context: what its names stand for.
    """
    environment = Environment(
        loader=FileSystemLoader(folders),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(template).render(**context)
