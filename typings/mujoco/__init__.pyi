# MuJoCo's wheel brings no types for its compiled half: every name of it is Any.
from typing import Any

def __getattr__(name: str) -> Any: ...
