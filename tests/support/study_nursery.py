"""Servers that start at once: forked from a process that has imported everything.

    python study_nursery.py DB PORT

starts a server for each line that it reads, and writes its process number.
"""

import os
import signal
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from evenhand.study.server import participants
from evenhand.study.server.open_store import open_store
from evenhand.study.server.web import app, serve
from evenhand.study.server.web.desk import Settings
from support.studies import ADMIN, STUDY


def serve_it(db: str, port: int) -> None:
    """Serve, and say nothing."""
    kept = open_store(db, STUDY)
    listening = serve.listen("127.0.0.1", port)
    serve.run(app.build(STUDY, kept, Settings(participants.hashed(ADMIN))), listening)


def main() -> None:
    db, port = sys.argv[1], int(sys.argv[2])
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # who is killed is not waited for
    for _ in sys.stdin:
        number = os.fork()
        if number == 0:
            nothing = os.open(os.devnull, os.O_RDWR)
            for one in (0, 1, 2):
                os.dup2(nothing, one)
            serve_it(db, port)
        print(number, flush=True)


if __name__ == "__main__":
    main()
