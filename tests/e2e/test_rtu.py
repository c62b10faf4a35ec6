# SPDX-License-Identifier: Apache-2.0
"""A PLC on a serial line: Modbus RTU, with other devices on the same line, noise, and a port that goes away."""

import os
import random
import signal
import struct
import subprocess
import time

import pytest
from bridgelib import (
    DISABLED,
    ILLEGAL_ADDRESS,
    ILLEGAL_FUNCTION,
    ILLEGAL_VALUE,
    LATCHED_BIT,
    STANDSTILL,
    encode,
    eventually,
    find_program,
)
from rtulib import PAUSE, Plc, SerialLine, crc, framed

POSITION = struct.pack(">BHH", 3, 12, 2)


@pytest.fixture
def line(tmp_path):
    made = SerialLine(tmp_path / "plc")
    yield made
    made.close()


@pytest.fixture
def rtu_bridge(make_bridge, line):
    """A bridge with the line press; keys of its section."""

    def make(allow="write", modbus=None, roles=None, start=True, **options):
        keys = options.pop("line_keys", {})
        bridge = make_bridge(modbus={"confirm-ms": 400, **(modbus or {})}, **options)
        for name, role in (roles or {}).items():
            bridge.sections[f"role {name}"] = role
        bridge.sections["modbus-rtu press"] = {"device": line.link, "baud": 115200, "allow": allow, **keys}
        if start:
            bridge.reload()
            bridge.told("rtu press: a PLC at")
        return bridge

    return make


def block(bridge, command, **values):
    """FC 16 over the command block of a drive, from command_id on, as a PLC without a library builds it."""
    drive = bridge.drive()
    start = drive.row("command_id")
    entry = bridge.commands[command]
    rows = [drive.row("command"), *map(drive.row, entry["arguments"].split())]
    end = max(row.address + row.size for row in rows)
    words = [0] * (end - start.address)
    words[rows[0].address - start.address] = int(entry["code"])
    for name, value in values.items():
        row = drive.row(name)
        at = row.address - start.address
        words[at:at + row.size] = encode(row.type, value)
    data = b"".join(struct.pack(">H", word) for word in words)
    return struct.pack(">BHHB", 16, start.address, len(words), len(data)) + data


def single(bridge, command):
    """FC 6 to the command register."""
    return struct.pack(">BHH", 6, bridge.drive().row("command").address, int(bridge.commands[command]["code"]))


def step(bridge, distance=300, **values):
    return block(bridge, "move_relative", target_position=distance, target_velocity=12800, **values)


def rests_at(bridge, position, number=1):
    bridge.wait_standing(number)
    assert bridge.sim.get(f"drive{number}")["position"] == position


def figure(bridge, name, line_name="press"):
    done = subprocess.run([find_program("drivebridgectl"), "--socket", bridge.control_path, "metrics"],
                          capture_output=True, text=True, check=True, timeout=20)
    wanted = f'drivebridge_modbus_rtu_{name}{{line="{line_name}"}} '
    return next(int(text.removeprefix(wanted)) for text in done.stdout.splitlines() if text.startswith(wanted))


# --- what a PLC does ----------------------------------------------------------------------------------


def test_a_plc_reads_and_moves(rtu_bridge, line):
    bridge = rtu_bridge(drives=2)
    with Plc(bridge, line) as plc:
        assert plc.read("axis_state") in (STANDSTILL, DISABLED)
        assert plc.input_words(0, 10)[0] == plc.read("axis_state")
        assert plc.command("move_relative", target_position=500, target_velocity=12800) == 0
        rests_at(bridge, 500)
        eventually(lambda: plc.read("position") == 500)
        plc.number = 2
        assert plc.read("position") == 0
        assert plc.write("target_velocity", 100.0) == 0
        # What is wrong is answered as over TCP.
        assert plc.write_words(5999, [1]) == ILLEGAL_ADDRESS
        assert plc.write_word(plc.row("target_position").address, 1) == ILLEGAL_VALUE
    # Who it was is in the history, and among the clients.
    assert bridge.drive().read("history1_address") == "rtu press"
    assert bridge.gateway().read("client1_address") == "rtu press"
    assert bridge.gateway().read("client1_may_write") == 1
    assert bridge.gateway().read("client1_requests") > 5


def test_every_function(rtu_bridge, line):
    bridge = rtu_bridge()
    status = bridge.drive().row("axis_state").address
    assert line.request(struct.pack(">BHH", 3, status, 125))[:2] == bytes([3, 250])
    assert line.request(struct.pack(">BHH", 2, 0, 8))[:2] == bytes([2, 1])
    assert line.request(b"\x08\0\0\x12\x34") == b"\x08\0\0\x12\x34"
    assert line.request(b"\x11")[2:4] == b"\x01\xff"
    identity = line.request(b"\x2b\x0e\x01\0")
    assert b"drivebridge" in identity and b"vsmd-serial" in identity
    target = bridge.drive().row("target_position").address
    assert line.request(struct.pack(">BHHHHBi", 23, target, 2, target, 2, 4, -5)) == struct.pack(">BBi", 23, 4, -5)
    watchdog = bridge.drive().row("watchdog_ms").address
    assert line.request(struct.pack(">BHHH", 22, watchdog, 0, 700))[0] in (22, 0x96)
    assert line.request(struct.pack(">BHHBB", 15, 0, 1, 1, 0))[0] in (15, 0x8F)
    # No such function, and what only exceptions have.
    assert line.request(b"\x07") == bytes([0x87, ILLEGAL_FUNCTION])
    assert line.request(b"\x83\x02", timeout=0.3) is None


def test_rights_of_a_line(rtu_bridge, line):
    bridge = rtu_bridge(allow="read", drives=2)
    assert line.request(POSITION)[0] == 3
    assert line.request(step(bridge)) == bytes([0x90, ILLEGAL_FUNCTION])
    bridge.told("rtu press: write refused: its section has allow = read")
    # A role lets it command one drive and read the other. Its port is not closed for that.
    bridge.sections["role Press"] = {"read": "none", "write": ["drive1"]}
    bridge.sections["modbus-rtu press"] |= {"allow": "write", "role": "Press"}
    offset = bridge.log_size()
    bridge.reload()
    assert line.request(step(bridge))[0] == 16
    rests_at(bridge, 300)
    assert line.request(step(bridge), unit=2) == bytes([0x90, ILLEGAL_FUNCTION])
    assert line.request(POSITION, unit=2) == bytes([0x83, ILLEGAL_FUNCTION])
    assert "a PLC at" not in bridge.log_since(offset)
    # And back.
    bridge.sections["modbus-rtu press"] |= {"allow": "read", "role": None}
    bridge.reload()
    assert line.request(step(bridge)) == bytes([0x90, ILLEGAL_FUNCTION])
    rests_at(bridge, 300)


def test_units_of_the_line_and_the_gateway(rtu_bridge, line):
    bridge = rtu_bridge(drives=3, modbus={"gateway-unit": 100}, line_keys={"units": ["1-2", "100"]})
    drives = bridge.gateway().row("drive_count").address
    assert line.request(struct.pack(">BHH", 3, drives, 1), unit=100) == struct.pack(">BBH", 3, 2, 3)
    assert line.request(POSITION, unit=2)[0] == 3
    # Others belong to other devices, whatever the gateway has under that number.
    for unit in (3, 4, 247, 250, 255):
        assert line.request(POSITION, unit=unit, timeout=0.2) is None


def test_the_watchdog_and_a_port_that_goes_away(rtu_bridge, line):
    bridge = rtu_bridge(drive={"watchdog-ms": 500})
    assert line.request(block(bridge, "move_velocity", target_velocity=200))[0] == 16
    drive = bridge.drive()
    for _ in range(15):
        assert line.request(POSITION)[0] == 3
        time.sleep(0.06)
    assert drive.read("velocity") > 0, "its reads feed the watchdog"
    line.unplug()
    bridge.told("its PLC cannot be heard")
    eventually(lambda: drive.read("status") & LATCHED_BIT)
    bridge.wait_standing()
    eventually(lambda: bridge.gateway().read("client1_address") != "rtu press")
    line.plug()
    eventually(lambda: len([text for text in bridge.log_since(0).splitlines() if "a PLC at" in text]) == 2)
    assert line.request(block(bridge, "clear_fault"))[0] == 16
    assert line.request(step(bridge))[0] == 16
    bridge.wait_standing()


# --- once -----------------------------------------------------------------------------------------------


def test_a_repeated_request_is_executed_once(rtu_bridge, line):
    """The PLC gives up before the drive has confirmed, and sends the same again, twice."""
    bridge = rtu_bridge(modbus={"confirm-ms": 2000})
    bridge.sim.fault("lose-request 2")
    line.send(framed(1, step(bridge)))
    for _ in range(2):
        time.sleep(PAUSE)
        line.send(framed(1, step(bridge)))
    answer = line.receive()
    assert answer[:2] == b"\x01\x10" and crc(answer) == 0 and len(answer) == 8, answer.hex(" ")
    assert line.is_silent(), "one answer, to the last of them"
    rests_at(bridge, 300)
    assert figure(bridge, "repeated_total") == 2


def test_a_repeated_request_after_an_answer_that_came_too_late(rtu_bridge, line):
    bridge = rtu_bridge(modbus={"confirm-ms": 2000})

    def unanswered(rests):
        """The PLC does not wait for the answer, and asks another device."""
        bridge.sim.fault("lose-request 1")
        line.send(framed(1, step(bridge)))
        time.sleep(PAUSE)
        line.send(framed(77, POSITION))
        eventually(lambda: bridge.sim.get()["position"] == rests)
        bridge.wait_standing()

    unanswered(300)
    assert line.request(step(bridge))[0] == 16
    rests_at(bridge, 300)
    # What was answered is a new wish when it comes again.
    assert line.request(step(bridge))[0] == 16
    rests_at(bridge, 600)
    # So is what comes much later than a PLC repeats something.
    unanswered(900)
    time.sleep(2.1)
    assert line.request(step(bridge))[0] == 16
    rests_at(bridge, 1200)


def test_a_repeated_stop_acts_each_time(rtu_bridge, line):
    """Its answer was not sent, and another client has moved the drive since: the PLC's repetition stops it."""
    bridge = rtu_bridge(modbus={"confirm-ms": 2000}, line_keys={"answer-timeout-ms": 5000})
    bridge.sim.fault("lose-request 1")
    line.send(framed(1, block(bridge, "stop")))
    time.sleep(PAUSE)
    line.send(framed(77, POSITION))
    eventually(lambda: figure(bridge, "late_total") == 1)
    drive = bridge.drive()
    assert drive.command("move_velocity", target_velocity=2000.0) == 0
    assert line.request(block(bridge, "stop"))[0] == 16
    bridge.wait_standing()


def test_an_answer_is_not_sent_into_another_request(rtu_bridge, line):
    bridge = rtu_bridge(drives=2, modbus={"confirm-ms": 2000})
    bridge.sim.fault("lose-request 2")
    line.send(framed(1, step(bridge)))
    time.sleep(PAUSE)
    # It went on to another device, whose answer follows.
    line.send(framed(77, POSITION))
    assert line.is_silent(0.5)
    rests_at(bridge, 300)
    assert figure(bridge, "late_total") == 1


def test_of_requests_without_a_silence_the_last_one_counts(rtu_bridge, line):
    """As after a time in which nothing was read: the PLC waits for the answer to its last one only."""
    bridge = rtu_bridge()
    line.send(framed(1, step(bridge)) + framed(1, step(bridge)) + framed(1, step(bridge)))
    assert line.receive()[:2] == b"\x01\x10"
    assert line.is_silent()
    rests_at(bridge, 300)
    assert figure(bridge, "missed_total") == 2


def test_requests_of_a_time_in_which_the_service_stood_still(rtu_bridge, line):
    """A PLC sends its move again and again, and then asks for the position: that is what it waits for."""
    bridge = rtu_bridge()
    bridge.process.send_signal(signal.SIGSTOP)
    for _ in range(4):
        line.send(framed(1, step(bridge)))
        time.sleep(PAUSE)
    line.send(framed(1, POSITION))
    bridge.process.send_signal(signal.SIGCONT)
    assert line.receive()[:3] == b"\x01\x03\x04"
    assert line.is_silent()
    rests_at(bridge, 0)


def test_a_plc_that_never_waits(rtu_bridge, line):
    """Each request has a silence before it, and comes before the answer to the one before."""
    bridge = rtu_bridge(modbus={"confirm-ms": 2000})
    bridge.sim.fault("lose-request 1")
    for distance in range(1, 21):
        line.send(framed(1, step(bridge, distance=distance)))
        time.sleep(0.004)
    # The last one has an answer, perhaps others when this machine was slow to send.
    assert line.receive()[1] & 0x7F == 16
    assert line.request(POSITION)[0] == 3
    bridge.wait_standing()
    assert len([text for text in bridge.sim.sent() if " pos " in text]) <= 20
    # Other clients have not noticed.
    assert bridge.drive().command("stop") == 0


@pytest.mark.parametrize("late_s", (0, 0.004))
def test_an_adapter_that_echoes(rtu_bridge, line, late_s):
    """What it sends comes back: answers like requests are not executed, and nothing goes on for ever."""
    bridge = rtu_bridge()

    def echoed(pdu):
        line.send(framed(1, pdu))
        answer = line.receive()
        time.sleep(late_s)
        line.send(answer)
        return answer

    assert echoed(block(bridge, "move_relative", target_position=300, target_velocity=12800))[1] == 16
    assert line.is_silent()
    rests_at(bridge, 300)
    mark = bridge.sim.mark()
    assert echoed(single(bridge, "move_relative"))[1] == 6
    assert line.is_silent()
    rests_at(bridge, 600)
    assert len(bridge.sim.sent(mark)) == 1, bridge.sim.sent(mark)
    assert echoed(POSITION)[1] == 3
    assert line.is_silent()
    assert echoed(b"\x07")[1] == 0x87
    assert line.is_silent()
    assert figure(bridge, "echoes_total") == 4


# --- other devices, noise -------------------------------------------------------------------------------


def test_what_others_are_asked_and_answer(rtu_bridge, line):
    """Nothing of it is answered or executed, also where it looks like a request for this gateway."""
    bridge = rtu_bridge(drives=2, line_keys={"units": ["1"]})
    move = framed(1, step(bridge))
    # Another device answers with 60 registers that contain a whole request for unit 1, CRC included.
    hidden = framed(9, bytes([3, 120]) + move + bytes(120 - len(move)))
    for data in (framed(9, POSITION), hidden, framed(2, step(bridge)), framed(9, step(bridge)),
                 framed(9, b"\x90\x04"), hidden + framed(9, POSITION), framed(9, POSITION) + hidden,
                 framed(1, b"\x83\x02")):
        line.send(data)
        assert line.is_silent(2 * PAUSE), data.hex(" ")
    assert line.request(POSITION) == struct.pack(">BBi", 3, 4, 0)
    # Directly after the answer of another one, as from a fast PLC with a slow adapter.
    line.send(hidden + framed(1, POSITION))
    assert line.receive()[1] == 3
    rests_at(bridge, 0)
    rests_at(bridge, 0, 2)


def test_halves_noise_and_wrong_sums(rtu_bridge, line):
    bridge = rtu_bridge()
    move = framed(1, step(bridge))
    seed = random.randrange(1 << 32)
    print("seed", seed)
    some = random.Random(seed)
    for _ in range(60):
        at = some.randrange(len(move))
        wrong = bytearray(move)
        wrong[at] ^= 1 << some.randrange(8)
        cut = some.randrange(1, len(move))
        data = some.choice((bytes(wrong), move[:cut], move[cut:], some.randbytes(some.randrange(1, 300)),
                            some.randbytes(3) + move, move + some.randbytes(3), move[:cut] + move[:-2]))
        if crc(data) == 0:
            continue
        line.send(data)
        assert line.is_silent(2 * PAUSE), data.hex(" ")
    # Half a frame, and a whole one after a silence.
    line.send(move[:7])
    time.sleep(0.01)
    assert line.request(POSITION) == struct.pack(">BBi", 3, 4, 0)
    # A frame with gaps inside, such as adapters make.
    for part in (move[:5], move[5:9], move[9:]):
        line.send(part)
        time.sleep(0.004)
    assert line.receive()[:2] == b"\x01\x10"
    rests_at(bridge, 300)
    assert figure(bridge, "bad_total") > 30


def test_a_flood_makes_nobody_late(rtu_bridge, line):
    bridge = rtu_bridge()
    os.set_blocking(line.master, False)
    flood = random.Random(1).randbytes(4096)
    with bridge.raw() as raw:
        end = time.monotonic() + 0.5
        asked = 0
        while time.monotonic() < end:
            try:
                line.send(flood)
            except BlockingIOError:
                pass
            assert len(raw.request(struct.pack(">BHH", 3, 0, 10))) == 22
            asked += 1
    assert asked > 50
    os.set_blocking(line.master, True)
    eventually(lambda: line.request(POSITION, timeout=0.5) == struct.pack(">BBi", 3, 4, 0))
    assert figure(bridge, "overruns_total") > 0


# --- to all ---------------------------------------------------------------------------------------------


def test_a_broadcast_stops_and_does_nothing_else(rtu_bridge, line):
    bridge = rtu_bridge(drives=3, line_keys={"units": ["1-2"]})
    for unit in (1, 2, 3):
        assert bridge.drive(unit).command("move_velocity", target_velocity=200.0) == 0
    for pdu in (step(bridge), single(bridge, "move_velocity"), single(bridge, "home"), POSITION,
                struct.pack(">BHH", 6, bridge.drive().row("watchdog_ms").address, 1)):
        line.send(framed(0, pdu))
        assert line.is_silent(2 * PAUSE)
    bridge.told("request to unit 0 ignored")
    for unit in (1, 2, 3):
        assert bridge.drive(unit).read("velocity") > 0
        assert bridge.drive(unit).read("watchdog_ms") == 0
    # Nobody is silent for longer than between two frames before its own request.
    line.send(framed(0, single(bridge, "stop")) + framed(1, POSITION))
    assert line.receive()[1] == 3
    for unit in (1, 2):
        bridge.wait_standing(unit)
    assert bridge.drive(3).read("velocity") > 0, "its unit is not of the line"
    assert bridge.drive(2).read("history1_address") == "rtu press"
    assert bridge.drive(3).command("stop") == 0


def test_a_line_that_may_only_read_stops_nothing(rtu_bridge, line):
    bridge = rtu_bridge(allow="read")
    assert bridge.drive().command("move_velocity", target_velocity=200.0) == 0
    line.send(framed(0, single(bridge, "stop")))
    assert line.is_silent(2 * PAUSE)
    assert bridge.drive().read("velocity") > 0
    assert bridge.drive().command("stop") == 0


# --- life -----------------------------------------------------------------------------------------------


def test_lines_come_and_go_with_the_configuration(rtu_bridge, line):
    bridge = rtu_bridge()
    keys = bridge.sections.pop("modbus-rtu press")
    bridge.reload()
    eventually(lambda: line.request(POSITION, timeout=0.1) is None)
    bridge.sections["modbus-rtu other"] = keys
    bridge.reload()
    bridge.told("rtu other: a PLC at")
    assert line.request(step(bridge))[0] == 16
    rests_at(bridge, 300)
    assert bridge.drive().read("history1_address") == "rtu other"
    bridge.restart_bridge()
    bridge.told("rtu other: a PLC at")
    eventually(lambda: line.request(POSITION, timeout=1) is not None)


def test_counters_of_a_line(rtu_bridge, line):
    bridge = rtu_bridge()

    def counter(number):
        return struct.unpack(">BHH", line.request(struct.pack(">BHH", 8, number, 0)))[2]

    assert line.request(struct.pack(">BHH", 8, 10, 0)) == struct.pack(">BHH", 8, 10, 0)
    line.send(framed(9, POSITION))
    time.sleep(PAUSE)
    line.send(b"noise")
    time.sleep(2 * PAUSE)
    assert line.request(b"\x07") == bytes([0x87, ILLEGAL_FUNCTION])
    line.send(framed(0, POSITION))
    time.sleep(PAUSE)
    assert [counter(number) for number in range(11, 19)] == [4, 1, 1, 6, 1, 0, 0, 0]


def test_a_line_in_the_wrong_form(tmp_path):
    good = """bus line {
    protocol = vsmd-serial
    device = "/dev/null/none"
    cycle-ms = 50
}
drive feeder {
    bus = line
    address = 1
    unit = 1
}
modbus-rtu press {
    device = "/dev/null/other"
    units = {"1"}
}
"""
    path = tmp_path / "test.conf"
    for old, new, words in (
        ("", "", ""),
        ("/dev/null/other", "/dev/null/none", "is used by bus 'line'"),
        ('{"1"}', '{"0"}', "'0' is no unit id"),
        ('{"1"}', '{"9-5"}', "'9-5' is no unit id"),
        ('{"1"}', '{"1", "248"}', "'248' is no unit id"),
        ('{"1"}', "{}", "answers no unit"),
        ('{"1"}', "some", "is none of its words"),
        ('units = {"1"}', "role = Nobody", "there is no role 'Nobody'"),
        ('units = {"1"}', "allow = all", "is none of its words"),
        ("modbus-rtu press", "modbus-rtu a-name-of-16-char", "too long for the name of a line"),
        ("modbus-rtu press", "modbus-rtu", "is no name for a modbus-rtu"),
        ('    device = "/dev/null/other"\n', "", "has no key 'device'"),
    ):
        path.write_text(good.replace(old, new) if old else good, encoding="utf-8")
        done = subprocess.run([find_program("drivebridged"), "--check", "--config", path],
                              capture_output=True, text=True, timeout=20, check=False)
        assert (done.returncode == 0) == (not words), done.stderr
        assert words in done.stderr
    for old, new, words in (('{"1"}', '{"1", "7"}', "unit 7 is of no drive"),
                            ('units = {"1"}', "answer-timeout-ms = 30", "an answer can take")):
        path.write_text(good.replace(old, new), encoding="utf-8")
        done = subprocess.run([find_program("drivebridged"), "--check", "--config", path],
                              capture_output=True, text=True, timeout=20, check=False)
        assert done.returncode == 0 and words in done.stderr, done.stderr
    assert "modbus-rtu press" in done.stdout and "of every drive" in done.stdout
