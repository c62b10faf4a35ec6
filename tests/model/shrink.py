# SPDX-License-Identifier: Apache-2.0
"""Makes the history of a failure short: delta debugging. What is left still breaks the same rule. Runs
are not the same to the microsecond, so each candidate has several chances."""

import time
from itertools import chain

TRIES = 3


class Shrinker:
    """`faults_of` plays a history and judges it."""

    def __init__(self, faults_of, history, fault, seconds, say=lambda text: None):
        self.faults_of = faults_of
        self.history = history
        self.rule = fault.rule
        self.fault = fault
        self.deadline = time.monotonic() + seconds
        self.say = say
        self.runs = 0

    def fails(self, places):
        candidate = self.history.of(places)
        for _ in range(TRIES):
            if time.monotonic() > self.deadline:
                return False
            self.runs += 1
            for fault in self.faults_of(candidate):
                if fault.rule == self.rule:
                    self.fault = fault
                    return True
        return False

    def keep(self, places, better):
        """`better` instead of `places`, when it fails as well."""
        if len(better) < len(places) and self.fails(better):
            self.say(f"{len(better)} steps break it as well")
            return better
        return places

    def first_cuts(self, places):
        """What came after, and what was for other drives, is most of it."""
        steps = self.history.steps
        step = self.fault.step
        if step is not None:
            last = next((i for i in places if steps[i].place == step.place), places[-1])
            places = self.keep(places, [i for i in places if i <= last])
            places = self.keep(places, [i for i in places if steps[i].drive in (0, step.drive)])
        return places

    def run(self):
        """The shortest history that was found."""
        places = self.first_cuts(list(range(len(self.history.steps))))
        parts = 2
        while len(places) > 1 and time.monotonic() < self.deadline:
            size = max(1, len(places) // parts)
            chunks = [places[i:i + size] for i in range(0, len(places), size)]
            for number in reversed(range(len(chunks))):
                rest = list(chain(*chunks[:number], *chunks[number + 1:]))
                shorter = self.keep(places, rest)
                if shorter is not places:
                    places, parts = shorter, max(parts - 1, 2)
                    break
            else:
                if size == 1:
                    break
                parts = min(2 * parts, len(places))
        return self.history.of(places)
