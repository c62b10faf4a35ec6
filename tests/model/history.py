# SPDX-License-Identifier: Apache-2.0
"""Histories: what clients and the world do to a plant, made from a seed, kept as JSON.

A history is a list of steps in the order in which they are to begin. A step begins when its actor
has ended its step before, and all steps but the latest few have ended: concurrent, and about the
same at each replay, however fast the machine is. Leaving steps out leaves the others as they are.
"""

import random
from dataclasses import asdict, dataclass, field

CLIENTS = 4
WORLD = -1
# So many steps may be under way at once.
WINDOW = 6

# ms without power or bus; the shortest is within one exchange.
AWAY = [30, 100, 200, 700]

STOPS = ("stop", "quick_stop", "disable")


@dataclass
class Step:
    who: int                 # client 0.., or WORLD
    do: str
    drive: int = 0
    name: str = ""           # of a command, or of what the world does
    number: int = 0          # command_id; 0: none, or written as 0
    bare: bool = False       # a write that leaves command_id out
    position: int = 0
    velocity: int = 0
    cut: str = ""            # "fin" or "rst": the connection is closed behind the request
    again: int = 0           # times the same write is sent over a new connection
    chase: str = ""          # a stop that is sent right behind it, over the same connection
    look: bool = False       # read the result registers afterwards
    gap: int = 0             # ms to wait before; of the world: until it is undone
    delay: int = 0           # ms that the world waits before
    undo: str = ""           # what ends what a "control" line began
    place: int = 0           # in the history


@dataclass
class History:
    family: str
    seed: str
    settings: dict = field(default_factory=dict)
    steps: list = field(default_factory=list)

    def packed(self):
        plain = asdict(Step(0, ""))
        steps = [{key: value for key, value in asdict(step).items()
                  if key in ("who", "do") or value != plain[key]} for step in self.steps]
        return {"family": self.family, "seed": self.seed, "settings": self.settings,
                "steps": steps}

    @staticmethod
    def unpacked(data):
        return History(data["family"], data["seed"], data["settings"],
                       [Step(**step) for step in data["steps"]])

    def of(self, places):
        """With only these steps."""
        return History(self.family, self.seed, self.settings, [self.steps[i] for i in places])


class Maker:
    def __init__(self, family, seed, count):
        self.family = family
        self.chance = random.Random(f"{family.name} {seed}")
        self.count = count
        self.tags = 0
        self.numbers = {}
        self.settings = {
            "scope": self.chance.choice(["drive", "client"]),
            "control": self.chance.random() < 0.1,
            "confirm-ms": self.chance.choice([40, 200, 1000]),
        }
        # A servo is stopped by taking its power off.
        enable = 25 if family.name == "servo-can" else 10
        self.kinds = [("command", 50), ("enable", enable), ("stop", 12), ("read", 15),
                      ("group_stop", 2), ("stage", 3), ("group_start", 2)]
        if family.vendor:
            self.kinds += [("vendor", 5)]
        if family.parameter:
            self.kinds += [("parameter", 4)]
        if self.settings["control"]:
            self.kinds += [("control", 6)]
        self.deeds = [("fault", 70), ("power", 9), ("kill", 4), ("reload", 4), ("change", 5),
                      ("restart", 2), ("silence", 6)]

    def pick(self, weighted):
        names, weights = zip(*weighted)
        return self.chance.choices(names, weights)[0]

    def numbers_its_commands(self, who, drive):
        """With one memory of ids a drive, two clients that number would undo each other's."""
        return self.settings["scope"] == "client" or who == drive % CLIENTS

    def next_number(self, who, drive):
        key = (who, drive) if self.settings["scope"] == "client" else drive
        self.numbers[key] = self.numbers.get(key, 0) + 1
        return self.numbers[key]

    def tag(self):
        self.tags += 1
        return self.tags

    def arguments(self, step):
        """Arguments that no other step has; the sign and the distance are of no importance."""
        tag = self.tag()
        sign = self.chance.choice([-1, 1])
        if step.name in ("move_absolute", "move_relative"):
            step.velocity = self.family.tag_speed(tag)
            step.position = sign * (tag * 10 + self.chance.randrange(10))
            if self.family.name == "servo-can":
                step.position, step.velocity = step.position * 10, 0
        elif step.name == "move_velocity":
            step.velocity = sign * self.family.tag_speed(tag)
        elif step.name == "set_position":
            step.position = sign * (100000 + tag)

    def number_it(self, step):
        form = self.chance.random()
        if self.numbers_its_commands(step.who, step.drive) and form < 0.7:
            step.number = self.next_number(step.who, step.drive)
            if self.chance.random() < 0.25:
                step.cut = self.chance.choice(["", "fin", "rst"])
                step.again = self.chance.randrange(1, 3)
            step.look = self.chance.random() < 0.5
        else:
            step.bare = form > 0.85
            if self.chance.random() < 0.05:
                step.cut = self.chance.choice(["fin", "rst"])
        # A place that a moving drive was near already cannot be proven, and only the result says so.
        step.look = step.look or step.name == "set_position"

    def client_step(self):
        step = Step(self.chance.randrange(CLIENTS), self.pick(self.kinds),
                    self.chance.randint(1, self.family.drives))
        if self.settings["scope"] == "drive" and self.chance.random() < 0.5:
            step.who = step.drive % CLIENTS  # who may number
        if step.do in ("command", "stage"):
            step.name = self.chance.choice(self.family.commands)
            self.arguments(step)
        elif step.do == "enable":
            step.do, step.name = "command", "enable"
        elif step.do == "stop":
            step.do = "command"
            step.name = self.chance.choices(STOPS, [7, 3, 1])[0]
        elif step.do == "vendor":
            step.name = self.chance.choice(["stop", "halt", "enable", "go"])
            step.position = 50000 + self.tag() * 3
        elif step.do == "parameter":
            step.velocity = 600000 + self.tag()
        elif step.do == "control":
            step.number = self.chance.choice([1, 1, 0])
        if step.do == "command":
            self.number_it(step)
            if not step.cut and not step.again and self.chance.random() < 0.1:
                step.chase = self.chance.choice(["stop", "quick_stop"])
        if self.chance.random() < 0.3:
            step.gap = self.chance.choice([1, 5, 20, 60])
        return step

    def world_step(self):
        step = Step(WORLD, self.pick(self.deeds), self.chance.randint(1, self.family.drives))
        if step.do == "fault":
            fault = self.chance.choice(["drop", "lose-request", "corrupt", "truncate", "garbage",
                                        "double", "wrong-id", "delay 80"])
            step.name = f"{fault} {self.chance.choice([1, 1, 1, 2, 3])}"
        elif step.do in ("power", "silence"):
            step.gap = self.chance.choice(AWAY)
        return step

    def make(self, seed):
        history = History(self.family.name, str(seed), self.settings)
        commands = 0
        while commands < self.count:
            if self.chance.random() < 0.06:
                history.steps.append(self.world_step())
            else:
                step = self.client_step()
                commands += step.do not in ("read", "control")
                history.steps.append(step)
        for place, step in enumerate(history.steps):
            step.place = place
        return history


def make(family, seed, count):
    return Maker(family, seed, count).make(seed)
