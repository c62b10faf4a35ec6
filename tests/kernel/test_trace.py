# SPDX-License-Identifier: Apache-2.0
"""The trace of a bus on a real CAN stack, with candump as the witness of what was there."""

import json

from bridgelib import find_program
from kernellib import run


def text(frame):
    return f"{frame.id:08X}#{frame.data.hex().upper()}"


def test_the_trace_of_an_interface_has_every_frame(link, make_bridge, witness):
    """What both sides said, in the order of the wire but for what the bridge sent while something came."""
    plant = make_bridge(interface=link.name, drives=2)
    plant.drive(1).settle("enable")
    plant.drive(1).settle("move_absolute", target_position=200, target_velocity=8000.0)
    done = run(find_program("drivebridgectl"), "--socket", plant.control_path, "--json", "trace", "--past",
               "--duration", "1")
    witness.catch_up()
    records = [json.loads(line) for line in done.stdout.splitlines()]
    numbers = [one["number"] for one in records]
    assert numbers == list(range(1, 1 + len(numbers))), "from the first frame on"
    seen = [text(frame) for frame in witness.frames() if not frame.error]
    for direction, control in (("sent", 0x100), ("received", 0)):
        mine = [f"{one['id'] & 0x1FFFFFFF:08X}#{one['data']}" for one in records if one["direction"] == direction]
        theirs = [frame for frame in seen if int(frame[:8], 16) & 0x100 == control]
        assert len(mine) > 20 and mine == theirs[:len(mine)]
