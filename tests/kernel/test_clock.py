# SPDX-License-Identifier: Apache-2.0
"""A gateway without a battery boots in the past and is told the time later. Only here may a test set
the clock: it is that of a kernel of its own."""

import time

from bridgelib import eventually

MINUTES = 37 * 60


def age_of_stamp(drive):
    """How far timestamp_us is from the clock, in seconds."""
    return abs(drive.read("timestamp_us") / 1e6 - time.time())


def test_stamps_follow_a_clock_that_is_set(link, make_bridge):
    bridge = make_bridge(interface=link.name)
    drive = bridge.drive()
    eventually(lambda: age_of_stamp(drive) < 1, what="stamps of now")
    for step in (MINUTES, -2 * MINUTES, MINUTES):
        time.clock_settime(time.CLOCK_REALTIME, time.time() + step)
        began = time.monotonic()
        eventually(lambda: age_of_stamp(drive) < 1, what=f"stamps after a step of {step} s")
        # "Within a second", and what a kernel with one processor and all of this takes.
        assert time.monotonic() - began < 3
    assert drive.read("age_ms") < 1000
