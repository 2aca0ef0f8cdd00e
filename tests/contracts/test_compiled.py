"""Compiled functions: machine code is kept by the age of one file, so nothing of another is in it.

A constant or a function of another file could change while the old machine code goes on running.
"""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2] / "src"
MARKS = ("compiled", "_compiled", "njit")
FOREIGN = ("numpy", "math", "cmath", "numba", "typing")
"""What a compiled function may use of other packages: it changes with their version only."""


def compiled_functions() -> list[tuple[Path, ast.FunctionDef]]:
    """Every function that is compiled, and where."""
    found = []
    for path in sorted(ROOT.rglob("*.py")):
        tree = ast.parse(path.read_text())
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and any(
                isinstance(name, ast.Name) and name.id in MARKS
                for mark in node.decorator_list
                for name in ast.walk(mark)
            ):
                found.append((path, node))
    return found


def used(function: ast.FunctionDef) -> set[str]:
    """Names that it reads and does not bind itself; types of its arguments do not run."""
    bound = {arg.arg for arg in ast.walk(function.args) if isinstance(arg, ast.arg)}
    read: set[str] = set()
    for statement in function.body:
        for node in ast.walk(statement):
            if isinstance(node, ast.Name):
                (bound if isinstance(node.ctx, ast.Store) else read).add(node.id)
    return read - bound


def imported_from(path: Path) -> dict[str, str]:
    """Name -> module that it comes from, of every import of a file."""
    found = {}
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {(a.asname or a.name).split(".")[0]: a.name for a in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {a.asname or a.name: str(node.module) for a in node.names}
    return found


FUNCTIONS = compiled_functions()


def test_there_are_compiled_functions():
    assert len(FUNCTIONS) >= 10


@pytest.mark.parametrize(
    ("path", "function"), FUNCTIONS, ids=[f"{p.stem}.{f.name}" for p, f in FUNCTIONS]
)
def test_a_compiled_function_uses_nothing_of_another_file(path, function):
    origins = imported_from(path)
    foreign = {name: origins[name] for name in used(function) if name in origins}
    assert {n: m for n, m in foreign.items() if m.split(".")[0] not in FOREIGN} == {}


def test_the_rule_is_broken_where_it_should_be(tmp_path):
    path = tmp_path / "room.py"
    path.write_text(
        "from evenhand.restaurant import floor_plan\n@compiled\ndef f(x):\n"
        "    y = floor_plan.TIMESTEP\n"
        "    return x + y\n"
    )
    function = ast.parse(path.read_text()).body[1]
    assert isinstance(function, ast.FunctionDef)
    assert used(function) == {"floor_plan"}
    assert imported_from(path) == {"floor_plan": "evenhand.restaurant"}
