# SPDX-License-Identifier: Apache-2.0
"""Every exchange that docs/exchanges.md shows in bytes, replayed against the bridge."""

import json
import re
import time

import pytest
from bridgelib import ROOT, Raw

PAGE = ROOT / "docs" / "exchanges.md"
SECTION = re.compile(
    r"^## (?P<title>[^\n]*)\n<!-- setup: (?P<setup>[^\n]*) -->\n"
    r"(?:(?!## )[^\n]*\n)*?```exchange\n(?P<steps>.*?)^```$",
    re.M | re.S,
)


def sections():
    text = PAGE.read_text(encoding="utf-8")
    found = [match.groupdict() for match in SECTION.finditer(text)]
    assert len(found) == text.count("```exchange"), "an exchange without a title or a setup"
    return found


def closed_at_once(port, source):
    with Raw(port, source) as link:
        return link.closed()


def pattern(text):
    """Hexadecimal digits, spaces for the eye, and dots for what differs each time."""
    digits = text.replace(" ", "").encode()
    assert len(digits) % 2 == 0, text
    return re.compile(digits, re.I)


class Play:
    def __init__(self, bridge):
        self.bridge = bridge
        self.sources = {}
        self.links = {}
        self.asked = {}

    def link(self, name):
        if name not in self.links:
            self.links[name] = Raw(self.bridge.port, self.sources.get(name))
        return self.links[name]

    def forget(self, name):
        link = self.links.pop(name, None)
        if link:
            link.close()

    def ask(self, name):
        link = self.link(name)
        link.send(self.asked[name])
        return self.answer(link)

    @staticmethod
    def answer(link):
        transaction, unit, pdu = link.receive()
        return Raw.adu(transaction, unit, pdu).hex().encode()

    def happens(self, what):
        if match := re.fullmatch(r"(\w+) connects from (\S+)", what):
            self.sources[match[1]] = match[2]
            self.link(match[1])
        elif match := re.fullmatch(r"\w+ from (\S+) is refused", what):
            assert closed_at_once(self.bridge.port, match[1])
        elif match := re.fullmatch(r"(\w+) loses its connection", what):
            self.forget(match[1])
        elif match := re.fullmatch(r"drive (\d+) goes silent", what):
            self.bridge.sim.fault("silence on", f"drive{match[1]}")
        elif what == "the bridge restarts":
            for name in list(self.links):
                self.forget(name)
            self.bridge.restart_bridge()
        else:
            raise AssertionError(f"the page says what no test can do: {what}")

    def says(self, name, sign, text):
        if sign == ">":
            self.asked[name] = bytes.fromhex(text.replace(" ", ""))
            self.link(name).send(self.asked[name])
            return
        deadline = time.monotonic() + 10
        wanted = pattern(text)
        got = self.answer(self.link(name))
        if sign == "<~":
            while not wanted.fullmatch(got):
                assert time.monotonic() < deadline, f"{name} gets {got.decode()}, never {text}"
                got = self.ask(name)
            return
        assert wanted.fullmatch(got), f"{name} got {got.decode()}, not {text}"

    def step(self, line):
        line = line.split("#")[0].strip()
        if line.startswith("= "):
            self.happens(line[2:])
        elif line:
            name, sign, text = line.split(" ", 2)
            self.says(name, sign, text)

    def end(self):
        for name in list(self.links):
            self.forget(name)


@pytest.mark.parametrize("section", sections(), ids=lambda section: section["title"])
def test_the_guide_shows_what_is_said(make_bridge, section):
    setup = json.loads(section["setup"])
    play = Play(make_bridge(**setup))
    for line in section["steps"].splitlines():
        play.step(line)
    play.end()
