# SPDX-License-Identifier: Apache-2.0
"""Holds what was answered against what the drives did. Each rule yields what breaks it.

Only what must be so whatever the order in which the bridge took what came at the same time is held
against it: a step is before another when it was answered before the other was sent.
"""

from dataclasses import dataclass, field

from bridgelib import (
    ACKNOWLEDGE,
    BUSY,
    ILLEGAL_ADDRESS,
    ILLEGAL_FUNCTION,
    ILLEGAL_VALUE,
    NO_PATH,
    ONLINE_BIT,
    QUALITY_GOOD,
    RESULT_BUSY,
    RESULT_LATCHED,
    RESULT_LIMIT,
    RESULT_NOT_IN_CONTROL,
    RESULT_OK,
    RESULT_OUT_OF_RANGE,
    RESULT_RATE_LIMITED,
    RESULT_REFUSED,
    RESULT_RESTARTED,
    RESULT_UNPROVEN,
    RESULT_UNSUPPORTED,
)
from model.families import MOTIONS, MOVE, OFF, OTHER, POWER, RUN, SET, STOP
from model.history import STOPS

# Results that say: it did not happen.
NEVER = (RESULT_REFUSED, RESULT_OUT_OF_RANGE, RESULT_RESTARTED, RESULT_LIMIT, RESULT_LATCHED,
         RESULT_UNSUPPORTED, RESULT_BUSY, RESULT_RATE_LIMITED, RESULT_NOT_IN_CONTROL)
# Exceptions that say so.
NOTHING_DONE = (ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE, BUSY, NO_PATH)

EPSILON = 0.002      # s, of the witness's clock
LATE = 1.0           # s, in which a simulator that waits for a processor hears what was sent
ARRIVED = 2.0        # s, after which what was sent over a closed connection has been taken
BRAKING = 1.5        # s, the longest that any motor here needs to stand
CREEP = 5            # rpm, of a servo that has arrived
FRESH = 0.3          # s, of a reply that waited for the bridge


@dataclass
class Fault:
    rule: str
    text: str
    step: object = None
    drive: int = 0
    time: float = 0.0


@dataclass
class Order:
    """A command of a client, and what the drive did about it."""

    done: object
    drive: int
    kind: str
    tag: object
    events: list = field(default_factory=list)

    @property
    def step(self):
        return self.done.step

    @property
    def sent(self):
        return self.done.attempts[0].sent

    @property
    def answered(self):
        """When the client knew the end; None: never."""
        times = [attempt.answered for attempt in self.done.attempts if attempt.code is not None]
        return max(times) if len(times) == len(self.done.attempts) else None

    @property
    def codes(self):
        return [attempt.code for attempt in self.done.attempts]

    def first(self, code):
        return next((attempt for attempt in self.done.attempts if attempt.code == code), None)

    def __str__(self):
        step = self.step
        return (f"step {step.place}: client {step.who} {step.name or step.do} to drive "
                f"{self.drive}, id {step.number}, {self.tag}: answered {self.codes}"
                f"{f', result {self.done.result.code}' if self.done.result else ''}")


class Case:
    def __init__(self, record):
        self.record = record
        self.family = record.family
        self.events = {drive: [] for drive in range(1, self.family.drives + 1)}
        for event in record.events:
            self.events[event.drive].append(event)
        self.orders = []
        self.stops = []
        self.wild = []    # (drive, from, to): staged commands started
        for done in record.done:
            self._sort(done)
        self._match()

    # --- whose is what

    def _sort(self, done):
        step = done.step
        if not done.attempts:
            return
        kind, tag = self._tag(step)
        if step.do == "group_stop":
            for drive in self.events:
                self.stops.append(Order(done, drive, STOP, None))
        elif step.do == "group_start":
            attempt = done.attempts[-1]
            self.wild.append((attempt.sent, (attempt.answered or self.record.ended) + LATE))
        elif kind == STOP:
            self.stops.append(Order(done, step.drive, STOP, None))
        elif kind:
            self.orders.append(Order(done, step.drive, kind, tag))

    def _tag(self, step):
        if (step.do == "command" and step.name in STOPS) or (
                step.do == "vendor" and step.name in ("stop", "halt")):
            return STOP, None
        if step.do == "vendor" and step.name == "go":
            return MOVE, ("at", step.position)
        if step.do not in ("command", "stage"):
            return None, None
        if step.name == "move_velocity":
            return RUN, step.velocity
        if step.name in ("move_absolute", "move_relative"):
            return MOVE, step.position if self.family.name == "servo-can" else step.velocity
        if step.name == "set_position":
            return SET, abs(step.position) if self.family.name == "xyza" else step.position
        return None, None

    def _key(self, event):
        if event.kind == MOVE and event.tag == 0:
            return MOVE, ("at", event.value[1])
        return event.kind, event.tag

    def _match(self):
        by_key = {(order.drive, order.kind, order.tag): order for order in self.orders}
        self.strange = []
        for drive, events in self.events.items():
            for event in events:
                if not event.obeyed or event.kind not in (*MOTIONS, SET) or event.tag is None:
                    continue
                order = by_key.get((drive, *self._key(event)))
                if order and event.time >= order.sent - EPSILON:
                    order.events.append(event)
                elif event.kind in MOTIONS:
                    self.strange.append(event)

    def is_wild(self, event):
        """Begun by group_start, from arguments that any step has left."""
        return any(begin <= event.time <= end for begin, end in self.wild)

    def own(self, order):
        """Its events but those of a start of staged commands, which takes whatever is kept."""
        return [event for event in order.events if not self.is_wild(event)]

    # --- the rules

    def faults(self):
        for problem in self.record.problems:
            yield Fault("crash", problem)
        for rule in (self.strangers, self.silences, self.executed, self.once, self.in_time,
                     self.never_after_stop, self.stops_are_taken, self.stops_stop, self.baselines,
                     self.results, self.fresh, self.true_positions):
            yield from rule()

    def strangers(self):
        for event in self.strange:
            if self.is_wild(event):
                continue
            yield Fault("unasked", f"drive {event.drive} began what nobody had asked for: "
                        f"{event.text}", drive=event.drive, time=event.time)

    def silences(self):
        for done in self.record.done:
            if any(attempt.silent for attempt in done.attempts):
                yield Fault("silent", f"step {done.step.place}: no answer to {done.step}",
                            done.step)

    def executed(self):
        """Success was told, and it was not so."""
        for order in self.orders:
            good = order.first(0)
            if not good or order.step.do == "stage" or (order.done.result and
                                                        order.done.result.code == RESULT_UNPROVEN):
                continue
            begin = min(attempt.sent for attempt in order.done.attempts)
            if not any(begin - EPSILON <= event.time <= good.answered + EPSILON
                       for event in order.events) and not self._joined(order):
                yield Fault("not executed", f"{order}, and the drive never did it", order.step,
                            order.drive, good.answered)

    def _joined(self, order):
        return self.family.name == "servo-can" and order.kind == MOVE and any(
            event.tag == order.tag for event in self.events[order.drive])

    def once(self):
        """Again with something else between, or to another target: executed twice."""
        for order in self.orders:
            own, good = self.own(order), order.first(0)
            if good and order.step.do != "stage" and own and \
                    own[-1].time > good.answered + EPSILON:
                yield Fault("twice", f"{order}, and the drive did it after its success: "
                            f"{own[-1].text}", order.step, order.drive, own[-1].time)
                continue
            if len(own) < 2 or order.kind == SET:
                continue
            first, last = own[0], own[-1]
            # A speed of which nothing is left, because the power was away, may be said again; a
            # place may not: it was counted from another origin.
            others = (*MOTIONS, STOP, OFF) if order.kind == RUN else (*MOTIONS, STOP, OFF, POWER)
            between = [event for event in self.events[order.drive]
                       if first.time < event.time < last.time and event.obeyed and
                       event not in own and event.kind in others]
            targets = {event.value for event in own}
            relative = any(event.value and event.value[0] == "rmv" for event in own)
            if between or len(targets) > 1 or relative:
                yield Fault("twice", f"{order}, and the drive did it {len(own)} times: "
                            f"{[event.text for event in own]}", order.step, order.drive, last.time)

    def in_time(self):
        """Nothing is done that was answered to have failed, or after the answer."""
        for order in self.orders:
            own = self.own(order)
            if not own or order.step.do == "stage":
                continue
            codes = [code for code in order.codes if code is not None]
            if len(codes) == len(order.codes) and all(code in NOTHING_DONE for code in codes):
                yield Fault("denied", f"{order}, and the drive did it: {own[0].text}", order.step,
                            order.drive, own[0].time)
            end = order.answered
            if end is None or ACKNOWLEDGE in codes:
                continue
            slack = EPSILON if set(codes) == {0} else LATE
            late = [event for event in own if event.time > end + slack]
            if late:
                yield Fault("late", f"{order} at {end:.4f}, and the drive did it at "
                            f"{late[0].time:.4f}", order.step, order.drive, late[0].time)

    def never_after_stop(self):
        for stop in self.stops:
            good = stop.first(0)
            if not good:
                continue
            carried = [event for event in self.events[stop.drive]
                       if event.kind in (STOP, OFF) and event.obeyed and
                       good.sent - EPSILON <= event.time <= good.answered + EPSILON]
            since = carried[0].time if carried else good.answered
            for order in self.orders:
                if order.drive != stop.drive or order.kind not in MOTIONS or \
                        not self._before(order, good):
                    continue
                after = [event for event in self.own(order) if event.time > since + EPSILON]
                if after:
                    yield Fault("after stop", f"{order}, begun at {after[0].time:.4f}, behind "
                                f"{stop} at {good.answered:.4f}", order.step, stop.drive,
                                after[0].time)

    def _before(self, order, attempt):
        """Whether the bridge had taken the order when the stop was sent."""
        if order.step.do == "stage":
            return False
        if order.done.chaser and attempt in order.done.chaser.attempts:
            return True
        if order.answered is not None:
            return order.answered < attempt.sent
        return (max(each.sent for each in order.done.attempts) + ARRIVED < attempt.sent)

    def stops_are_taken(self):
        for stop in self.stops:
            if BUSY in stop.codes:
                yield Fault("stop busy", f"{stop}", stop.step, stop.drive)

    def stops_stop(self):
        """A stop that was confirmed: the drive had it, or stands; and it comes to a stand."""
        for stop in self.stops:
            good = stop.first(0)
            if good:
                yield from self._stood(stop, good)

    def _stood(self, stop, good):
        events = [event for event in self.events[stop.drive] if event.obeyed]
        before = [event for event in events if event.time <= good.answered + EPSILON]
        later = [event for event in events if event.time > good.answered + EPSILON]
        last = next((event for event in reversed(before) if self._rests(event) or event.kind in
                     (*MOTIONS, STOP, OFF, POWER)), None)
        if last is None or self._rests(last):
            return
        if last.kind in MOTIONS:
            if last.time < good.sent - EPSILON:
                yield Fault("stop lost", f"{stop}, and the drive still does {last.text}", stop.step,
                            stop.drive, good.answered)
            return
        end = good.answered + BRAKING
        for event in later:
            if event.time > end or event.kind in (*MOTIONS, POWER, OTHER) or self._rests(event):
                break
        else:
            event = None
        if (event is None and self.record.ended > end) or (
                event is not None and event.time > end):
            yield Fault("runs on", f"{stop}, and the drive does not come to a stand", stop.step,
                        stop.drive, end)

    def _rests(self, event):
        """A servo creeps over the last counts to its target; its speed is told in whole rpm."""
        creeps = self.family.name == "servo-can" and event.kind not in MOTIONS and \
            abs(event.velocity) < CREEP
        return not event.moving or creeps

    def epochs(self, drive):
        """Times at which the memory of ids was lost: (from, to)."""
        simulated = self.family.resource[drive][0]
        spans = [(float("-inf"), float("-inf"))]
        for deed in self.record.deeds:
            mine = self.family.resource[deed.step.drive][0] == simulated
            if deed.step.do in ("kill", "restart") or (deed.step.do == "change" and mine):
                spans.append((deed.begun, deed.ended))
        return spans

    def baselines(self):
        for drive in self.events:
            spans = self.epochs(drive)
            ends = [begin for begin, _ in spans[1:]] + [float("inf")]
            for (_, begin), end in zip(spans, ends):
                yield from self._baseline(drive, begin, end)

    def _baseline(self, drive, begin, end):
        """The first id behind a start is only remembered."""
        clients = {}
        for done in self.record.done:
            step = done.step
            if step.do != "command" or step.drive != drive or not step.number:
                continue
            who = step.who if self.record.history.settings["scope"] == "client" else None
            for attempt in done.attempts:
                if attempt.sent > begin - ARRIVED and attempt.sent < end:
                    clients.setdefault(who, []).append((attempt, done))
        for attempts in clients.values():
            attempt, done = min(attempts, key=lambda pair: pair[0].sent)
            if attempt.sent < begin or attempt.code != 0 or attempt.answered > end or \
                    done.step.name in STOPS:
                continue
            yield Fault("baseline", f"step {done.step.place}: the first id after a start, and "
                        f"{done.step.name} to drive {drive} was answered with success", done.step,
                        drive, attempt.answered)

    def results(self):
        for order in self.orders:
            result = order.done.result
            if not result or not order.step.number or result.number != order.step.number:
                continue
            # Who was never let in is shown what somebody else commanded last.
            if BUSY in order.codes:
                continue
            own = self.own(order)
            done = [event for event in order.events if event.time <= result.sent + LATE]
            if result.code == RESULT_OK and not done:
                yield Fault("result", f"{order}, and the drive never did it", order.step,
                            order.drive, result.sent)
            if result.code == RESULT_RESTARTED:
                # The bridge from before may have done it; nobody remembers.
                begun = max(end for begin, end in self.epochs(order.drive) if begin <= result.sent)
                own = [event for event in own if event.time > begun]
            if result.code in NEVER and own:
                yield Fault("result", f"{order}, and the drive did it: {own[0].text}", order.step,
                            order.drive, result.sent)

    # --- what is read

    def reads(self):
        for done in self.record.done:
            if done.process:
                yield done, done.attempts[0], done.process

    def fresh(self):
        """While a drive is away its data grow old."""
        for done, attempt, values in self.reads():
            age = values["age_ms"] / 1000
            # Of a computer that is busy the intervals grow, and three of them are good.
            if values["quality"] == QUALITY_GOOD and age > max(0.101, 3 * values["poll_interval_ms"] / 1000):
                yield Fault("quality", f"step {done.step.place}: good and {age} s old", done.step)
            for deed in self.record.deeds:
                if deed.step.do not in ("power", "silence") or not self._same(deed, done):
                    continue
                away = attempt.sent - deed.begun
                if deed.begun < attempt.sent and attempt.answered < deed.ended and \
                        age < away - FRESH:
                    yield Fault("old", f"step {done.step.place}: {age} s old, and drive "
                                f"{done.step.drive} is away since {away:.3f} s", done.step)

    def _same(self, deed, done):
        resource = self.family.resource
        return resource[deed.step.drive][0] == resource[done.step.drive][0]

    def true_positions(self):
        """What is shown of a drive that stands is where it stands."""
        for done, attempt, values in self.reads():
            taken = attempt.sent - values["age_ms"] / 1000 - FRESH
            events = self.events[done.step.drive]
            before = [event for event in events if event.time < taken]
            during = [event for event in events if taken <= event.time <= attempt.answered]
            if not before or during or before[-1].moving or not values["status"] & ONLINE_BIT:
                continue
            last = before[-1]
            if abs(values["velocity"]) > 1:
                yield Fault("velocity", f"step {done.step.place}: drive {done.step.drive} shows "
                            f"{values['velocity']} and stands", done.step)
            if last.position != values["position"] and not (
                    self.family.name == "servo-can" and
                    abs(last.position - values["position"]) <= 1):
                yield Fault("position", f"step {done.step.place}: drive {done.step.drive} shows "
                            f"{values['position']} and stands at {last.position}", done.step)


def judge(record):
    return list(Case(record).faults())
