"""``evenhand example``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from evenhand.core import files
from evenhand.core.errors import InputError, whole
from evenhand.experiments.settings import SEEDS


@dataclass(frozen=True)
class Example:
    """Write a synthetic log of a mixed fleet, to try `evenhand audit` on.

    No person is behind it. By construction children are ignored more often and approached too
    closely, gender makes no difference, and guests in a wheelchair are too few to say anything.
    One site is slower and has more older guests, who seem to wait longer; `--within site` compares
    like with like and shows that within each site they do not.

    For instance: evenhand example fleet.csv
    """

    log: Positional[Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")]] = None
    """Where it goes: .csv or .parquet."""

    services: int = 5000
    """Rows."""

    seed: int = 0
    """Of everything random in it."""

    def run(self, command: str) -> int:
        """Draw and write it, print its path."""
        if self.log is None:
            raise InputError(
                "missing log", "no file is given: name one, as evenhand example fleet.csv"
            )
        import numpy as np
        import pyarrow as pa
        import pyarrow.csv
        import pyarrow.parquet

        from evenhand.audits.example import synthetic_log

        whole("seed", self.seed, *SEEDS)
        if self.log.suffix not in (".csv", ".parquet"):
            raise InputError(
                "format log", f"{self.log} ends neither in .csv nor in .parquet: choose one of them"
            )
        table = synthetic_log(self.services, np.random.default_rng(self.seed))
        out = pa.BufferOutputStream()
        if self.log.suffix == ".csv":
            pyarrow.csv.write_csv(table, out)
        else:
            pyarrow.parquet.write_table(table, out)
        files.make_folder(self.log.parent)
        files.write_bytes(self.log, out.getvalue().to_pybytes())
        print(self.log)
        return 0
