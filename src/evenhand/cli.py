"""The command line: find the command, parse, call, and say in one sentence what went wrong."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from evenhand.errors import InputError, nearest

COMMANDS = {
    "reproduce": ("Reproduce", "run the paper's whole experiment and write its report"),
    "train": ("Train", "train one robot in a run folder; run it again to resume"),
    "evaluate": ("Evaluate", "test a trained or a scripted robot on people it never saw"),
    "demos": ("Demos", "let scripted robots serve, and simulated respondents judge them"),
    "detect": ("", "fit the detector to judgements, or judge services and issue scores"),
    "bench": ("Bench", "measure the speed of the environment and of an epoch"),
}
DETECT = {
    "fit": ("DetectFit", "fit the detector to a table of judgements"),
    "judge": ("DetectJudge", "judge a table of services, or four issue scores"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``evenhand``.

    Args:
        arguments: after the program's name; those of this process by default.

    Returns:
        Exit code: 0 when all went well, 2 for wrong input, 130 after Ctrl-C.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        return _dispatch(words)
    except InputError as error:
        print(f"evenhand: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(
            "evenhand: stopped; what was finished is kept, the same command goes on from there",
            file=sys.stderr,
        )
        return 130
    except BrokenPipeError:  # the reader of our output has gone, for instance `head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _dispatch(words: list[str]) -> int:
    if not words or words[0] in ("-h", "--help", "help"):
        print(_overview("evenhand", "Robots that serve people evenly.", COMMANDS))
        return 0
    if words[0] in ("-V", "--version"):
        from evenhand import __version__

        print(f"evenhand {__version__}")
        return 0
    table, program = COMMANDS, "evenhand"
    name, rest = words[0], words[1:]
    if name == "detect":
        if not rest or rest[0] in ("-h", "--help"):
            print(_overview("evenhand detect", "The bias detector (Eq. 3).", DETECT))
            return 0
        table, program, name, rest = DETECT, "evenhand detect", rest[0], rest[1:]
    if name not in table:
        guess = nearest(name, table)
        hint = f"did you mean {guess!r}? " if guess else ""
        raise InputError(
            f"unknown command {program.removeprefix('evenhand').strip()} {name!r}: ".replace(
                "command  ", "command "
            )
            + f"{hint}choose one of {', '.join(table)}"
        )
    return _run(table[name][0], f"{program} {name}", rest)


def _run(command: str, program: str, words: list[str]) -> int:
    import tyro

    from evenhand import commands

    # tyro ends with code 2 and a message of its own when the words cannot be parsed
    parsed = tyro.cli(getattr(commands, command), prog=program, args=words)
    return parsed.run(" ".join([program, *words]))


def _overview(program: str, line: str, table: dict[str, tuple[str, str]]) -> str:
    rows = "\n".join(f"  {name:<10} {text}" for name, (_, text) in table.items())
    return (
        f"{line}\n\nusage: {program} COMMAND [options]\n\n{rows}\n\n"
        f"`{program} COMMAND --help` tells the options of a command."
    )
