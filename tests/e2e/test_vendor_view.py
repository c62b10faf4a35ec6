# SPDX-License-Identifier: Apache-2.0
"""The register map of the vendor's own Modbus models. Addresses and codes are literals, and requests
are put together byte by byte: a program written for such a model knows nothing of the bridge."""

import struct

import pytest
from bridgelib import (
    BUSY,
    DEVICE_FAILURE,
    ILLEGAL_ADDRESS,
    ILLEGAL_VALUE,
    NO_ANSWER,
    NO_PATH,
    STANDSTILL,
    Raw,
    Refused,
    eventually,
    f32,
)

VENDOR = 101
LOW_FIRST, HIGH_FIRST = 0, 1

# Bits of the status word.
STOPPED = 1 << 8
POWERED = 1 << 13
HOMED = 1 << 14

EVERYTHING = {
    "closed-loop": True,
    "external": True,
    "model": "080T",
    "max-current": 10,
    "set": ["spd=6400", "acc=64000", "dec=64000", "pae=1", "s3=1", "s4=1", "s5=1", "s6=1"],
}


class Plc:
    """What a VSMD1X5's master has: registers by number, and a word order of its own choice."""

    def __init__(self, port, unit=VENDOR, order=LOW_FIRST):
        self.link = Raw(port)
        self.unit = unit
        self.order = order

    def request(self, pdu):
        answer = self.link.request(pdu, self.unit)
        if answer[0] & 0x80:
            assert answer[0] == pdu[0] | 0x80 and len(answer) == 2
            raise Refused(answer[1])
        assert answer[0] == pdu[0]
        return answer

    def refusal(self, pdu):
        try:
            self.request(pdu)
        except Refused as error:
            return error.code
        return 0

    def _read(self, function, address, count):
        answer = self.request(struct.pack(">BHH", function, address, count))
        assert answer[1] == 2 * count
        return list(struct.unpack(f">{count}H", answer[2:]))

    def holding(self, address, count=1):
        return self._read(3, address, count)

    def inputs(self, address, count):
        return self._read(4, address, count)

    def wide(self, kind, value):
        """The two registers of a value."""
        words = list(struct.unpack(">HH", struct.pack(f">{kind}", value)))
        return words if self.order == HIGH_FIRST else words[::-1]

    def value(self, kind, words):
        words = words if self.order == HIGH_FIRST else words[::-1]
        return struct.unpack(f">{kind}", struct.pack(">HH", *words))[0]

    def write(self, address, words):
        """FC 16. The exception code, or 0."""
        head = struct.pack(">BHHB", 16, address, len(words), 2 * len(words))
        return self.refusal(head + struct.pack(f">{len(words)}H", *words))

    def write_one(self, address, word):
        """FC 6. The exception code, or 0."""
        return self.refusal(struct.pack(">BHH", 6, address, word))

    def speed(self):
        return self.value("f", self.inputs(0, 2))

    def position(self):
        return self.value("i", self.inputs(2, 2))

    def status(self):
        return self.value("I", self.inputs(4, 2))

    def arrived(self, target):
        words = self.inputs(0, 6)
        stopped = self.value("I", words[4:6]) & STOPPED
        return stopped and self.value("i", words[2:4]) == target


@pytest.fixture
def make_plc(make_bridge):
    links = []

    def make(order=LOW_FIRST, **options):
        drive = {"vendor-unit": VENDOR, **options.pop("drive", {})}
        if order == HIGH_FIRST:
            drive["vendor-word-order"] = "high-first"
        bridge = make_bridge(drive=drive, **options)
        plc = Plc(bridge.port, order=order)
        links.append(plc.link)
        return bridge, plc

    yield make
    for link in links:
        link.close()


# --- programs


@pytest.mark.parametrize("order", [LOW_FIRST, HIGH_FIRST])
def test_from_enable_to_a_finished_move(make_plc, order):
    bridge, plc = make_plc(order, sim_drive={"set": ["pae=0"]})
    assert plc.holding(0x29) == [order]
    assert not plc.status() & POWERED
    # Speed, acceleration, deceleration.
    words = plc.wide("f", 20000.5) + plc.wide("f", 200000) + plc.wide("f", 300000)
    assert plc.write(0x03, words) == 0
    assert plc.holding(0x03, 6) == words
    assert plc.write_one(0x00, 0x0101) == 0
    eventually(lambda: plc.status() & POWERED)
    for target in (10000, -3000, -3000, 70000):
        assert plc.write(0x01, plc.wide("i", target)) == 0
        assert plc.write_one(0x00, 0x0301) == 0
        eventually(lambda target=target: plc.arrived(target), what=f"the drive to be at {target}")
        assert plc.speed() == 0
        # Otherwise the next pos would begin to move by itself.
        assert plc.write_one(0x00, 0x0400) == 0
    assert bridge.sim.get()["position"] == 70000
    assert plc.write_one(0x00, 0x0100) == 0
    eventually(lambda: not plc.status() & POWERED)


def test_the_same_in_bytes(make_plc):
    bridge, plc = make_plc(sim_drive={"set": ["spd=192000", "acc=0", "dec=0", "pae=0"]})
    link = plc.link
    # Enable: transaction 1, unit 101, FC 6.
    link.send(bytes.fromhex("0001 0000 0006 65 06 0000 0101"))
    assert link.receive() == (1, 0x65, bytes.fromhex("06 0000 0101"))
    # To 100000, low word first, in one step.
    link.send(bytes.fromhex("0002 0000 000d 65 10 0000 0003 06 0301 86a0 0001"))
    assert link.receive() == (2, 0x65, bytes.fromhex("10 0000 0003"))
    # High word first: mbs, then back to 0.
    link.send(bytes.fromhex("0003 0000 0006 65 06 0029 0001"))
    assert link.receive() == (3, 0x65, bytes.fromhex("06 0029 0001"))
    link.send(bytes.fromhex("0004 0000 000d 65 10 0000 0003 06 0301 fffe 7960"))
    assert link.receive() == (4, 0x65, bytes.fromhex("10 0000 0003"))
    assert bridge.sim.sent()[-3:] == ["1 ena", "1 pos 100000", "1 pos -100000"]
    there = bytes.fromhex("04 04 fffe 7960")
    eventually(lambda: plc.request(bytes.fromhex("04 0002 0002")) == there)


@pytest.mark.parametrize("order", [LOW_FIRST, HIGH_FIRST])
def test_a_program_that_sets_its_word_order(make_plc, order):
    bridge, plc = make_plc(HIGH_FIRST if order == LOW_FIRST else LOW_FIRST)
    assert plc.write_one(0x29, order) == 0
    plc.order = order
    assert plc.holding(0x29) == [order]
    assert plc.write(0x05, plc.wide("f", 123456)) == 0
    assert bridge.drive().read("acc") == 123456
    assert plc.write_one(0x29, 2) == ILLEGAL_VALUE
    assert plc.holding(0x29) == [order]


def test_speed_mode_runs_at_spd(make_plc):
    bridge, plc = make_plc()
    assert plc.write(0x03, plc.wide("f", -3200)) == 0
    assert plc.write_one(0x00, 0x0300) == 0
    eventually(lambda: plc.speed() == -3200)
    assert plc.position() < 0
    assert plc.write_one(0x00, 0x0401) == 0
    eventually(lambda: plc.status() & STOPPED)
    assert plc.write_one(0x00, 0x0200) == 0
    assert plc.position() == 0
    assert bridge.sim.sent()[-4:] == ["1 cfg spd=-3200", "1 mov", "1 stp 1", "1 org 0"]


NAN = [0, 0x7FC0]


@pytest.mark.parametrize("words", [
    pytest.param([0x0400, 0, 0, *NAN], id="spd is no number"),
    pytest.param([0x0400, 0, 0, 0, 0, 0, 0xBF80], id="acc is negative"),
    pytest.param([0x0401, 0], id="half of pos"),
    pytest.param([0x0100, 0, 0, 0, 0x4800, 0, 0xBF80, 0, 0xBF80], id="disable beside three wrong ones"),
])
def test_a_stop_goes_out_whatever_stands_beside_it(make_plc, words):
    bridge, plc = make_plc()
    assert plc.write(0x03, plc.wide("f", 3200)) == 0
    assert plc.write_one(0x00, 0x0300) == 0
    eventually(lambda: plc.speed() == 3200)
    mark = bridge.sim.mark()
    assert plc.write(0x00, words) == 0
    eventually(lambda: bridge.sim.get()["velocity"] == 0)
    assert plc.value("f", plc.holding(0x03, 2)) == 3200
    assert not [line for line in bridge.sim.sent(mark) if " cfg" in line]


def test_homing(make_plc):
    bridge, plc = make_plc(sim_drive={"set": ["zmd=1", "zsd=-32000", "acc=0", "pae=1", "s1=0"]})
    mark = bridge.sim.mark()
    assert plc.write_one(0x00, 0x0601) == 0
    assert bridge.sim.sent(mark) == ["1 zero stop", "1 zero start"]
    assert plc.write_one(0x00, 0x0600) == 0
    assert bridge.sim.sent(mark)[2:] == ["1 zero stop"]
    assert not plc.status() & HOMED


# --- the trap


def test_in_position_mode_writing_pos_moves(make_plc):
    bridge, plc = make_plc()
    mark = bridge.sim.mark()
    assert plc.write(0x01, plc.wide("i", 500)) == 0
    assert bridge.sim.sent(mark) == []
    # Both at once: one move.
    assert plc.write(0x00, [0x0301, *plc.wide("i", 600)]) == 0
    assert bridge.sim.sent(mark) == ["1 pos 600"]
    assert plc.write(0x01, plc.wide("i", 700)) == 0
    assert bridge.sim.sent(mark)[1:] == ["1 pos 700"]
    eventually(lambda: plc.arrived(700))
    # Relative: each write goes on from where the drive stands.
    assert plc.write_one(0x00, 0x0400) == 0
    assert plc.write(0x01, plc.wide("i", -50)) == 0
    assert plc.write_one(0x00, 0x0302) == 0
    eventually(lambda: plc.arrived(650))
    assert plc.write(0x01, plc.wide("i", -30)) == 0
    eventually(lambda: plc.arrived(620))
    # Half of it neither moves nor is kept.
    mark = bridge.sim.mark()
    for address in (0x01, 0x02):
        assert plc.write_one(address, 5) == ILLEGAL_VALUE
    assert plc.holding(0x00, 3) == [0x0302, *plc.wide("i", -30)]
    # Reading does not move, nor does anything once another command was written.
    assert plc.write_one(0x00, 0x0400) == 0
    assert plc.write(0x01, plc.wide("i", 9000)) == 0
    assert bridge.sim.sent(mark) == ["1 stp"]


# --- every code


CODES = [
    (0x0100, ["off"]),
    (0x0101, ["ena"]),
    (0x0200, ["org 0"]),
    (0x0300, ["mov"]),
    (0x0400, ["stp"]),
    (0x0401, ["stp 1"]),
    (0x0500, ["sav"]),
    (0x0600, ["zero stop"]),
    (0x0700, ["s1 off"]),
    (0x0701, ["s1 on"]),
    (0x0800, ["s2 off"]),
    (0x0801, ["s2 on"]),
    (0x0900, ["s3 off"]),
    (0x0901, ["s3 on"]),
    (0x0A00, ["s4 off"]),
    (0x0A01, ["s4 on"]),
    (0x0B00, ["s5 off"]),
    (0x0B01, ["s5 on"]),
    (0x0C00, ["s6 off"]),
    (0x0C01, ["s6 on"]),
    (0x1000, ["eclr"]),
    (0x1300, ["shake stop"]),
    (0x1400, ["nmos1 0"]),
    (0x1512, ["nmos2 18"]),
    (0x16FF, ["nmos3 255"]),
    (0x1780, ["sv1 128"]),
    (0x1801, ["sv2 1"]),
    (0x19FF, ["sv3 255"]),
]


def test_every_command_code(make_plc):
    bridge, plc = make_plc(sim_drive=EVERYTHING)
    for code, lines in CODES:
        mark = bridge.sim.mark()
        # Only one model has outputs at s1 and s2: here the drive itself says no.
        no_output = 0x0700 <= code <= 0x0801
        answer = plc.write_one(0x00, code)
        while code == 0x0500 and answer == BUSY:  # a drive that still runs down is not to save
            answer = plc.write_one(0x00, code)
        assert answer == (DEVICE_FAILURE if no_output else 0), hex(code)
        assert bridge.sim.sent(mark) == [f"1 {line}" for line in lines], hex(code)
        assert plc.holding(0x00) == [code]
    mark = bridge.sim.mark()
    for code in (0x0001, 0x0102, 0x0201, 0x0303, 0x0402, 0x0602, 0x0702, 0x0D00, 0x1303, 0x1A00):
        assert plc.write_one(0x00, code) == ILLEGAL_VALUE, hex(code)
    assert plc.holding(0x00) == [0x19FF]
    assert bridge.sim.sent(mark) == []


def test_shaking(make_plc):
    bridge, plc = make_plc()
    mark = bridge.sim.mark()
    assert plc.write_one(0x00, 0x1301) == ILLEGAL_VALUE  # at no frequency
    words = plc.wide("i", -400) + plc.wide("i", 400) + plc.wide("f", 2.5) + [3]
    assert plc.write(0x3C, words) == 0
    assert plc.holding(0x3C, 7) == words
    assert plc.write_one(0x00, 0x1301) == 0
    assert plc.write_one(0x00, 0x1300) == 0
    assert plc.write_one(0x42, 60) == 0
    assert plc.write_one(0x00, 0x1302) == 0
    assert plc.write_one(0x00, 0x1300) == 0
    assert bridge.sim.sent(mark) == [
        "1 shake start spos=-400 epos=400 freq=2.5 cycles=3",
        "1 shake stop",
        "1 shake start spos=-400 epos=400 freq=2.5 time=60",
        "1 shake stop",
    ]


# --- parameters

# Address, registers and type of everything that is one parameter of the drive.
PARAMETERS = {
    "spd": (0x03, "f"),
    "acc": (0x05, "f"),
    "dec": (0x07, "f"),
    "cra": (0x09, "f"),
    "crn": (0x0B, "f"),
    "crh": (0x0D, "f"),
    "zmd": (0x18, "H"),
    "osv": (0x19, "H"),
    "snr": (0x1A, "H"),
    "zsd": (0x1B, "f"),
    "zsp": (0x1D, "i"),
    "cid": (0x1F, "H"),
    "bdr": (0x20, "I"),
    "mcs": (0x22, "H"),
    "msr": (0x23, "H"),
    "msv": (0x24, "H"),
    "psr": (0x25, "H"),
    "psv": (0x26, "H"),
    "zar": (0x27, "H"),
    "pae": (0x28, "H"),
    "pud": (0x2A, "H"),
    "emod": (0x2B, "H"),
    "elns": (0x2C, "H"),
    "estp": (0x2D, "H"),
    "erty": (0x2E, "H"),
    "edir": (0x2F, "H"),
    "ewr": (0x30, "H"),
    "ez": (0x31, "H"),
    "zcr": (0x33, "f"),
    "eratio": (0x35, "f"),
    "esds": (0x37, "f"),
    "res": (0x39, "I"),
    "sml": (0x43, "i"),
    "spl": (0x45, "i"),
}

NEW = {
    "spd": -1234.5, "acc": 60000, "dec": 50000, "cra": 1.25, "crn": 1.5, "crh": 0.5, "zmd": 2,
    "osv": 1, "snr": 3, "zsd": -800, "zsp": -70000, "cid": 9, "bdr": 57600, "mcs": 4, "msr": 2,
    "msv": 0, "psr": 3, "psv": 0, "zar": 1, "pae": 0, "pud": 0x2A, "emod": 2, "elns": 2500,
    "estp": 400, "erty": 7, "edir": 1, "ewr": 2, "ez": 33, "zcr": 0.75, "eratio": 2.5,
    "esds": 0.25, "res": 10000, "sml": -100000, "spl": 100001,
}  # fmt: skip


@pytest.mark.parametrize("order", [LOW_FIRST, HIGH_FIRST])
def test_every_parameter(make_plc, order):
    bridge, plc = make_plc(order, sim_drive=EVERYTHING)
    assert set(NEW) == set(PARAMETERS)
    for name, (address, kind) in PARAMETERS.items():
        words = [NEW[name]] if kind == "H" else plc.wide(kind, NEW[name])
        assert plc.holding(address, len(words)) != words, name
        mark = bridge.sim.mark()
        assert plc.write(address, words) == 0, name
        sent = bridge.sim.sent(mark)
        assert len(sent) == 1 and sent[0].startswith(f"1 cfg {name}="), name
        assert float(sent[0].partition("=")[2]) == pytest.approx(NEW[name]), name
        assert plc.holding(address, len(words)) == words, name
        # The neutral unit of the same drive shows it, too.
        expected = f32(NEW[name]) if kind == "f" else NEW[name]
        assert bridge.drive().read(name) == expected, name


def test_packed_registers(make_plc):
    bridge, plc = make_plc(sim_drive=EVERYTHING)
    assert plc.holding(0x0F) == [0x3C]
    mark = bridge.sim.mark()
    assert plc.write_one(0x0F, 0x18) == 0
    assert bridge.sim.sent(mark) == ["1 cfg s1=0 s2=0 s3=0 s4=1 s5=1 s6=0"]
    assert plc.holding(0x0F) == [0x18]
    mark = bridge.sim.mark()
    for port in range(6):
        assert plc.write_one(0x10 + port, (port + 1) << 8 | (9 - port)) == 0
    assert bridge.sim.sent(mark) == [
        f"1 cfg s{port + 1}f={port + 1} s{port + 1}r={9 - port}" for port in range(6)
    ]
    assert plc.holding(0x10, 6) == [0x0109, 0x0208, 0x0307, 0x0406, 0x0505, 0x0604]
    # FC 22: only the rising edge of s6.
    mask = struct.pack(">BHHH", 22, 0x15, 0xFF00, 0x0002)
    assert plc.request(mask) == mask
    assert plc.holding(0x15) == [0x0602]
    # FC 23: writes one and reads another.
    both = struct.pack(">BHHHHBH", 23, 0x14, 1, 0x15, 1, 2, 0x0101)
    assert plc.request(both) == b"\x17\x02\x05\x05"
    assert plc.holding(0x15) == [0x0101]
    for address, word in ((0x0F, 0x40), (0x10, 0x0A00), (0x10, 0x000A), (0x22, 9), (0x2A, 64)):
        assert plc.write_one(address, word) == ILLEGAL_VALUE


def test_the_whole_map_at_once(make_plc):
    bridge, plc = make_plc(sim_drive=EVERYTHING)
    words = plc.holding(0x00, 0x47)
    for name, (address, kind) in PARAMETERS.items():
        at = words[address] if kind == "H" else plc.value(kind, words[address : address + 2])
        assert at == bridge.drive().read(name), name
    for address in (0x16, 0x17, 0x32, 0x3B):
        assert words[address] == 0
        assert plc.write_one(address, 1) == ILLEGAL_VALUE
    # Written back as they are, without a command: one line for the drive.
    mark = bridge.sim.mark()
    assert plc.write(0x00, words) == 0
    assert len(bridge.sim.sent(mark)) == 1
    assert plc.holding(0x00, 0x47) == words


def test_parameters_and_a_command_in_one_write(make_plc):
    bridge, plc = make_plc()
    words = plc.wide("i", 4000) + plc.wide("f", 30000) + plc.wide("f", 90000)
    mark = bridge.sim.mark()
    assert plc.write(0x00, [0x0301, *words]) == 0
    assert bridge.sim.sent(mark) == ["1 cfg spd=30000 acc=90000", "1 pos 4000"]
    eventually(lambda: plc.arrived(4000))
    # A stop does not wait for them.
    mark = bridge.sim.mark()
    assert plc.write(0x00, [0x0400, *words]) == 0
    assert bridge.sim.sent(mark) == ["1 stp", "1 cfg spd=30000 acc=90000"]
    # What the drive refuses holds the command back.
    mark = bridge.sim.mark()
    words = plc.holding(0x01, 0x0F)
    assert plc.write(0x00, [0x0301, *words[:-1], 1]) == DEVICE_FAILURE  # s1 as an output
    assert not [line for line in bridge.sim.sent(mark) if " pos " in line]
    # What is out of range never reaches it.
    mark = bridge.sim.mark()
    wrong = plc.wide("i", 1) + plc.wide("f", 200000)
    assert plc.write(0x00, [0x0301, *wrong]) == ILLEGAL_VALUE
    assert not [line for line in bridge.sim.sent(mark) if line != "1 cfg"]


# --- reading and refusing


def test_input_registers(make_plc):
    bridge, plc = make_plc(sim_drive={"identity": "VSMD126_025T-1.0.008.170428"})
    words = plc.inputs(0, 20)
    text = b"".join(struct.pack("<H", word) for word in words[6:])
    assert text == b"VSMD126_025T-1.0.008.170428\0"
    for address in range(20):
        assert plc.inputs(address, 1)[0] == words[address] or address < 6
    for function, address, count in ((4, 20, 1), (4, 0, 21), (3, 0x47, 1), (3, 0x46, 2),
                                     (3, 101, 1), (1, 0, 1), (2, 0, 1)):
        pdu = struct.pack(">BHH", function, address, count)
        assert plc.refusal(pdu) == ILLEGAL_ADDRESS, (function, address)
    assert plc.write_one(0x47, 0) == ILLEGAL_ADDRESS
    assert plc.write(0x45, [0, 0, 0]) == ILLEGAL_ADDRESS
    assert plc.refusal(struct.pack(">BHH", 5, 0, 0xFF00)) == ILLEGAL_ADDRESS


def test_half_of_a_value(make_plc):
    bridge, plc = make_plc(sim_drive=EVERYTHING)
    mark = bridge.sim.mark()
    wide = [address for address, kind in PARAMETERS.values() if kind != "H"]
    for address in [0x01, *wide, 0x3C, 0x3E, 0x40]:
        assert plc.write_one(address, 0) == ILLEGAL_VALUE, hex(address)
        assert plc.write_one(address + 1, 0) == ILLEGAL_VALUE, hex(address)
        assert len(plc.holding(address + 1)) == 1
    for word in (0x7FC0, 0x7F80, 0xFF80):  # not finite
        assert plc.write(0x05, [0, word]) == ILLEGAL_VALUE
        assert plc.write(0x40, [0, word]) == ILLEGAL_VALUE
    assert bridge.sim.sent(mark) == []


def test_a_drive_that_does_not_answer(make_plc):
    bridge, plc = make_plc()
    bridge.sim.fault("silence on")
    eventually(lambda: plc.refusal(struct.pack(">BHH", 4, 0, 6)) == NO_ANSWER)
    assert plc.refusal(struct.pack(">BHH", 3, 0x05, 2)) == NO_ANSWER
    assert plc.holding(0x00, 3) == [0, 0, 0]
    assert plc.write_one(0x00, 0x0300) == NO_ANSWER
    assert plc.write_one(0x28, 1) == NO_ANSWER
    assert plc.holding(0x00) == [0]


# --- beside the neutral view


def test_both_units_are_one_drive(make_plc):
    bridge, plc = make_plc()
    drive = bridge.drive()
    assert plc.write(0x00, [0x0301, *plc.wide("i", 1000)]) == 0
    assert drive.read("result_command") == int(bridge.commands["move_absolute"]["code"])
    eventually(lambda: drive.read("position") == 1000)
    eventually(lambda: drive.read("axis_state") == STANDSTILL)
    # Writes of the neutral unit do not change what the vendor's registers hold.
    assert drive.command("move_absolute", target_position=50) == 0
    assert plc.holding(0x00, 3) == [0x0301, 1000, 0]
    plc.unit = VENDOR + 1
    assert plc.refusal(struct.pack(">BHH", 3, 0, 1)) == NO_PATH


def test_layout_of_the_drives_own_unit(make_bridge):
    bridge = make_bridge(drive={"layout": "vsmd"}, wait_online=False)
    plc = Plc(bridge.port, unit=1)
    with plc.link:
        known = struct.pack(">BHH", 3, 0x03, 2)
        eventually(lambda: plc.refusal(known) == 0, what="the drive's parameters to be known")
        assert plc.write(0x00, [0x0301, *plc.wide("i", 300)]) == 0
        eventually(lambda: plc.arrived(300))
        assert plc.refusal(struct.pack(">BHH", 3, 1000, 1)) == ILLEGAL_ADDRESS


def test_drives_on_can(make_plc):
    """A VSMD1X6: the same map, the same program, other frames behind it."""
    bus = {"protocol": "vsmd-can", "transport": "slcan", "bitrate": 1000000, "line": None}
    sim_bus = {"protocol": "vsmd-can", "baud": None, "line": None, "latency-us": None,
               "bitrate": 1000000}
    bridge, plc = make_plc(bus=bus, sim_bus=sim_bus, sim_drive={"set": ["pae=0", "dec=0"]})
    assert plc.write(0x03, plc.wide("f", 20000) + plc.wide("f", 0)) == 0
    assert plc.holding(0x03, 4) == plc.wide("f", 20000) + plc.wide("f", 0)
    assert plc.write_one(0x15, 0x0405) == 0
    assert plc.holding(0x15) == [0x0405]
    assert plc.write_one(0x00, 0x0101) == 0
    assert plc.write(0x00, [0x0301, *plc.wide("i", -2500)]) == 0
    eventually(lambda: plc.arrived(-2500))
    assert plc.write(0x01, plc.wide("i", 100)) == 0
    eventually(lambda: plc.arrived(100))
    assert bridge.sim.get()["position"] == 100


def test_who_may_only_read(make_plc):
    bridge, plc = make_plc(modbus={"allow-write": [], "allow-read": ["127.0.0.0/8"]})
    mark = bridge.sim.mark()
    assert plc.write_one(0x00, 0x0300) not in (0, BUSY)
    assert plc.holding(0x00) == [0]
    assert bridge.sim.sent(mark) == []
