"""Reads what Weights & Biases wrote offline, without its own reader: a log in LevelDB's format.

Blocks of 32 KiB hold records: a masked CRC-32C, a length of two bytes, and a kind (whole, first,
middle or last part); the file begins with seven bytes of its own.
"""

import importlib
import json
import struct
from pathlib import Path
from typing import Any

# its classes are made when it is imported, which no type checker sees
_PROTO: Any = importlib.import_module("wandb.proto.wandb_internal_pb2")
_BLOCK, _HEADER = 32768, 7
_WHOLE, _FIRST, _LAST = 1, 2, 4


def records(path: Path) -> list[Any]:
    """Every record of a ``.wandb`` file, in order."""
    content = path.read_bytes()
    assert content[:4] == b":W&B"
    at, found, part = _HEADER, [], b""
    while at < len(content):
        if _BLOCK - at % _BLOCK < _HEADER:  # the rest of a block is filled up
            at += _BLOCK - at % _BLOCK
            continue
        _, length, kind = struct.unpack("<IHB", content[at : at + _HEADER])
        at += _HEADER
        part = (
            content[at : at + length] if kind in (_WHOLE, _FIRST) else part + content[at:][:length]
        )
        at += length
        if kind in (_WHOLE, _LAST):
            found.append(_PROTO.Record.FromString(part))
    return found


def history(path: Path) -> list[dict[str, Any]]:
    """What was logged, a row a step, with ``_step``."""
    rows = []
    for record in records(path):
        if record.WhichOneof("record_type") == "history":
            items = record.history.item
            row = {
                item.key or "/".join(item.nested_key): json.loads(item.value_json) for item in items
            }
            rows.append({"_step": record.history.step.num} | row)
    return rows
