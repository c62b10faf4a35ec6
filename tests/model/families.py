# SPDX-License-Identifier: Apache-2.0
"""The four families: how a plant of each is configured, what may be commanded, and what the lines
that the simulator writes about obeyed requests mean. The reading of frames is the tests' own."""

import re
import struct
from dataclasses import dataclass, field

SLCAN = {"transport": "slcan", "bitrate": 1000000, "line": None}

RUN, MOVE, SET, STOP, OFF, ON, PARAMETER, OTHER = (
    "run", "move", "set", "stop", "off", "on", "parameter", "other")
STANDS, POWER = "stands", "power"
MOTIONS = (RUN, MOVE)


@dataclass
class Event:
    """What a drive did, as the witness saw it."""

    time: float          # monotonic, seconds
    drive: int           # number in the bridge
    kind: str
    tag: object = None   # what tells the command: a velocity, a speed of a move, a position
    value: object = None  # the target of a move
    obeyed: bool = True
    position: int = 0    # then
    velocity: float = 0.0
    moving: bool = False
    text: str = ""


@dataclass
class Family:
    name: str
    drives: int
    options: dict                # of bridgelib.Bridge
    commands: tuple              # those with a tag
    parameter: str = ""          # one whose writing is seen
    vendor: bool = False         # has the vendor's own layout, too
    resource: dict = field(default_factory=dict)  # drive -> (simulated drive, axis)
    scale: int = 1               # speeds are so much
    set_any_time: bool = True    # set_position works while the motor turns

    def tag_speed(self, number):
        """The speed that is only this command's."""
        return self.scale * (1000 + number)


def _vsmd(name, **more):
    return Family(
        name, 3,
        {"drives": 3,
         "sim_drive": {"set": ["spd=6400", "acc=640000", "dec=640000", "pae=1"]}, **more},
        ("move_velocity", "move_absolute", "move_relative", "set_position"),
        parameter="acc", vendor=True,
        resource={number: (f"drive{number}", None) for number in range(1, 4)})


def vsmd_serial():
    return _vsmd("vsmd-serial", baud=460800)


def vsmd_can():
    return _vsmd("vsmd-can", baud=3000000, bus={**SLCAN, "protocol": "vsmd-can"},
                 sim_bus={**SLCAN, "protocol": "vsmd-can", "baud": None})


def servo_can():
    words = {"command-word-base": 160, "command-word-length": 4, "command-word-0-at": 0,
             "command-word-1-at": 2, "command-word-ack": 7}
    bus = {**SLCAN, **words, "protocol": "servo-can"}
    return Family(
        "servo-can", 3,
        {"drives": 3, "baud": 3000000, "bus": bus, "sim_bus": {**bus, "baud": None},
         "drive": {"in-position-window": 10},
         "sim_drive": {"identity": None, "set": None}},
        ("move_velocity", "move_absolute", "set_position"), set_any_time=False,
        resource={number: (f"drive{number}", None) for number in range(1, 4)})


def xyza():
    places = [(1, "x"), (1, "y"), (2, "x")]
    return Family(
        "xyza", 3,
        {"drives": 3, "sim_drives": 2, "baud": 460800, "bus": {"protocol": "xyza"},
         "sim_bus": {"protocol": "xyza"},
         "per_drive": {n + 1: {"address": address, "axis": axis}
                       for n, (address, axis) in enumerate(places)},
         "sim_drive": {"identity": None, "step-ms": 50,
                       "set": ["min_speed=100", "max_speed=6400", "acceleration_time=1",
                               "brake=15", "enable=15"]}},
        ("move_velocity", "set_position"), set_any_time=False,
        resource={n + 1: (f"drive{address}", axis) for n, (address, axis) in enumerate(places)})


FAMILIES = {"vsmd-serial": vsmd_serial, "vsmd-can": vsmd_can, "xyza": xyza,
            "servo-can": servo_can}


# --- what obeyed requests mean -------------------------------------------------------------------------


def f32(raw):
    return struct.unpack(">f", raw)[0]


def i32(raw):
    return struct.unpack(">i", raw)[0]


def _vsmd_line(text):
    """One line of VSMD's ASCII protocol, its id first."""
    words = text.split()[1:]
    if not words:
        return OTHER, None, None
    rest = dict(word.split("=", 1) for word in words[1:] if "=" in word)
    plain = [word for word in words[1:] if "=" not in word]
    verb = words[0]
    if verb == "mov":
        return RUN, round(float(rest.get("spd", "0"))), None
    if verb in ("pos", "rmv"):
        return MOVE, round(float(rest.get("spd", "0"))), (verb, int(plain[0]))
    if verb in ("stp", "off"):
        return STOP if verb == "stp" else OFF, None, None
    if verb == "ena":
        return ON, None, None
    if verb == "org":
        return SET, int(plain[0]) if plain else 0, None
    if verb == "cfg":
        return PARAMETER, tuple(sorted((key, round(float(value))) for key, value in rest.items())), None
    return OTHER, verb, None


def _vsmd_frame(text):
    identifier, raw = text.split("#")
    identifier, raw = int(identifier, 16), bytes.fromhex(raw)
    control, register = identifier >> 7 & 3, identifier & 0x7F
    if control == 2:
        return PARAMETER, tuple([(register, raw.hex())]), None
    if register == 0x05:
        return RUN, round(f32(raw)) if raw else 0, None
    if register in (0x06, 0x0B):
        speed = round(f32(raw[4:8])) if len(raw) == 8 else 0
        return MOVE, speed, ("pos" if register == 6 else "rmv", i32(raw[:4]))
    simple = {0x01: ON, 0x02: OFF, 0x04: STOP}
    if register in simple:
        return simple[register], None, None
    if register == 0x03:
        return SET, i32(raw) if raw else 0, None
    return OTHER, register, None


class _Servo:
    """A servo's frames; a move's target comes before its trigger, which without power moves nothing."""

    def __init__(self):
        self.targets = {}
        self.trigger = {}

    def __call__(self, text, drive, enabled):
        identifier, raw = text.split("#")
        base, raw = int(identifier, 16) & ~0x1F, bytes.fromhex(raw)
        if base == 0x020:
            on = raw[:2] == bytes([0, 10])
            return ON if on else OFF, None, None
        if base == 0x060 and raw[0] == 1:
            speed = int.from_bytes(raw[1:3], "big", signed=True)
            return (RUN, speed, None) if speed else (STOP, None, None)
        if base == 0x080:
            self.targets[drive] = i32(raw[:4])
            return OTHER, "target", None
        if base == 0x0E0:
            return SET, i32(raw[:4]), None
        if base == 0x0A0:
            high, before = bool(raw[1] & 8), self.trigger.get(drive, False)
            self.trigger[drive] = high
            if high and not before and enabled:
                return MOVE, self.targets.get(drive), ("pos", self.targets.get(drive))
        return OTHER, identifier, None


class _Xyza:
    """A controller's frames; a jog's speed was written before, a position has two halves."""

    def __init__(self):
        self.speeds = {}
        self.magnitudes = {}

    def __call__(self, text, drive_name):
        raw = bytes.fromhex(text)
        mark, order, kind, target = raw[2], raw[3], raw[6], raw[7]
        value = raw[8:12]
        if order == 0xF1 and mark == 0x0B:
            axis = (target - 0xA1) >> 4
            number = int.from_bytes(value, "little")
            if kind == 0xE2 and target & 0xF == 4:
                self.speeds[drive_name, axis] = number
                return [("parameter", axis, ("manual_speed", number), None)]
            if kind == 0xE1 and target & 0xF == 1:
                self.magnitudes[drive_name, axis] = number
                return [(SET, axis, number, "magnitude")]
            if kind == 0xE1 and target & 0xF == 2:
                return [(SET, axis, None, "sign")]
            return [(OTHER, None, None, None)]
        if order == 0xF3 and kind == 0x03:
            axis, negative = divmod(target - 0xA1, 2)
            speed = self.speeds.get((drive_name, axis), 3200)
            return [(RUN, axis, -speed if negative else speed, None)]
        if order in (0xF3, 0xF4) and kind in (0x01, 0x02):
            return [(STOP, axis, None, "program" if order == 0xF4 else "manual")
                    for axis in range(4)]
        return [(OTHER, None, None, None)]


def _state(text):
    return {key: float(value) for key, value in (pair.split("=") for pair in text.split())}


class Reader:
    """Turns the witness's lines of a trace into events of the bridge's drives."""

    def __init__(self, family):
        self.family = family
        self.decode_servo = _Servo()
        self.decode_xyza = _Xyza()
        self.drives_of = {}
        for number, (simulated, axis) in family.resource.items():
            self.drives_of.setdefault(simulated, []).append((number, axis))

    def read(self, path):
        events = []
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            parts = line.split(" ", 3)
            if len(parts) == 4 and parts[2] == "!" and " moving=" in line:
                events += self._events(int(parts[0]) / 1e6, parts[1], parts[3])
        # A request's end may lie some microseconds behind what was written before it.
        return sorted(events, key=lambda event: event.time)

    def _events(self, time, simulated, rest):
        text, state = rest.rsplit(" |", 1)
        state = _state(state)
        word, _, request = text.partition(" ")
        decoded = None
        for number, axis in self.drives_of.get(simulated, []):
            event = Event(time, number, OTHER, text=text, obeyed=word != "refused")
            if axis:
                event.position = int(state[axis])
                event.velocity = state[f"{axis}_speed"]
                event.moving = bool(int(state["moving"]) >> "xyza".index(axis) & 1)
            else:
                event.position, event.velocity = int(state["position"]), state["velocity"]
                event.moving = bool(state["moving"])
            if word in (STANDS, POWER):
                event.kind = word
                event.value = request
                yield event
                continue
            if decoded is None:
                decoded = self._decode(request, simulated, state)
            for kind, place, tag, value in decoded:
                if place is None or place == "xyza".index(axis):
                    yield Event(time, number, kind, tag, value, event.obeyed, event.position,
                                event.velocity, event.moving, text)

    def _decode(self, request, simulated, state):
        if self.family.name == "xyza":
            return self.decode_xyza(request, simulated)
        if self.family.name == "servo-can":
            kind, tag, value = self.decode_servo(request, simulated, state["enabled"])
        elif self.family.name == "vsmd-can":
            kind, tag, value = _vsmd_frame(request)
        else:
            kind, tag, value = _vsmd_line(request)
        return [(kind, None, tag, value)]


def shown(events, count=30):
    """For a report."""
    return [re.sub(r"\s+", " ", f"{event.time:.4f} drive {event.drive} {event.text} "
                   f"| {event.position} {event.velocity:g}{' moving' if event.moving else ''}")
            for event in events[-count:]]
