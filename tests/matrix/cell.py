# SPDX-License-Identifier: Apache-2.0
"""A cell of the fault matrix: a scripted history, played and judged as those of the model check, and
summed up in the words of the table."""

import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from bridgelib import DEVICE_FAILURE, QUALITY_GOOD, RESULT_INDETERMINATE
from matrix.faults import TARGET
from model.families import FAMILIES
from model.history import WORLD, History, Step
from model.judge import judge
from model.player import Player

OTHER = {"vsmd-serial": 2, "vsmd-can": 2, "servo-can": 2, "xyza": 3}
TWIN = 3
FLOODS = 3
QUIET = 400  # ms in which a drive has told where it stands
WATCHED = 3  # replies
PLC, NEIGHBOUR, READER = 0, 1, 2
CLASSES = [(0.1, "0.1 s"), (0.5, "0.5 s"), (2, "2 s"), (5, "5 s"), (15, "15 s")]
# A neighbour's data are asked for as often as ever, unless the machine is busy.
DISTURBED = 1000  # ms
DISTURBANCE_TRIES = 2
EXCEPTIONS = {1: "01", 2: "02", 3: "03", 4: "04", 5: "05", 6: "06", 10: "0A", 11: "0B"}


@dataclass
class Summary:
    reads: set = field(default_factory=set)
    commands: set = field(default_factory=set)
    recovery: float = 0.0
    broken: list = field(default_factory=list)     # promises
    disturbed: list = field(default_factory=list)  # the drive beside it


class Script:
    """The steps of a cell."""

    def __init__(self, family, fault, rounds):
        self.family, self.fault, self.rounds = family, fault, rounds
        self.other = OTHER[family.name]
        self.steps = []
        self.numbers = {}
        self.tags = 0

    def add(self, who, do, drive=TARGET, **more):
        self.steps.append(Step(who, do, drive, place=len(self.steps), **more))

    def command(self, who, drive, name, **more):
        self.numbers[drive] = self.numbers.get(drive, 0) + 1
        self.tags += 1
        if name == "move_velocity" or (name.startswith("move") and
                                       self.family.name != "servo-can"):
            more["velocity"] = self.family.tag_speed(self.tags)
        if name in ("move_absolute", "move_relative"):
            more["position"] = 2000 + 10 * self.tags
        if name == "set_position":
            more["position"] = 100000 + self.tags
        self.add(who, "command", drive, name=name, number=self.numbers[drive], **more)

    def world(self, line, phase):
        twin = self.family.resource[TWIN][0]
        names = {"drive": self.family.resource[TARGET][0], "twin": twin,
                 "own": twin.removeprefix("drive")}
        step = self.fault.step(line, phase, names)
        step.place = len(self.steps)
        self.steps.append(step)

    def must_be_free(self, kind):
        """A servo's position is not set while it holds it."""
        return kind == "set_position" and self.family.name == "servo-can"

    def round(self, kind, line, phase):
        """A command that the fault hits, a neighbour's beside it, reads of both, and the recovery."""
        # In this order: a servo is stopped by taking its power off.
        self.add(PLC, "command", name="stop")
        self.command(PLC, TARGET, "disable" if self.must_be_free(kind) else "enable")
        self.add(PLC, "rest")
        before = self.fault.armed_before()
        if before:
            self.world(line, 0)
        self.command(PLC, TARGET, kind, look=True)
        if not before:
            self.world(line, phase)
        self.add(READER, "read")
        self.command(NEIGHBOUR, self.other, "move_velocity")
        self.add(NEIGHBOUR, "read", self.other)
        self.add(NEIGHBOUR, "command", self.other, name="stop")
        self.add(READER, "read")
        if self.fault.deed == "disk":
            self.add(WORLD, "disk", undo="room")
        self.add(PLC, "recover")

    def watch(self, line):
        """The fault several times in a row while the drive stands: what is shown is where it is."""
        self.add(PLC, "command", name="stop")
        self.add(PLC, "rest")
        self.add(READER, "read", gap=QUIET)
        self.world(line.rsplit(" ", 1)[0] + f" {WATCHED}", 0)
        for _ in range(4 * WATCHED):
            self.add(READER, "read", gap=3)
        # What is left would hit the looking for a drive that was given up.
        self.world("fault {drive} none", 0)
        self.add(PLC, "recover")

    def flood(self):
        for number in range(FLOODS):
            for who in (PLC, READER):
                self.add(who, "flood", name="move_velocity",
                         velocity=self.family.tag_speed(100 * (2 * number + (who == PLC))))
            self.command(NEIGHBOUR, self.other, "move_velocity")
            self.add(NEIGHBOUR, "read", self.other)
            self.add(NEIGHBOUR, "command", self.other, name="stop")
            self.add(READER, "read")
            self.add(3, "command", name="stop")
        self.add(PLC, "recover")

    def make(self):
        for drive in self.family.resource:
            self.command(PLC if drive == TARGET else NEIGHBOUR, drive, "enable")
        kinds = [*self.family.commands, "enable"]
        if self.fault.deed == "flood":
            self.flood()
            return self.steps
        places = [(line, phase) for line in self.fault.lines for phase in self.fault.phases]
        for number in range(self.rounds * max(len(kinds), len(places))):
            line, phase = places[number % len(places)]
            self.round(kinds[number % len(kinds)], line, phase)
        for line in self.fault.lines:
            if self.fault.armed_before():
                self.watch(line)
        return self.steps


def history_of(family, fault, rounds, interface=None):
    made = FAMILIES[family]()
    window = 2 if not fault.armed_before() else 1
    settings = {"scope": "client", "control": False, "confirm-ms": 2000,
                "window": 6 if fault.deed == "flood" else window}
    if interface:
        settings["interface"] = interface
    return History(family, fault.name, settings, Script(made, fault, rounds).make())


def told_read(done):
    if done.process:
        return "good" if done.process["quality"] == QUALITY_GOOD else "old and marked so"
    code = done.attempts[-1].code
    return "no connection" if code is None else EXCEPTIONS[code]


def told_command(done):
    code = done.attempts[-1].code
    if code == DEVICE_FAILURE and done.result and done.result.code == RESULT_INDETERMINATE:
        return "04 indeterminate"
    return "done" if code == 0 else "no connection" if code is None else EXCEPTIONS[code]


def disturbances(record, fault):
    """What a drive that the fault was not for had to suffer."""
    for done in record.done:
        if fault.whole_bus or done.step.drive == TARGET or not done.attempts or \
                (fault.twins and done.step.drive == TWIN):
            continue
        code = done.attempts[-1].code
        if done.step.do == "read" and (code != 0 or done.process["age_ms"] > DISTURBED):
            yield f"step {done.step.place}: a read of drive {done.step.drive}: {told_read(done)}"
        baseline = done.step.number == 1
        if done.step.do == "command" and code != 0 and not baseline:
            yield f"step {done.step.place}: {done.step.name} to drive {done.step.drive}: {code}"


def is_double(broken):
    """Two drives at one address do everything twice, are where the one or the other is, and what the
    one refuses the other may have done."""
    return broken.drive == TWIN or broken.rule in ("position", "velocity", "result")


def sum_up(record, fault):
    summary = Summary()
    for done in record.done:
        if done.step.do == "read" and done.step.drive == TARGET and done.step.who == READER:
            summary.reads.add(told_read(done))
        flooding = fault.deed == "flood" and done.step.name == "move_velocity"
        if done.step.do == "command" and done.step.drive == TARGET and (done.step.look or flooding):
            summary.commands.add(told_command(done))
        if done.step.do == "recover":
            if done.seconds is None:
                summary.broken.append(f"step {done.step.place}: it never came right again")
            else:
                summary.recovery = max(summary.recovery, done.seconds)
    summary.broken += [f"{broken.rule}: {broken.text}" for broken in judge(record)
                       if not (fault.twins and is_double(broken))]
    summary.disturbed += disturbances(record, fault)
    return summary


def run(family, fault, rounds=1, interface=None):
    """Plays the cell. Its summary, and the record for a report. A simulator that waits for a
    processor is silent, too: what disturbs a neighbour does it again."""
    for _ in range(DISTURBANCE_TRIES):
        with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory:
            record = Player(history_of(family, fault, rounds, interface), Path(directory)).run()
        summary = sum_up(record, fault)
        if summary.broken or not summary.disturbed:
            break
    summary.broken += summary.disturbed
    return summary, record


def recovery_class(seconds):
    return next((name for limit, name in CLASSES if seconds <= limit), "30 s")
