"""evenhand watch at the command line: what it says, and how it ends."""

import time

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from evenhand.audits.example import synthetic_log


def uneven(n: int) -> bytes:
    rng = np.random.default_rng(0)
    rows = [
        f"{group},{'yes' if rng.random() < (0.9 if group == 'f' else 0.3) else 'no'}"
        for group in np.array(["f", "m"])[rng.integers(0, 2, n)]
    ]
    return ("\n".join(["gender,responded", *rows]) + "\n").encode()


def test_watch_names_what_is_uneven(cli, tmp_path):
    (tmp_path / "log.csv").write_bytes(uneven(1500))
    ended = cli("watch", "log.csv", "--once")
    assert ended.code == 0, ended.err
    lines = ended.out.splitlines()
    assert any("m (gender), willingness" in line and "more than the others" in line
               for line in lines)  # fmt: skip
    assert lines[-1].startswith("3 alarms in 1,500 services; the strongest evidence is")
    failing = cli("watch", "log.csv", "--once", "--fail-on", "alarm")
    assert failing.code == 3
    assert failing.out.startswith("alarm after ")


def test_watch_of_an_even_or_a_short_log_is_quiet(cli, tmp_path):
    pyarrow.csv.write_csv(synthetic_log(1500, np.random.default_rng(0)), tmp_path / "fleet.csv")
    words = ("--once", "--fail-on", "alarm")
    even = cli("watch", "fleet.csv", *words, "--identities", "gender")
    assert (even.code, even.out.partition(";")[0]) == (0, "no alarm in 1,500 services")
    (tmp_path / "log.csv").write_bytes(uneven(29))
    short = cli("watch", "log.csv", *words)
    assert short.out == "no alarm: there are fewer than 30 services, which make a batch\n"
    pq.write_table(pa.table({"gender": ["f", "m"] * 40, "responded": [1, 0] * 40}), "log.parquet")
    assert cli("watch", "log.parquet", "--once").code == 0


def test_watch_follows_a_file_until_it_is_stopped(apart, tmp_path):
    path, content = tmp_path / "log.csv", uneven(1500)
    cut = content.index(b"\n", 3000) + 4  # within a record
    path.write_bytes(content[:cut])
    words = ("watch", str(path), "--every", "0.05")
    with apart.at_work(*words, when=lambda: True) as process:
        with path.open("ab") as file:
            file.write(content[cut:])
        line = process.stdout.readline()
        while "m (gender)" not in line:
            assert line.startswith("alarm after ")
            line = process.stdout.readline()
        time.sleep(0.1)
        ended = apart.interrupt(process)
    assert ended.code == 130
    assert "Traceback" not in ended.err


def test_a_stray_quote_ends_a_watch_with_a_sentence(cli, tmp_path):
    """It would swallow everything up to the next quote."""
    content = uneven(1500)
    at = content.index(b"\n", 4000) + 1
    for stray, said in ((b'5" m,yes\n', "a quote stands within a cell"),
                        (b'"m,yes\n', "a quote is never closed")):  # fmt: skip
        (tmp_path / "log.csv").write_bytes(content[:at] + stray + content[at:])
        ended = cli("watch", "log.csv", "--once")
        row = content[:at].count(b"\n") + 1
        assert (ended.code, f"log.csv, row {row}: {said}" in ended.complaint) == (2, True)


def test_watch_once_takes_a_last_record_without_a_line_end(cli, tmp_path):
    content = uneven(60)
    for name, text in (("whole.csv", content), ("cut.csv", content.rstrip(b"\n"))):
        (tmp_path / name).write_bytes(text)
    whole, cut = (cli("watch", name, "--once").out for name in ("whole.csv", "cut.csv"))
    assert whole == cut
    assert "in 60 services" in whole
    (tmp_path / "log.jsonl").write_text('{"gender": "f", "responded": 1}\n' * 29 +
                                        '{"gender": "m", "responded": 1}')  # fmt: skip
    assert "no alarm in 30 services" in cli("watch", "log.jsonl", "--once").out


def test_watch_says_how_many_services_make_no_full_batch(cli, tmp_path):
    (tmp_path / "log.csv").write_bytes(uneven(71))
    ended = cli("watch", "log.csv", "--once")
    assert ended.out.endswith("own; 11 more make no full batch and were not looked at\n")
    pq.write_table(pa.table({"gender": ["f", "m"] * 16, "responded": [1, 0] * 16}), "log.parquet")
    assert "own; 2 more make no" in cli("watch", "log.parquet", "--once").out


def test_lines_that_end_with_a_carriage_return_are_told(cli, tmp_path):
    (tmp_path / "log.csv").write_bytes(uneven(60).replace(b"\n", b"\r"))
    for words in (("watch", "log.csv", "--once"), ("watch", "log.csv"), ("audit", "log.csv")):
        assert (
            "row 1: a carriage return stands alone: save with line feeds" in cli(*words).complaint
        )
