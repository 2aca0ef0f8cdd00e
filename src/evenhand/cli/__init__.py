"""The command line: find the command, parse, call, and say in one sentence what went wrong."""

import contextlib
import dataclasses
import errno
import importlib
import io
import os
import re
import shlex
import sys
import types
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from evenhand.cli import interrupts
from evenhand.core import plugins
from evenhand.core.errors import InputError, WorkerLostError, unknown
from evenhand.core.processes import one_thread

COMMANDS = {
    "reproduce": ("reproduce.Reproduce", "run the paper's whole experiment, write its report"),
    "train": ("train.Train", "train one robot in a run folder; run it again to resume"),
    "evaluate": ("evaluate.Evaluate", "test a trained or a scripted robot on new people"),
    "film": ("film.Film", "make clips of services, or those of the questionnaire"),
    "compare": ("compare.Compare", "compare methods, published ones included, in every scenario"),
    "sweep": ("sweep.Sweep", "run many trainings from a file, here or on a Ray cluster"),
    "audit": ("audit.Audit", "audit the log of any service robot: who is served unevenly?"),
    "watch": ("watch.Watch", "watch a growing log, with an alarm that may be looked at any time"),
    "example": ("example.Example", "write a synthetic log to try an audit on"),
    "demos": ("demos.Demos", "let scripted robots serve, and simulated respondents judge them"),
    "alarms": ("alarms.Alarms", "false alarms and power of the verdicts, simulated"),
    "calibrate": ("calibrate.Calibrate", "search odds that bring robots near the paper's scores"),
    "detect": ("", "fit the detector to judgements, or judge services and issue scores"),
    "study": ("", "ask people: check, preview and serve a study, export its answers"),
    "replay": ("replay.Replay", "write services of a run as a page to watch and step through"),
    "view": ("view.View", "watch a robot at work in the browser, live"),
    "curves": ("curves.Curves", "epochs of runs for TensorBoard, or Weights & Biases offline"),
    "minari": ("minari.Minari", "services of a robot as a Minari dataset"),
    "card": ("card.Card", "the model card of a trained robot or of a detector"),
}
DETECT = {
    "fit": ("detect.DetectFit", "fit the detector to a table of judgements"),
    "judge": ("detect.DetectJudge", "judge a table of services, or four issue scores"),
}
STUDY = {
    "check": ("study.StudyCheck", "every mistake in a study's file, with its line"),
    "new": ("study.StudyNew", "write the paper's study as a file to start from"),
    "preview": ("study.StudyPreview", "walk through a study; nothing is kept"),
    "serve": ("study.StudyServe", "run a study, with a dashboard for the lead"),
    "backup": ("study.StudyBackup", "copy its database while it runs"),
    "export": ("study.StudyExport", "write the answers as tables, with a codebook"),
    "analyse": ("study_analyse.StudyAnalyse", "what the answers say, as a report"),
    "fit": ("study_analyse.StudyFit", "fit the detector to the answers"),
    "simulate": ("study_analyse.StudySimulate", "let simulated participants take a study"),
}
GROUPS = {
    "detect": (DETECT, "The bias detector (Eq. 3)."),
    "study": (STUDY, "The study: people watch robots and judge them."),
}
"""Commands that have commands of their own."""
_HELP = ("-h", "--help", "help")
_STOPPED = "stopped; what was finished is kept, the same command goes on from there"
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``evenhand``.

    Args:
        arguments: after the program's name; those of this process by default.

    Returns:
        Exit code: 0 when all went well, 1 when a worker process or a run of a sweep was lost or the
        output cannot be written, 2 for wrong input, 130 after Ctrl-C.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    return guarded(lambda: _dispatch(words), listening=arguments is None)


def guarded(action: Callable[[], int], *, listening: bool = True) -> int:
    """Run something for a terminal: what goes wrong is said there in one sentence.

    Returns:
        Exit code, see `main`.
    """
    if listening:
        interrupts.listen()
    one_thread()
    try:
        try:
            code = action()
            sys.stdout.flush()
            return code
        finally:
            interrupts.over()
    except InputError as error:
        return _complain(str(error), 2)
    except WorkerLostError as error:
        return _complain(str(error), 1)
    except KeyboardInterrupt:
        return _complain(_STOPPED, 130)
    except BrokenPipeError:  # the reader of our output has gone, for instance `head`
        _drop_output()
        return 0
    except OSError as error:
        if error.errno not in _FULL:
            raise
        _drop_output()
        where = error.filename or "the output"
        return _complain(f"{where} cannot be written: {error.strerror}: free some space", 1)
    except Exception:
        if not interrupts.heard():
            raise
        return _complain(_STOPPED, 130)  # a library may make another error of Ctrl-C


def _complain(sentence: str, code: int) -> int:
    print("evenhand:", " ".join(sentence.split()), file=sys.stderr)
    return code


def _drop_output() -> None:
    """What is still in the buffer cannot go anywhere; do not fail on it again at the end."""
    with contextlib.suppress(OSError, io.UnsupportedOperation):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _dispatch(words: list[str]) -> int:
    if not words or words[0] in _HELP:
        print(_overview("evenhand", "Robots that serve people evenly.", COMMANDS))
        return 0
    if words[0] in ("-V", "--version"):
        from evenhand import __version__

        print(f"evenhand {__version__}")
        return 0
    table, program, kind = COMMANDS, "evenhand", "command"
    name, rest = words[0], words[1:]
    if name in GROUPS:
        table, sentence = GROUPS[name]
        program, kind = f"evenhand {name}", f"command of {name}"
        if not rest or rest[0] in _HELP:
            print(_overview(program, sentence, table))
            return 0
        name, rest = rest[0], rest[1:]
    if name not in table:
        raise unknown(kind, name, table)
    # before the command is imported, whose help lists what there is
    for file in _values_of("--plugin", rest):
        plugins.load_plugin(file)
    module, _, attribute = table[name][0].partition(".")
    command = getattr(importlib.import_module(f"evenhand.cli.{module}"), attribute)
    program = f"{program} {name}"
    parsed = parse(command, program, rest)
    return 0 if parsed is None else parsed.run(" ".join([program, *rest]))


def _values_of(option: str, words: Sequence[str]) -> Iterator[str]:
    """What follows an option."""
    inside = False
    for word in words:
        if word.startswith("--"):
            inside = word == option
            if word.startswith(f"{option}="):
                yield word.partition("=")[2]
        elif inside:
            yield word


def _overview(program: str, line: str, table: dict[str, tuple[str, str]]) -> str:
    rows = "\n".join(f"  {name:<10} {text}" for name, (_, text) in table.items())
    return (
        f"{line}\n\nusage: {program} COMMAND [options]\n\n{rows}\n\n"
        f"`{program} COMMAND --help` tells the options of a command."
    )


def parse(command: type, program: str, words: Sequence[str]) -> Any:
    """The command that the words ask for.

    Returns:
        The command; None when help was asked for, and shown.
    """
    import tyro

    try:
        with contextlib.redirect_stderr(io.StringIO()):
            return tyro.cli(
                command, prog=program, args=words, config=(tyro.conf.FlagCreatePairsOff,)
            )
    except SystemExit as end:
        if not end.code:
            return None
    # tyro says it in a box of many lines, so the words are read once more for one sentence
    complaint = next(_complaints(command, words), f"cannot understand {shlex.join(words)!r}")
    complaint = re.sub(r"://[^\s'\"]+", "://...", complaint)  # the URL may hold a password
    raise InputError("format option", f"{complaint} (see `{program} --help`)")


def _complaints(command: type, words: Sequence[str]) -> Iterator[str]:
    """What is wrong with the words of a command, the surest thing first."""
    hints = get_type_hints(command)
    extras = get_type_hints(command, include_extras=True)
    fields = {field.name: field for field in dataclasses.fields(command)}
    bare = [name for name, field in fields.items() if "Positional" in str(field.type)]
    options = {_option(name, extras[name]): name for name in fields if name not in bare}
    given: list[tuple[str, list[str]]] = [("", [])]
    for word in words:
        if re.match(r"--|-[a-zA-Z]", word) and word not in ("-inf", "-nan"):
            option, mark, value = word.partition("=")
            given.append((option.replace("_", "-"), [value] if mark else []))
        else:
            given[-1][1].append(word)
    for option, values in given:
        if option and option not in options:
            yield str(unknown("option", option, options))
        elif option:
            yield from _wrong_values(option, values, hints[options[option]])
    for option, name in options.items():
        if fields[name].default is dataclasses.MISSING and option not in dict(given):
            yield f"{option} is missing: it has to be given"
    for word in given[0][1][len(bare) :]:
        hint = f"did you mean --{word}?" if f"--{word}" in options else "options begin with --"
        yield f"unexpected word {word!r}: {hint}"
    for option, values in given[1:]:
        if len(values) > 1:
            yield f"too many words after {option}: {shlex.join(values)}"


def _option(field: str, hint: Any) -> str:
    named = (getattr(extra, "name", None) for extra in getattr(hint, "__metadata__", ()))
    return f"--{next(filter(None, named), field).replace('_', '-')}"


def _wrong_values(option: str, values: list[str], hint: Any) -> Iterator[str]:
    """What is wrong with the values of one option, but for those that are too many."""
    if get_origin(hint) in (Union, types.UnionType):
        hint = next(kind for kind in get_args(hint) if kind is not type(None))
    if hint is bool:
        return
    kinds = [hint]
    if get_origin(hint) is tuple:
        several = get_args(hint)
        kinds = [several[0]] * len(values) if several[-1] is Ellipsis else list(several)
    if len(values) < len(kinds):
        yield f"{option} needs " + (
            "a value" if len(kinds) == 1 else f"{len(kinds)} values, and {len(values)} follow it"
        )
    for value, kind in zip(values, kinds, strict=False):
        yield from _wrong_value(option, value, kind)


def _wrong_value(option: str, value: str, kind: Any) -> Iterator[str]:
    if get_origin(kind) is Literal:
        if value not in get_args(kind):
            yield str(unknown(option.removeprefix("--"), value, get_args(kind)))
    elif kind in (int, float):
        try:
            kind(value)
        except ValueError:
            yield f"{option} is {value!r}: give a {'whole ' if kind is int else ''}number"
