# SPDX-License-Identifier: Apache-2.0
"""The registers as docs/register-map.csv promises them, and the parameters behind them."""

import struct

import pytest
from bridgelib import (
    BUS_DOWN_ERROR,
    DEVICE_FAILURE,
    DISABLED,
    ILLEGAL_ADDRESS,
    ILLEGAL_FUNCTION,
    ILLEGAL_VALUE,
    NO_PATH,
    STANDSTILL,
    Refused,
    decode,
    encode,
    eventually,
    f32,
)

EVERYTHING = {
    "closed-loop": True,
    "external": True,
    "model": "080T",
    "max-current": 10,
    "identity": "VSMD145_080T-2.1.009.190101",
}


def refused(call, *args, **kwargs):
    try:
        call(*args, **kwargs)
    except Refused as error:
        return error.code
    return 0


# --- reading


def test_every_register_is_readable(bridge):
    drive = bridge.drive()
    rows = bridge.map.of_drive()
    assert len(rows) > 100
    for row in rows:
        words = drive.words(row.address, row.size)
        assert len(words) == row.size, row
        if row.writable:
            assert refused(drive.input_words, row.address, row.size) == ILLEGAL_ADDRESS, row
        else:
            assert len(drive.input_words(row.address, row.size)) == row.size, row


def test_every_bit_is_readable(bridge):
    client = bridge.drive().client
    for row in bridge.map.of_drive("discrete"):
        answer = client.read_discrete_inputs(row.address, count=1, device_id=1)
        assert not answer.isError(), row
    for row in bridge.map.of_drive("coil"):
        assert not client.read_coils(row.address, count=1, device_id=1).isError(), row


def test_every_gateway_register_is_readable(bridge):
    """Those of the bus and drive that are configured; of others there are none."""
    gateway = bridge.gateway()
    for unit in (0, 255):
        gateway.number = unit
        for row in bridge.map.rows:
            if row.view != "gateway" or row.table != "holding":
                continue
            owner = row.name.split("_")[0]
            if owner.rstrip("0123456789") in ("bus", "drive", "line", "window") and owner not in (
                "bus", "drive", "bus1", "drive1", "line1", "window1"
            ):
                assert refused(gateway.words, row.address, row.size) == ILLEGAL_ADDRESS, row
            else:
                assert len(gateway.words(row.address, row.size)) == row.size, row


def test_gateway_knows_its_drives(make_bridge):
    bridge = make_bridge(drives=3)
    gateway = bridge.gateway()
    assert gateway.read("drive_count") == 3
    assert gateway.read("bus_count") == 1
    eventually(lambda: gateway.read("drives_online") == 3)
    assert [gateway.read(f"drive{number}_unit") for number in (1, 2, 3)] == [1, 2, 3]
    assert gateway.read("bus1_up") == 1
    assert gateway.read("bus1_period_us") == 20000


def test_uptime_begins_with_the_bridge(bridge):
    assert bridge.gateway().read("uptime_s") < 60
    assert bridge.stop_bridge() == 0
    bridge.start_bridge()
    assert bridge.gateway().read("uptime_s") < 60


def test_flat_window_shows_every_drive(make_bridge):
    """A PLC with one unit id sees all drives in the gateway's registers."""
    bridge = make_bridge(drives=2)
    gateway = bridge.gateway()
    for number in (1, 2):
        assert gateway.read(f"drive{number}_online") == 1
        assert gateway.read(f"drive{number}_axis_state") == bridge.drive(number).read("axis_state")


def test_every_drive_has_a_window(make_bridge):
    """As many as one CAN bus carries, none of them there."""
    drives = "".join(
        f"drive d{number} {{ bus = can  address = {number}  unit = {number} }}\n"
        for number in range(1, 111)
    )
    bridge = make_bridge(start_sim=False, text=f"""
        modbus {{ listen = "127.0.0.1:0" }}
        bus can {{ protocol = vsmd-can  transport = slcan  device = "/dev/null/none" }}
        {drives}""")
    gateway = bridge.gateway()
    for number in (1, 33, 110):
        assert gateway.words(2000 + 24 * (number - 1), 4) == [number, 0, 0, BUS_DOWN_ERROR]
    with pytest.raises(Refused, match="02"):
        gateway.words(2000 + 24 * 110, 1)


def test_longest_block(make_bridge):
    bridge = make_bridge(drives=8)
    gateway = bridge.gateway()
    start = gateway.row("drive1_unit").address
    words = gateway.words(start, 125)
    assert [words[at] for at in range(0, 125, 16)] == [1, 2, 3, 4, 5, 6, 7, 8]
    with bridge.raw() as raw:
        assert raw.request(struct.pack(">BHH", 3, start, 126), 255) == bytes([0x83, ILLEGAL_VALUE])
        assert raw.request(struct.pack(">BHH", 3, start, 0), 255) == bytes([0x83, ILLEGAL_VALUE])


def test_blocks_without_holes_read_whole(bridge):
    drive = bridge.drive()
    for first, last in (("axis_state", "deceleration"), ("command_id", "shake_time"),
                        ("bdr", "res"), ("identity", "parameters_generation")):
        values = drive.read_many(first, last)
        assert {first, last} <= set(values)


def test_a_block_is_one_moment(bridge):
    """Position in drive units and in user units belong together while the drive moves."""
    drive = bridge.drive()
    assert drive.command("move_velocity", target_velocity=50000) == 0
    for _ in range(200):
        values = drive.read_many("age_ms", "velocity_units")
        assert values["position_units"] == f32(values["position"])
        assert values["velocity_units"] == values["velocity"]
    drive.command("stop")


def test_status_bits_are_the_discrete_inputs(bridge):
    drive = bridge.drive()
    eventually(lambda: drive.read("axis_state") in (STANDSTILL, DISABLED))
    status = drive.read("status")
    rows = [row for row in bridge.map.of_drive("discrete") if row.address < 32]
    for row in rows:
        bits = drive.client.read_discrete_inputs(row.address, count=1, device_id=1).bits
        assert bits[0] == bool(status >> row.address & 1), row


def test_units_of_the_user(make_bridge):
    bridge = make_bridge(drive={"counts-per-unit": 640.0, "unit-name": "mm"})
    drive = bridge.drive()
    assert drive.read("unit_name") == "mm"
    assert drive.read("counts_per_unit") == 640.0
    assert drive.command("set_position", target_position=-1600) == 0
    eventually(lambda: drive.read("position_units") == -2.5)


def test_inputs_follow_the_sensors(bridge):
    drive = bridge.drive()
    for level in ("1", "0"):
        bridge.sim.control(f"sensor drive1 2 {level}")
        eventually(lambda level=level: drive.read("inputs") >> 1 & 1 == int(level))
        assert drive.client.read_discrete_inputs(33, count=1, device_id=1).bits[0] == (level == "1")


# --- refusing


def test_unknown_addresses(bridge):
    drive = bridge.drive()
    known = set()
    for row in bridge.map.of_drive():
        known |= set(range(row.address, row.address + row.size))
    beyond = max(known) + 1
    for address in (beyond, 4999, 65535):
        assert refused(drive.words, address, 1) == ILLEGAL_ADDRESS
        assert refused(drive.input_words, address, 1) == ILLEGAL_ADDRESS
        assert drive.write_words(address, [0]) == ILLEGAL_ADDRESS
        assert drive.write_word(address, 0) == ILLEGAL_ADDRESS
    assert refused(drive.words, beyond - 1, 2) == ILLEGAL_ADDRESS
    assert refused(drive.words, 65535, 2) in (ILLEGAL_ADDRESS, ILLEGAL_VALUE)


def test_one_block_for_a_whole_drive(bridge):
    """What many drivers make of tags that lie close together: one read across what this family lacks."""
    drive = bridge.drive()
    known = {row.address + i for row in bridge.map.of_drive() for i in range(row.size)}
    for read, count in ((drive.words, 67), (drive.input_words, 67), (drive.words, 100)):
        words = read(0, count)
        assert len(words) == count
        for address in set(range(count)) - known:
            assert words[address] == 0
            assert refused(read, address, 1) == ILLEGAL_ADDRESS
            assert drive.write_word(address, 0) == ILLEGAL_ADDRESS
    bits = drive.client.read_discrete_inputs(0, count=96, device_id=1)
    assert not bits.isError() and not bits.bits[20]


def test_read_only_registers_cannot_be_written(bridge):
    drive = bridge.drive()
    for name in ("axis_state", "position", "result", "identity", "requests"):
        row = drive.row(name)
        assert drive.write_words(row.address, [0] * row.size) == ILLEGAL_ADDRESS, name


def test_unknown_units(bridge):
    drive = bridge.drive()
    for unit in (2, 32, 100, 247, 254):
        drive.number = unit
        assert refused(drive.words, 0, 1) == NO_PATH
        assert drive.write_word(101, 3) == NO_PATH


def test_half_of_a_long_value_is_refused(bridge):
    drive = bridge.drive()
    mark = bridge.sim.mark()
    rows = [row for row in bridge.map.of_drive() if row.writable and row.size == 2]
    assert len(rows) > 20
    for row in rows:
        for address in (row.address, row.address + 1):
            assert drive.write_word(address, 0) == ILLEGAL_VALUE, row
            assert drive.write_words(address, [0]) == ILLEGAL_VALUE, row
    assert bridge.sim.sent(mark) == []


# --- each function code, byte by byte


def test_function_codes(make_bridge):
    bridge = make_bridge(sim_drive={"set": ["s3=1", "s4=1", "s5=1", "s6=1", "pae=1"]})
    block = bridge.map.find("target_position").address
    command_id = bridge.map.find("command_id").address
    param = bridge.map.find("dar").address
    identity = bridge.map.find("identity").address

    with bridge.raw() as raw:
        # 16, 3, 6, 22 and 23 on the arguments, which only are kept.
        assert raw.request(struct.pack(">BHHBHH", 16, block, 2, 4, 1, 2)) == struct.pack(
            ">BHH", 16, block, 2)
        assert raw.request(struct.pack(">BHH", 3, block, 2)) == b"\x03\x04\x00\x01\x00\x02"
        assert raw.request(struct.pack(">BHH", 6, command_id, 0xF0F0)) == struct.pack(
            ">BHH", 6, command_id, 0xF0F0)
        mask = struct.pack(">BHHH", 22, command_id, 0xFF00, 0x0012)
        assert raw.request(mask) == mask
        assert raw.request(struct.pack(">BHH", 3, command_id, 1)) == b"\x03\x02\xf0\x12"
        both = struct.pack(">BHHHHBHH", 23, block, 2, block, 2, 4, 0xFFFF, 0xFFFE)
        assert raw.request(both) == b"\x17\x04\xff\xff\xff\xfe"
        # 6 and 22 on a parameter of one register.
        assert raw.request(struct.pack(">BHH", 6, param, 40)) == struct.pack(">BHH", 6, param, 40)
        mask = struct.pack(">BHHH", 22, param, 0xFFF0, 0x0005)
        assert raw.request(mask) == mask
        assert raw.request(struct.pack(">BHH", 3, param, 1)) == b"\x03\x02\x00\x25"
        # 4
        assert raw.request(struct.pack(">BHH", 4, identity, 2)) == b"\x04\x04VSMD"
        # 1, 2, 5, 15
        coil = struct.pack(">BHH", 5, 4, 0xFF00)
        assert raw.request(coil) == coil
        assert raw.request(struct.pack(">BHHBB", 15, 2, 2, 1, 2)) == struct.pack(">BHH", 15, 2, 2)

        def coils():
            return raw.request(struct.pack(">BHH", 1, 0, 6)) == b"\x01\x01\x18"

        eventually(coils, what="the coils to show what was written")
        inputs = raw.request(struct.pack(">BHH", 2, 0, 1))
        assert inputs == b"\x02\x01\x01"
        assert raw.request(struct.pack(">BHH", 5, 4, 0x1234)) == bytes([0x85, ILLEGAL_VALUE])
        # 17
        server_id = raw.request(b"\x11")
        assert server_id[0] == 17
        assert server_id[1] == len(server_id) - 2
        # The unit as the id, the run indicator, then the text.
        assert server_id[2:4] == bytes([1, 0xFF])
        assert b"drivebridge" in server_id or b"VSMD" in server_id
        # 8: the loopback
        assert raw.request(b"\x08\x00\x00\x12\x34") == b"\x08\x00\x00\x12\x34"
        # Others do not exist here.
        for code in (7, 11, 12, 20, 21, 24, 99):
            assert raw.request(bytes([code, 0, 0, 0, 0])) == bytes([code | 0x80, ILLEGAL_FUNCTION])


def test_device_identification(bridge):
    with bridge.raw() as raw:
        answer = raw.request(b"\x2b\x0e\x01\x00")
        assert answer[:3] == b"\x2b\x0e\x01"
        count, objects, at = answer[6], {}, 7
        for _ in range(count):
            number, length = answer[at], answer[at + 1]
            objects[number] = answer[at + 2 : at + 2 + length].decode()
            at += 2 + length
        assert at == len(answer)
        assert set(objects) == {0, 1, 2}
        assert all(objects.values())
        # A single object, and one that does not exist.
        assert raw.request(b"\x2b\x0e\x04\x00")[7:9] == bytes([0, len(objects[0])])
        assert raw.request(b"\x2b\x0e\x04\x70") == bytes([0xAB, ILLEGAL_ADDRESS])
        assert raw.request(b"\x2b\x0e\x07\x00") == bytes([0xAB, ILLEGAL_VALUE])
        assert raw.request(b"\x2b\x0d\x00")[0] == 0xAB


def test_low_word_first(make_bridge):
    bridge = make_bridge(modbus={"word-order": "low-first"})
    drive = bridge.drive()
    assert drive.command("set_position", target_position=0x12345678) == 0
    row = drive.row("position")
    eventually(lambda: drive.words(row.address, 2) == [0x5678, 0x1234])
    assert drive.write("acc", 100000.5) == 0
    high, low = encode("f32", 100000.5)
    row = drive.row("acc")
    assert drive.words(row.address, 2) == [low, high]
    stamp = drive.read("timestamp_us")
    assert 1.5e15 < stamp < 1e17
    # Text is text: its order is that of its characters.
    row = drive.row("identity")
    assert decode("text", drive.words(row.address, row.size)).startswith("VSMD113")


# --- parameters


def sim_parameters(bridge):
    """What the drive itself last said its parameters are."""
    drive = bridge.drive()
    mark = len(bridge.sim.trace("<"))
    assert drive.command("read_parameters") == 0
    for text in bridge.sim.trace("<")[mark:]:
        if "bdr=" in text:
            pairs = text[text.index("bdr=") :].split()
            return {
                key: value for key, _, value in (pair.partition("=") for pair in pairs) if value
            }
    raise AssertionError("no parameters on the wire")


def number(text):
    digits = text.rstrip(".").split("\x03")[0]
    return float("".join(c for c in digits if c in "0123456789.+-eE"))


def test_parameters_are_what_the_drive_says(make_bridge):
    bridge = make_bridge(sim_drive=EVERYTHING)
    drive = bridge.drive()
    said = sim_parameters(bridge)
    rows = parameter_rows(bridge)
    assert len(rows) == 58
    for row in rows:
        assert drive.read(row.name) == pytest.approx(f32(number(said[row.name]))), row


def parameter_rows(bridge):
    return bridge.map.parameters()


@pytest.mark.parametrize("end", ["min", "max"])
def test_every_parameter_takes_its_ends(make_bridge, end):
    bridge = make_bridge(sim_drive=EVERYTHING)
    drive = bridge.drive()
    rows = parameter_rows(bridge)
    for row in rows:
        value = getattr(row, end)
        if row.name == "eratio":
            value = {"min": 0.001, "max": 1000.0}[end]
        if row.name == "res" and end == "max":
            value = 100000
        mark = bridge.sim.mark()
        if row.name in ("s1", "s2") and value:
            # Only the 010T has outputs there: the drive itself says no.
            assert drive.write(row.name, value) == DEVICE_FAILURE, row
            continue
        assert drive.write(row.name, value) == 0, row
        # After a refusal the bridge reads identity and parameters again by itself; a write whose answer
        # came too late is said again.
        sent = {line for line in bridge.sim.sent(mark) if line not in ("1 dev", "1 cfg")}
        assert len(sent) == 1 and sent.pop().startswith(f"1 cfg {row.name}="), row
        assert drive.read(row.name) == pytest.approx(f32(value)), row
    said = sim_parameters(bridge)
    for row in rows:
        assert drive.read(row.name) == pytest.approx(f32(number(said[row.name])), rel=1e-6), row


def test_values_out_of_range_never_reach_the_wire(make_bridge):
    bridge = make_bridge(sim_drive=EVERYTHING)
    drive = bridge.drive()
    mark = bridge.sim.mark()
    tried = 0
    limits = {"u16": (0, 65535), "u32": (0, 2**32 - 1), "i32": (-(2**31), 2**31 - 1)}
    for row in parameter_rows(bridge):
        if row.type == "f32":
            wrong = [float("nan"), float("inf"), -float("inf")]
            wrong += [value for value in (row.min - 1, row.max * 1.01) if abs(value) < 3e38]
        else:
            low, high = limits[row.type]
            wrong = [v for v in (row.min - 1, row.max + 1) if low <= v <= high]
        for value in wrong:
            assert drive.write(row.name, value) == ILLEGAL_VALUE, (row, value)
            tried += 1
    assert tried > 80
    assert bridge.sim.sent(mark) == []


def test_several_parameters_in_one_write_are_one_line(bridge):
    drive = bridge.drive()
    first = drive.row("spd")
    words = [*encode("f32", 1000.5), *encode("f32", 2000), *encode("f32", 3000)]
    mark = bridge.sim.mark()
    assert drive.write_words(first.address, words) == 0
    assert bridge.sim.sent(mark) == ["1 cfg spd=1000.5 acc=2000 dec=3000"]
    assert [drive.read(name) for name in ("spd", "acc", "dec")] == [1000.5, 2000, 3000]
    assert [drive.read(name) for name in ("acceleration", "deceleration")] == [2000, 3000]


def test_one_wrong_parameter_refuses_the_whole_write(bridge):
    drive = bridge.drive()
    first = drive.row("spd")
    mark = bridge.sim.mark()
    words = [*encode("f32", 1000), *encode("f32", 2000), *encode("f32", -1)]
    assert drive.write_words(first.address, words) == ILLEGAL_VALUE
    assert bridge.sim.sent(mark) == []


def test_all_that_was_read_can_be_written_back(bridge):
    """The model lists parameters that it refuses to be told: what it holds is read again."""
    drive = bridge.drive()
    rows = bridge.map.parameters()
    first, count = rows[0].address, rows[-1].address + rows[-1].size - rows[0].address
    words = drive.words(first, count)
    assert drive.write_words(first, words) == 0
    assert drive.words(first, count) == words
    different = drive.row("res").address - first
    words[different : different + 2] = encode("u32", 2000)
    assert drive.write_words(first, words) == DEVICE_FAILURE


def test_neutral_names_write_the_parameter(bridge):
    drive = bridge.drive()
    mark = bridge.sim.mark()
    assert drive.write("acceleration", 5000) == 0
    assert bridge.sim.sent(mark) == ["1 cfg acc=5000"]
    assert drive.read("acc") == 5000


def test_identity_and_place(make_bridge):
    bridge = make_bridge(drives=2, sim_per_drive={2: {"identity": "VSMD999_045T-9.9.999.991231"}})
    assert bridge.drive(2).read("identity") == "VSMD999_045T-9.9.999.991231"
    assert bridge.drive(1).read("identity").startswith("VSMD113_025T")
    assert bridge.drive(2).read("address") == 2
    assert bridge.drive(2).read("bus") == 1
