"""The live view in a real browser. It draws without a graphics card here, so frames take long."""

import os
import re
import struct
import zlib

import pytest

from support.chromium import CHROMIUM, QUIET

SMALL = {"width": 420, "height": 300}
PATIENCE = 600_000
"""Milliseconds after which something is broken, on however busy a machine."""

pytestmark = pytest.mark.slow


def pixels(png: bytes) -> list[bytes]:
    """The rows of an 8-bit PNG without interlacing, each as its red, green, blue bytes."""
    at, packed, width, depth = 8, b"", 0, 3
    while at < len(png):
        size, kind = struct.unpack_from(">I4s", png, at)
        body = png[at + 8 : at + 8 + size]
        if kind == b"IHDR":
            width, depth = struct.unpack_from(">I", body)[0], {2: 3, 6: 4}[body[9]]
        packed += body if kind == b"IDAT" else b""
        at += 12 + size
    raw, row, rows = zlib.decompress(packed), bytearray(width * depth), []
    for start in range(0, len(raw), 1 + width * depth):
        how, line = raw[start], bytearray(raw[start + 1 : start + 1 + width * depth])
        for i in range(len(line)):
            left = line[i - depth] if i >= depth else 0
            up, corner = row[i], row[i - depth] if i >= depth else 0
            near = min((left, up, corner), key=lambda v, p=left + up - corner: abs(p - v))
            line[i] = (line[i] + (0, left, up, (left + up) // 2, near)[how]) % 256
        row = line
        rows.append(b"".join(bytes(row[i : i + 3]) for i in range(0, len(row), depth)))
    return rows


def colours(rows: list[bytes]) -> int:
    return len({row[i : i + 3] for row in rows for i in range(0, len(row), 3)})


@pytest.fixture
def browser(require):
    require(CHROMIUM.exists(), "chromium (Debian package chromium)")
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        flags = [*QUIET, "--headless", "--disable-gpu"]
        made = driver.chromium.launch(executable_path=CHROMIUM, args=flags)
        yield made
        made.close()


def test_the_restaurant_is_drawn_time_moves_and_services_are_told(apart, browser, tmp_path):
    hidden = ("DISPLAY", "WAYLAND_DISPLAY")
    env = {k: v for k, v in os.environ.items() if k not in hidden} | {"HOME": str(tmp_path)}
    with apart.at_work("view", "--seed", 0, when=lambda: True, cwd=tmp_path, env=env) as process:
        address = process.stdout.readline().split()[1]
        page = browser.new_page(viewport=SMALL)
        problems: list[str] = []
        strangers: list[str] = []
        states: set[bytes] = set()
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.on("console", lambda said: said.type == "error" and problems.append(said.text))
        page.on(
            "request",
            lambda asked: asked.url.startswith(address) or strangers.append(asked.url),
        )
        page.on("requestfailed", lambda failed: problems.append(failed.url))
        page.on(
            "websocket",
            lambda wire: "/state" in wire.url
            and wire.on("framereceived", lambda frame: states.add(bytes(frame))
                        if isinstance(frame, bytes) else None),
        )  # fmt: skip
        page.goto(address)
        # the services begin when somebody looks, and are told in the terminal as they end
        told = process.stdout.readline()
        assert re.fullmatch(
            r"service 1 \(race Asian, gender Other, age Child, disability No, skin VI\): "
            r"response after \d+ steps, [\d.]+ s, at 1\.\d\d m; issues: none\n",
            told,
        )

        def drawn(more: int) -> bytes:
            """A picture after so many more states have reached the page."""
            until = len(states) + more
            while len(states) < until:
                assert process.poll() is None
                page.wait_for_timeout(500)
            return page.screenshot(timeout=PATIENCE)

        first = pixels(drawn(3))
        later = pixels(drawn(3))
        page.close()
        ended = apart.interrupt(process)
    room = [row[: SMALL["width"] * 3 // 2] for row in first[70:-40]]  # left of the panel
    assert colours(room) > 300, "the canvas is not blank"
    assert first != later, "something moves"
    assert (problems, strangers) == ([], [])
    assert (ended.code, ended.err) == (0, "")
    numbers = [int(n) for n in re.findall(r"^service (\d+) ", told + ended.out, re.MULTILINE)]
    assert numbers == list(range(1, len(numbers) + 1))
