#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What a stop on the page takes while strangers are at its door, with TLS.

Usage: doors.py [BUILD_DIR [STOPS [ATTACK ...]]]

BUILD_DIR is one with the preset gcc (default build/gcc), STOPS how many of each kind (default 60). Needs the tests' Python
packages (build/venv/bin/python). Turns take each other's place, so that what else the
machine does is in both. The attackers are eight addresses of the loopback; each opens a new connection where one is closed.
Prints medians in ms: alone; beside the same attack at a port of nobody, which takes as much of the machine; and beside it at
the page's port; over a connection that is there (kept), and over a new one with its greeting.
"""
import contextlib
import os
import select
import socket
import ssl
import statistics
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
BUILD = Path(sys.argv[1] if len(sys.argv) > 1 else HERE.parents[1] / "build" / "gcc").resolve()
os.environ["DRIVEBRIDGE_BUILD"] = str(BUILD)
sys.path.insert(0, str(HERE.parent / "e2e"))

import http.client  # noqa: E402

from bridgelib import DOCS, MAP, Bridge, eventually, load_commands  # noqa: E402
from certlib import make  # noqa: E402
from weblib import OPERATOR, Page, Webd  # noqa: E402

TURNS = 3
ADDRESSES = 8
# A browser's own, which says all that it can.
GREETING = b"\x16\x03\x01\x02"


def context():
    made = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    made.check_hostname, made.verify_mode = False, ssl.CERT_NONE
    return made


class Attack:
    """Connections that begin with these bytes, in a process of its own; then each sends `drip` now and then."""

    def __init__(self, webd, count, first, drip=b""):
        self.pid = os.fork()
        if self.pid == 0:
            with contextlib.suppress(KeyboardInterrupt):
                self._run(webd.address, count, first, drip)
            os._exit(0)
        time.sleep(1)

    def _run(self, address, count, first, drip):
        poll = select.epoll()
        links = {}
        number = 0
        dripped = time.monotonic()
        while True:
            while len(links) < count:
                link = socket.socket()
                link.bind((f"127.0.0.{20 + number % ADDRESSES}", 0))
                number += 1
                try:
                    link.connect(address)
                    link.sendall(first)
                except OSError:
                    link.close()
                    time.sleep(0.01)
                    break
                link.setblocking(False)
                links[link.fileno()] = link
                poll.register(link, select.EPOLLIN)
            for fd, _ in poll.poll(0.05):
                try:
                    gone = not links[fd].recv(4096)
                except OSError:
                    gone = True
                if gone:
                    poll.unregister(fd)
                    links.pop(fd).close()
            if drip and time.monotonic() - dripped > 0.2:
                dripped = time.monotonic()
                for link in links.values():
                    with contextlib.suppress(OSError):
                        link.send(drip)

    def close(self):
        os.kill(self.pid, 9)
        os.waitpid(self.pid, 0)


class Elsewhere:
    """The same attack at a port of nobody: what it takes of the machine, whoever is meant."""

    def __init__(self, make_attack):
        listener = socket.create_server(("127.0.0.1", 0), backlog=128)
        self.address = listener.getsockname()
        self.pid = os.fork()
        if self.pid == 0:
            while True:
                link, _ = listener.accept()
                link.close()
                time.sleep(0.0005)
        listener.close()
        self.attack = make_attack(self)

    def close(self):
        self.attack.close()
        os.kill(self.pid, 9)
        os.waitpid(self.pid, 0)


class Guesses:
    """Twenty guesses in a second at the operator's name, from one address, in a process of its own."""

    def __init__(self, webd):
        self.pid = os.fork()
        if self.pid == 0:
            page = secure(Page(webd), "127.0.0.66")
            page.load()
            while True:
                with contextlib.suppress(Exception):
                    page.log_in(OPERATOR[0], "a guess")
                time.sleep(0.05)
        time.sleep(1)

    def close(self):
        os.kill(self.pid, 9)
        os.waitpid(self.pid, 0)


ATTACKS = {
    "one byte of a greeting": lambda webd: Attack(webd, 1, GREETING[:1]),
    "130 half greetings": lambda webd: Attack(webd, 130, GREETING),
    "256 silent connections": lambda webd: Attack(webd, 256, b""),
    "256 greetings, a byte each 0.2 s": lambda webd: Attack(webd, 256, GREETING, b"\x00"),
    "256 heads without TLS": lambda webd: Attack(webd, 256, b"GET / HTTP/1.1\r\nX-Slow: "),
    "20 guesses a second at the name": Guesses,
}


def secure(page, source=None):
    options = {"source_address": (source, 0)} if source else {}
    page.connect = lambda: http.client.HTTPSConnection(*page.webd.address, timeout=30, context=context(), **options)
    return page


def time_stops(page, count):
    """[(over the connection that is there, over a new one)], ms"""
    kept, new = [], []
    for _ in range(count):
        began = time.perf_counter()
        assert page.run("drive1", "stop") == "ok"
        kept.append(1000 * (time.perf_counter() - began))
        beside = secure(page.beside())
        began = time.perf_counter()
        assert beside.run("drive1", "stop") == "ok"
        new.append(1000 * (time.perf_counter() - began))
        beside.close()
        time.sleep(0.01)
    return kept, new


def measure(web, page, name, stops):
    """One line: medians alone, beside the attack at another port, and beside it at the page's."""
    makers = (None, lambda: Elsewhere(ATTACKS[name]), lambda: ATTACKS[name](web))
    if ATTACKS[name] is Guesses:
        makers = (makers[0], None, makers[2])
    times = [([], []) for _ in makers]
    for turn in range(len(makers) * TURNS):
        maker = makers[turn % len(makers)]
        attack = maker() if maker else None
        for list_, more in zip(times[turn % len(makers)], time_stops(page, stops // TURNS), strict=True):
            list_ += more
        if attack:
            attack.close()
            time.sleep(0.5)
    medians = [[statistics.median(one) for one in pair] for pair in times]
    for index, what in enumerate(("kept", "new")):
        alone, elsewhere, beside = (one[index] for one in medians)
        print(f"{name if index == 0 else '':34} {what:5} {alone:8.2f} {elsewhere:10.2f} {beside:8.2f} {beside / alone:7.2f} "
              f"{beside / elsewhere:8.2f} {max(times[2][index]):8.1f}", flush=True)


def main():
    stops = int(sys.argv[2]) if len(sys.argv) > 2 else 60
    chosen = sys.argv[3:] or list(ATTACKS)
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory:
        place = Path(directory)
        files = {"certificate-file": place / "page.pem", "key-file": place / "page.key"}
        make("gateway").write(*files.values())
        bridge = Bridge(place, MAP, load_commands(DOCS / "commands.csv"))
        web = Webd(place, bridge, server=files)
        try:
            bridge.start()
            page = secure(Page(web.start()))
            eventually(lambda: page.load()["service"], 20, "the service")
            page.log_in(*OPERATOR)
            time_stops(page, 5)
            print(f"{os.cpu_count()} processors; {stops} stops of each kind, in {TURNS} turns with and without")
            print(f"{'attack':34} {'link':5} {'alone':>8} {'elsewhere':>10} {'here':>8} {'/alone':>7} {'/elsewh.':>8} "
                  f"{'worst':>8}")
            for name in chosen:
                measure(web, page, name, stops)
            page.close()
        finally:
            print(*web.finish(), *bridge.finish(), sep="\n", end="")


if __name__ == "__main__":
    main()
