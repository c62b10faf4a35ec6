# SPDX-License-Identifier: Apache-2.0
"""What keeps a motion going: the commands that are admitted, and the reads of who commands. A PLC that has died is
missed although somebody else's requests are refused for ever."""

import math
import struct
import time

import pytest
from bridgelib import Raw, encode, eventually

SPEED = 2000
WATCHDOG = 0.6
# A busy machine takes its time (s).
PATIENCE = 0.4
MOVE_VELOCITY = 5


class Other(Raw):
    """A client of another address, which may write as well."""

    def __init__(self, bridge, source="127.0.0.2"):
        super().__init__(bridge.port, source)
        self.row = bridge.drive().row
        self.commands = bridge.commands

    def write(self, name, words):
        """FC 16 from this register on. The exception code, or 0."""
        values = struct.pack(f">{len(words)}H", *words)
        answer = self.request(struct.pack(">BHHB", 16, self.row(name).address, len(words), len(values)) + values)
        return answer[1] if answer[0] & 0x80 else 0

    def read(self, name):
        return self.request(struct.pack(">BHH", 3, self.row(name).address, self.row(name).size))


def moves(bridge):
    """It has the speed; its PLC reads meanwhile."""
    eventually(lambda: bridge.drive().read("velocity") == SPEED and bridge.sim.get()["velocity"] == SPEED,
               what="the drive to move")


def set_going(make_bridge, watchdog=WATCHDOG):
    """A drive that the PLC has set going, with id 8."""
    bridge = make_bridge(drive={"watchdog-ms": int(watchdog * 1000), "max-velocity": 10000})
    drive = bridge.drive()
    assert drive.command("enable", command_id=6) == 4
    assert drive.settle("enable", command_id=7) == 1
    assert drive.settle("move_velocity", command_id=8, target_velocity=SPEED) == 1
    moves(bridge)
    return bridge


@pytest.fixture
def plant(make_bridge):
    return set_going(make_bridge)


def block(command_id, command, velocity):
    return [command_id, command, 0, 0, *encode("f32", velocity)]


def trips_while(plant, act, timeout=5 * WATCHDOG):
    """How long it takes until the watchdog stops the drive while somebody acts again and again; None: it does not."""
    plant.drive().read("position")
    began = time.monotonic()
    while time.monotonic() - began < timeout:
        act()
        if plant.sim.get()["velocity"] != SPEED:
            return time.monotonic() - began
        time.sleep(0.03)
    return None


REFUSED = {
    "no number": (3, lambda other: other.write("command_id", block(0, MOVE_VELOCITY, math.nan))),
    "over max-velocity": (3, lambda other: other.write("command_id", block(0, MOVE_VELOCITY, 20000))),
    "unknown command": (3, lambda other: other.write("command", [4000])),
    "a command of other families": (1, lambda other: other.write("command", [int(other.commands["jog_positive"]["code"])])),
    "read-only register": (2, lambda other: other.write("position", [0, 0])),
    "half a value": (3, lambda other: other.write("target_position", [0])),
    "arguments alone": (0, lambda other: other.write("target_position", [0, 0])),
    "an id of another client again": (0, lambda other: other.write("command_id", block(8, MOVE_VELOCITY, SPEED))),
    "the watchdog's time as it is": (0, lambda other: other.write("watchdog_ms", [0, int(WATCHDOG * 1000)])),
    "a heartbeat that nobody asked for": (0, lambda other: other.write("heartbeat", [time.monotonic_ns() % 60000])),
    "reads": (None, lambda other: other.read("position")),
}


@pytest.mark.parametrize("case", REFUSED)
def test_somebody_else_keeps_no_motor_going(plant, case):
    code, act = REFUSED[case]
    with Other(plant) as other:
        assert code is None or act(other) == code
        took = trips_while(plant, lambda: act(other))
    assert took is not None and took < WATCHDOG + PATIENCE
    assert plant.drive().read("watchdog_trips") == 1


def test_what_is_refused_makes_nobody_a_commander(plant):
    """Its reads would count from then on."""
    with Other(plant) as other:
        assert other.write("command_id", block(0, MOVE_VELOCITY, 20000)) == 3
        took = trips_while(plant, lambda: other.read("position"))
    assert took is not None and took < WATCHDOG + PATIENCE


@pytest.mark.parametrize("case", ["no number", "over max-velocity", "read-only register", "arguments alone"])
def test_the_plc_itself_is_not_heard_by_what_is_refused(plant, case):
    with Other(plant, "127.0.0.1") as plc:
        assert plc.write("command_id", block(9, MOVE_VELOCITY, SPEED)) == 0
        moves(plant)
        took = trips_while(plant, lambda: REFUSED[case][1](plc))
    assert took is not None and took < WATCHDOG + PATIENCE


ADMITTED = {
    "its reads": lambda plc: plc.read("position"),
    "its last block again": lambda plc: plc.write("command_id", block(9, MOVE_VELOCITY, SPEED)),
    "its command without an id": lambda plc: plc.write("command_id", block(0, MOVE_VELOCITY, SPEED)),
    "the watchdog's time": lambda plc: plc.write("watchdog_ms", [0, int(WATCHDOG * 1000)]),
    "its heartbeat": lambda plc: plc.write("heartbeat", [7]),
}


@pytest.mark.parametrize("case", ADMITTED)
def test_who_commands_is_heard(plant, case):
    with Other(plant) as plc:
        assert plc.write("command_id", block(9, MOVE_VELOCITY, SPEED)) == 0
        moves(plant)
        assert trips_while(plant, lambda: ADMITTED[case](plc), 3 * WATCHDOG) is None
    # And missed, then.
    began = time.monotonic()
    eventually(lambda: plant.sim.get()["velocity"] == 0, what="the watchdog")
    assert time.monotonic() - began < WATCHDOG + PATIENCE


def test_a_plc_that_connects_anew_is_known_by_its_last_block(plant):
    with Other(plant) as plc:
        assert plc.write("command_id", block(9, MOVE_VELOCITY, SPEED)) == 0
        moves(plant)
    with Other(plant) as plc:
        last_block = ADMITTED["its last block again"]
        assert trips_while(plant, lambda: last_block(plc), 2 * WATCHDOG) is None
        # Its reads count again as well.
        assert trips_while(plant, lambda: plc.read("position"), 2 * WATCHDOG) is None


def test_a_plc_that_goes_on_after_a_crash_is_known_by_its_baseline(make_bridge):
    """The service was killed while a drive moved: its PLC is the one that goes on with its last block."""
    plant = set_going(make_bridge, 2)
    plant.process.kill()
    plant.process.wait()
    for unit in plant.units.values():
        unit.close()
    plant.units = {}
    # Its parameters follow some seconds later, as it moves.
    plant.wait_online = False
    plant.start_bridge()
    eventually(plant.drive().online, what="the drive to be there")
    with Other(plant) as plc:
        assert plc.write("command_id", block(8, MOVE_VELOCITY, SPEED)) == 4
        assert trips_while(plant, lambda: plc.write("command_id", block(8, MOVE_VELOCITY, SPEED)), 4) is None
    eventually(lambda: plant.sim.get()["velocity"] == 0, what="the watchdog")


@pytest.mark.parametrize("name", ["clear_fault", "read_parameters"])
@pytest.mark.parametrize("again", [False, True])
def test_a_panel_that_sets_nothing_going_feeds_nothing(plant, name, again):
    """Its button was pressed once, or is for ever; it reads on."""
    code = int(plant.commands[name]["code"])
    with Other(plant) as panel:
        panel.write("command_id", [0, code])

        def act():
            if again:
                panel.write("command_id", [0, code])
            panel.read("position")

        assert trips_while(plant, act) is not None
