# SPDX-License-Identifier: Apache-2.0
"""SIGHUP: what changed begins anew, and nothing else notices."""

import itertools
import os
import re
import socket
import threading
import time

import pytest
from bridgelib import (
    CONTINUOUS,
    DEVICE_FAILURE,
    ILLEGAL_ADDRESS,
    ILLEGAL_FUNCTION,
    ILLEGAL_VALUE,
    NO_PATH,
    ONLINE_BIT,
    PARAMS_VALID_BIT,
    RESULT_OK,
    RESULT_RESTARTED,
    STANDSTILL,
    Raw,
    Refused,
    Unit,
    encode,
    eventually,
    find_program,
    section,
)
from pymodbus.client import ModbusTcpClient

# Times that a busy machine can keep, so that a missed cycle or answer is the reload's fault.
BUS = {"cycle-ms": 400, "drive-latency-ms": 390}


def drive_keys(number, **keys):
    return {"bus": "line", "address": number, "unit": number, "watchdog-ms": 0, **keys}


def starts_moving(bridge, number=1, velocity=3200):
    drive = bridge.drive(number)
    assert drive.command("enable") == 0
    assert drive.command("move_velocity", target_velocity=velocity) == 0
    eventually(lambda: drive.read("axis_state") == CONTINUOUS)


def exception_of(drive, name="status"):
    try:
        drive.read(name)
    except Refused as refused:
        return refused.code
    return 0


def is_ready(drive):
    return exception_of(drive) == 0 and drive.read("status") & PARAMS_VALID_BIT


def is_there(drive):
    """Its parameters are not read while a drive of the line moves."""
    return exception_of(drive) == 0 and drive.read("status") & ONLINE_BIT


class Witness:
    """What a drive that nothing changed for must keep, and its bus's cycles."""

    def __init__(self, bridge, number=1, bus=1):
        self.bridge, self.number, self.bus = bridge, number, bus
        self.drive = bridge.drive(number)
        self.before = self.look()
        self.since = time.monotonic()

    def look(self):
        gateway = self.bridge.gateway()
        return {
            "overruns": gateway.read(f"bus{self.bus}_overruns"),
            "opens": gateway.read(f"bus{self.bus}_opens"),
            "came_online": self.drive.read("came_online"),
            "timeouts": self.drive.read("timeouts"),
            "stops": self.bridge.sim.get(f"drive{self.number}")["stp"],
        }

    def undisturbed(self):
        assert self.drive.online()
        assert self.look() == self.before


def test_a_moving_drive_does_not_notice(make_bridge):
    bridge = make_bridge(drives=2, sim_drives=3, bus=BUS)
    starts_moving(bridge)
    witness = Witness(bridge)
    gateway = bridge.gateway()
    cycles, since = gateway.read("bus1_cycles"), time.monotonic()

    bridge.sections["drive drive3"] = drive_keys(3)
    log = bridge.reload()
    assert "drive drive3: reload: it is added\n" in log and "2 drives continue without interruption\n" in log
    eventually(lambda: is_there(bridge.drive(3)), what="drive 3 to be there")
    witness.undisturbed()

    bridge.sections["drive drive2"]["max-velocity"] = 5000
    log = bridge.reload()
    assert "drive drive2: reload: it is changed" in log and "2 drives continue without interruption\n" in log
    eventually(lambda: is_there(bridge.drive(2)), what="drive 2 to be back")
    witness.undisturbed()

    del bridge.sections["drive drive3"]
    log = bridge.reload()
    assert "drive drive3: reload: it is removed" in log
    assert exception_of(bridge.drive(3)) == NO_PATH
    witness.undisturbed()

    assert bridge.drive().read("axis_state") == CONTINUOUS
    ran = gateway.read("bus1_cycles") - cycles
    assert ran == pytest.approx((time.monotonic() - since) / 0.4, abs=2)
    # And it still obeys.
    position = bridge.sim.get()["position"]
    eventually(lambda: bridge.sim.get()["position"] > position)
    assert bridge.drive().command("stop") == 0


def test_a_changed_drive_is_stopped_and_comes_back_with_its_settings(make_bridge):
    bridge = make_bridge(drives=2, bus=BUS)
    starts_moving(bridge, 2)
    witness = Witness(bridge)
    stops = bridge.sim.get("drive2")["stp"]
    drive = bridge.drive(2)
    bridge.sections["drive drive2"].update({"max-velocity": 1000, "unit-name": "mm"})
    bridge.reload()
    # Once more as the new drive, if it still braked as the old one.
    assert bridge.sim.get("drive2")["stp"] - stops in (1, 2)
    eventually(lambda: is_ready(drive), what="drive 2 to be back")
    eventually(lambda: drive.read("axis_state") == STANDSTILL)
    assert drive.read("unit_name") == "mm"
    assert drive.command("move_velocity", target_velocity=2000) == ILLEGAL_VALUE
    # It is a new drive to the bridge: the first id is only the baseline.
    assert drive.command("move_velocity", 7, target_velocity=500) == DEVICE_FAILURE
    assert drive.read("result") == RESULT_RESTARTED
    witness.undisturbed()


def test_what_on_exit_said_before_counts(make_bridge):
    bridge = make_bridge(drives=2, bus=BUS, per_drive={2: {"on-exit": "none"}})
    starts_moving(bridge, 2)
    stops = bridge.sim.get("drive2")["stp"]
    bridge.sections["drive drive2"]["on-exit"] = "stop"
    bridge.reload()
    eventually(lambda: is_there(bridge.drive(2)), what="drive 2 to be back")
    assert bridge.sim.get("drive2")["stp"] == stops
    assert bridge.drive(2).read("axis_state") == CONTINUOUS
    del bridge.sections["drive drive2"]
    bridge.reload()
    assert bridge.sim.get("drive2")["stp"] == stops + 1


def test_ids_and_the_block_are_remembered(make_bridge):
    bridge = make_bridge(drives=2, bus=BUS)
    drive = bridge.drive()
    step = {"target_position": 300, "target_velocity": 12800}
    assert drive.command("move_relative", 1, **step) == DEVICE_FAILURE
    assert drive.command("move_relative", 2, **step) == 0
    bridge.wait_standing()
    del bridge.sections["drive drive2"]
    bridge.sections["modbus"]["confirm-ms"] = 3000
    bridge.reload()
    assert (drive.read("result_id"), drive.read("result")) == (2, RESULT_OK)
    assert drive.read("target_position") == 300
    assert drive.command("move_relative", 2, **step) == 0
    bridge.wait_standing()
    assert bridge.sim.get()["position"] == 300
    assert drive.command("move_relative", 3, **step) == 0
    bridge.wait_standing()
    assert bridge.sim.get()["position"] == 600


def test_the_watchdog_goes_on(make_bridge):
    bridge = make_bridge(drives=2, bus=BUS, drive={"watchdog-ms": 1500})
    starts_moving(bridge)
    for limit in (1000, 2000, 3000):
        bridge.sections["drive drive2"]["max-velocity"] = limit
        bridge.reload()
        assert 0 < bridge.drive().read("watchdog_remaining_ms") <= 1500
    drive = bridge.drive()
    # Only the gateway is looked at, which feeds nothing.
    stops = bridge.sim.get()["stp"]
    eventually(lambda: bridge.sim.get()["stp"] > stops, what="the watchdog")
    del bridge.sections["drive drive2"]
    bridge.reload()
    assert drive.read("watchdog_trips") == 1
    assert drive.command("move_velocity", target_velocity=100) == DEVICE_FAILURE


def test_a_wrong_file_changes_nothing(make_bridge):
    bridge = make_bridge(drives=2, bus=BUS)
    starts_moving(bridge)
    witness = Witness(bridge)
    witness2 = Witness(bridge, 2)
    bridge.sections["drive drive2"]["unit"] = 1
    bridge.sections["modbus"]["gateway-unit"] = 100
    log = bridge.reload()
    assert re.search(r"bridge\.conf:\d+: .*unit", log) and "nothing changes" in log
    witness.undisturbed()
    witness2.undisturbed()
    with pytest.raises(Refused):
        Unit(bridge, 100, "gateway").read("version_major")
    bridge.config_path.unlink()
    offset = bridge.log_size()
    bridge.hang_up()
    eventually(lambda: "nothing changes" in bridge.log_since(offset))
    witness.undisturbed()


def test_the_same_again_changes_nothing(make_bridge):
    bridge = make_bridge(drives=2, bus=BUS)
    witness = Witness(bridge)
    # Other lines, and a default spelled out.
    bridge.sections["bus line"]["retries"] = 2
    bridge.sections = {"modbus": bridge.sections["modbus"], **bridge.sections}
    log = bridge.reload()
    assert "is what is loaded already" in log and "is changed" not in log
    witness.undisturbed()


def test_sections_change_their_places(make_bridge):
    """Numbers in the gateway's registers follow the file; nothing else happens."""
    bridge = make_bridge(drives=2, bus=BUS)
    witnesses = [Witness(bridge, 1), Witness(bridge, 2)]
    gateway = bridge.gateway()
    assert gateway.read("drive1_unit") == 1
    first = bridge.sections.pop("drive drive1")
    bridge.sections["drive drive1"] = first
    log = bridge.reload()
    assert "2 drives continue without interruption" in log and "is changed" not in log
    assert gateway.read("drive1_unit") == 2
    for witness in witnesses:
        witness.undisturbed()
    # Commands and their ends still find their drives.
    for number in (1, 2):
        assert bridge.drive(number).command("move_absolute", target_position=number * 100,
                                            target_velocity=12800) == 0
        bridge.wait_standing(number)
        assert bridge.sim.get(f"drive{number}")["position"] == number * 100


def test_a_bus_moves_to_another_device(make_bridge):
    """The same port under another name: the old bus must have let it go."""
    bridge = make_bridge(drives=2, bus=BUS)
    starts_moving(bridge)
    stops = bridge.sim.get()["stp"]
    other = bridge.place / "other"
    other.symlink_to(bridge.link)
    drive = bridge.drive()
    bridge.sections["bus line"]["device"] = other
    log = bridge.reload()
    assert "bus line: reload: it is changed" in log
    assert log.count("starts again with its bus") == 2
    assert bridge.sim.get()["stp"] > stops
    eventually(lambda: is_ready(drive), what="drive 1 to be back")
    bridge.told(f"{other} is up")
    eventually(lambda: drive.read("axis_state") == STANDSTILL)
    assert drive.command("move_absolute", target_position=50, target_velocity=12800) == 0


def test_buses_come_and_go(make_bridge):
    bridge = make_bridge(drives=1, bus=BUS)
    witness = Witness(bridge)
    gateway = bridge.gateway()
    before = dict(bridge.sections)
    bridge.sections = {
        "modbus": before["modbus"],
        "bus second": {"protocol": "vsmd-serial", "device": bridge.place / "none"},
        **bridge.sections,
        "drive far": {"bus": "second", "address": 1, "unit": 9},
    }
    log = bridge.reload()
    assert "bus second: reload: it is added\n" in log and "drive far: reload: it is added\n" in log
    # The bus that stays is the second one now.
    assert (gateway.read("bus_count"), gateway.read("bus2_up")) == (2, 1)
    assert exception_of(bridge.drive(9)) in (0, NO_PATH)
    eventually(lambda: "cannot open" in bridge.log_path.read_text())
    assert gateway.read("bus1_up") == 0
    Witness(bridge, bus=2).undisturbed()
    bridge.sections = before
    log = bridge.reload()
    assert "bus second: reload: it is removed\n" in log and "drive far: reload: it is removed" in log
    assert gateway.read("bus_count") == 1
    witness.undisturbed()


def texts(bridge):
    """The configuration as it is, and without its drives."""
    whole = bridge.config_path.read_text(encoding="utf-8")
    return whole, whole[:whole.index("drive drive1")]


def test_all_drives_go_and_come_back(make_bridge):
    bridge = make_bridge(drives=1, bus=BUS)
    gateway = bridge.gateway()
    whole, empty = texts(bridge)
    # Said on purpose: the file ends with the word for it.
    bridge.reload(empty + "end\n")
    assert (gateway.read("bus_count"), gateway.read("drive_count")) == (1, 0)
    bridge.reload(whole + "end\n")
    eventually(lambda: is_ready(bridge.drive()), what="the drive to be back")


def test_a_file_that_was_cut_off_drops_no_drive(make_bridge):
    """A full disk, an editor that has just begun, an empty file: whatever the first bytes say."""
    bridge = make_bridge(drives=2, bus=BUS)
    starts_moving(bridge)
    witness = Witness(bridge, 2)
    whole, empty = texts(bridge)
    wrong = ["\n", "# nothing\n", empty, empty[:empty.index("bus line")], "end\n",
             whole[:whole.index("watchdog-ms")], whole[:-3]]
    for text in wrong:
        log = bridge.reload(text)
        assert "nothing changes" in log and "reload: done" not in log, text
    # Once the file says where it ends, it has to go on doing so.
    bridge.reload(whole + "\nend  # of the file\n")
    for cut in range(0, len(whole), 40):
        log = bridge.reload(whole[:cut] or "\n")
        assert "nothing changes" in log and "reload: done" not in log, whole[:cut]
    assert "its last line was end and is not any more" in bridge.reload(whole)
    witness.undisturbed()
    assert len(bridge.gateway().words(0, 10)) == 10


def test_a_folder_beside_the_file(make_bridge):
    """conf.d: more of the configuration, which a reload reads too."""
    bridge = make_bridge(drives=2, bus=BUS)
    folder = bridge.place / "conf.d"
    folder.mkdir()
    second = bridge.sections.pop("drive drive2")
    (folder / "20-second.conf").write_text(section("drive drive2", second), encoding="utf-8")
    (folder / "10-network.conf").write_text(section("modbus", {"confirm-ms": 1234}))
    (folder / "30-other.txt").write_text("nonsense")
    witness = Witness(bridge)
    # Set in two places.
    log = bridge.reload()
    assert f"{folder}/10-network.conf:2: confirm-ms was set on line 3 of {bridge.config_path}" in log
    del bridge.sections["modbus"]["confirm-ms"]
    log = bridge.reload()
    assert "the section modbus is changed" in log and "2 drives continue without interruption" in log
    witness.undisturbed()
    # What is wrong is told by its own file and line, and nothing changes.
    (folder / "40-wrong.conf").write_text("# first line\ndrive third {\n  bus = nowhere\n")
    log = bridge.reload()
    assert f"{folder}/40-wrong.conf:4: the file ends too early" in log and "nothing changes" in log
    (folder / "40-wrong.conf").write_text("drive drive2 {\n  unit = 9\n}\n")
    assert f"40-wrong.conf:1: there is a drive 'drive2' on line 1 of {folder}/20-second.conf" \
        in bridge.reload()
    (folder / "40-wrong.conf").unlink()
    (folder / "20-second.conf").unlink()
    assert "drive drive2: reload: it is removed" in bridge.reload()


# --- clients ----------------------------------------------------------------------------------------


class Client(Unit):
    """From an address of its own, to an address and port that may be others than the bridge's."""

    def __init__(self, bridge, source, address="127.0.0.1", port=None):
        super().__init__(bridge, 1, "drive")
        self.client.close()
        self.client = ModbusTcpClient(address, port=port or bridge.port, timeout=10, retries=0,
                                      source_address=(source, 0))
        assert self.client.connect()


def listening(log):
    return int(re.search(r"listening on .*:(\d+)\n", log).group(1))


def free_everywhere():
    """A port that is free at every address of the machine: below those that the kernel gives to every
    program's connections, one of which may always be in the way."""
    for port in itertools.count(10000 + os.getpid() % 20000):
        try:
            socket.create_server(("0.0.0.0", port)).close()
            return port
        except OSError:
            assert port < 31000


def test_listening_elsewhere(make_bridge):
    bridge = make_bridge(bus=BUS)
    starts_moving(bridge)
    witness = Witness(bridge)
    stays = bridge.drive()
    port = free_everywhere()
    bridge.sections["modbus"]["listen"] = f"127.0.0.2:{port}"
    assert listening(bridge.reload()) == port
    witness.undisturbed()
    assert stays.command("move_velocity", target_velocity=100) == 0
    with pytest.raises(ConnectionRefusedError):
        Raw(bridge.port)
    with socket.create_connection(("127.0.0.2", port), 5):
        pass
    # All addresses, on the port that is in use.
    bridge.sections["modbus"]["listen"] = f"0.0.0.0:{port}"
    assert listening(bridge.reload()) == port
    bridge.port = port
    other = bridge.connect()
    assert other.online()
    other.close()
    witness.undisturbed()


def test_where_it_cannot_listen_nothing_changes(make_bridge):
    bridge = make_bridge(drives=2, bus=BUS)
    witness = Witness(bridge, 2)
    with socket.create_server(("127.0.0.3", 0)) as taken:
        place = f"127.0.0.3:{taken.getsockname()[1]}"
        bridge.sections["modbus"]["listen"] = place
        del bridge.sections["drive drive2"]
        log = bridge.reload()
    assert f"cannot listen on {place}" in log and "nothing changes" in log
    witness.undisturbed()
    bridge.connect().close()


def test_who_may_write_is_looked_at_again(make_bridge):
    bridge = make_bridge(bus=BUS, modbus={"allow-write": ["127.0.0.0/8"], "control": "drive"})
    drive, reader, stranger = bridge.drive(), Client(bridge, "127.0.0.2"), bridge.raw("127.0.0.3")
    assert reader.command("enable") == 0
    assert reader.read("control_request") == 1
    assert drive.command("disable", 1) == 0
    bridge.sections["modbus"].update({"allow-write": ["127.0.0.1"], "allow-read": ["127.0.0.2"]})
    bridge.reload()
    assert stranger.closed()
    assert reader.command("enable") == ILLEGAL_FUNCTION
    assert reader.online()
    # Control went with the right to write.
    assert reader.read("control_request") == 0
    assert drive.command("enable") == 0
    bridge.sections["modbus"]["allow-write"] = ["127.0.0.0/8"]
    bridge.sections["modbus"]["control"] = "off"
    bridge.reload()
    assert reader.command("disable") == 0
    reader.close()


def test_other_settings_of_clients(make_bridge):
    bridge = make_bridge(bus=BUS)
    drive, gateway = bridge.drive(), bridge.gateway()
    assert drive.command("set_position", target_position=0x10002) == 0
    eventually(lambda: drive.read("position") == 0x10002)
    bridge.sections["modbus"].update({"word-order": "low-first", "gateway-unit": 100,
                                      "max-clients": 3, "reserved-writers": 0,
                                      "write-confirm": "accepted"})
    bridge.reload()
    drive.low_first = gateway.low_first = True
    assert drive.read("position") == 0x10002
    own = Unit(bridge, 100, "gateway")
    own.low_first = True
    assert own.read("version_major") == gateway.read("version_major")
    with bridge.raw() as fourth:
        assert fourth.closed()
    assert gateway.read("refused_full") == 1
    bridge.sim.fault("silence on")
    began = time.monotonic()
    assert drive.command("set_position", target_position=1) == 0
    assert time.monotonic() - began < 1
    bridge.sim.fault("silence off")
    own.close()


# --- what was asked of a drive that goes ----------------------------------------------------------------


def test_writes_that_wait_are_answered_once(make_bridge):
    bridge = make_bridge(drives=2, bus={**BUS, "drive-latency-ms": 300})
    bridge.drive(2).command("enable")
    code = int(bridge.commands["move_absolute"]["code"])
    words = [code, *encode("i32", 1000), *encode("f32", 100.0)]
    address = bridge.map.find("command").address
    pdu = bytes([16]) + address.to_bytes(2, "big") + bytes([0, len(words), 2 * len(words)])
    pdu += b"".join(word.to_bytes(2, "big") for word in words)
    read = bytes([3, 0, 0, 0, 1])
    bridge.sim.fault("delay 150", "drive2")
    with bridge.raw() as client:
        for transaction in range(1, 7):
            client.send(client.adu(transaction, 2, pdu))
        eventually(lambda: bridge.drive(2).read("active_command") == code)
        del bridge.sections["drive drive2"]
        bridge.write_config()
        bridge.hang_up()
        client.send(client.adu(7, 2, read))
        answers = [client.receive() for _ in range(7)]
        # And nothing more.
        client.send(client.adu(8, 1, read))
        assert client.receive()[0] == 8
    assert [answer[0] for answer in answers] == [1, 2, 3, 4, 5, 6, 7]
    for _, _, answer in answers[:6]:
        assert answer in (bytes([0x90, DEVICE_FAILURE]), pdu[:1] + pdu[1:5])
    assert bytes([0x90, DEVICE_FAILURE]) in [answer[2] for answer in answers]
    assert answers[6][2] == bytes([0x83, NO_PATH])
    eventually(lambda: "reload: done" in bridge.log_path.read_text())
    assert exception_of(bridge.drive(2)) == NO_PATH


def test_a_silent_drive_is_removed_in_the_end(make_bridge):
    """Its stop is tried for a while, in which everybody else is served; meanwhile its unit is gone, and
    nobody takes its place in the gateway's registers."""
    # So slow a cycle that waiting for the silent one does not make it late.
    bridge = make_bridge(drives=3, bus={**BUS, "cycle-ms": 1000})
    starts_moving(bridge, 1)
    gateway = bridge.gateway()
    bridge.sim.fault("silence on", "drive1")
    eventually(lambda: gateway.read("drive1_online") == 0)
    witness = Witness(bridge, 3)
    del bridge.sections["drive drive1"]
    bridge.write_config()
    offset = bridge.log_size()
    bridge.hang_up()
    eventually(lambda: "drive drive1: reload: it is removed" in bridge.log_since(offset))
    assert "reload: done" not in bridge.log_since(offset)
    assert exception_of(bridge.drive()) == NO_PATH
    assert [gateway.read(f"drive{n}_unit") for n in (1, 2, 3)] == [1, 2, 3]
    assert gateway.read("drive1_online") == 0
    assert bridge.drive(3).command("set_position", target_position=5) == 0
    eventually(lambda: "reload: done" in bridge.log_since(offset))
    assert [gateway.read(f"drive{n}_unit") for n in (1, 2)] == [2, 3]
    witness.undisturbed()


# --- several reloads, and the end ------------------------------------------------------------------------


def slow_reload(bridge):
    """One that takes a second and a half: drive 1 leaves, and does not hear."""
    bridge.sim.fault("silence on", "drive1")
    bridge.kept = bridge.sections.pop("drive drive1")
    bridge.write_config()
    offset = bridge.log_size()
    bridge.hang_up()
    eventually(lambda: "drive drive1: reload: it is removed" in bridge.log_since(offset))
    return offset


def test_another_one_meanwhile_is_remembered(make_bridge):
    bridge = make_bridge(drives=2, sim_drives=3, bus=BUS)
    witness = Witness(bridge, 2)
    offset = slow_reload(bridge)
    bridge.sections["drive drive3"] = drive_keys(3)
    bridge.write_config()
    bridge.hang_up()
    bridge.hang_up()
    bridge.sim.fault("silence off", "drive1")
    bridge.sections["drive drive1"] = bridge.kept
    bridge.write_config()
    eventually(lambda: bridge.log_since(offset).count("reload: done") == 2)
    assert "drive drive3: reload: it is added" in bridge.log_since(offset)
    for number in (1, 2, 3):
        eventually(lambda n=number: is_ready(bridge.drive(n)), what=f"drive {number}")
    assert bridge.drive(2).read("came_online") == witness.before["came_online"]


def test_the_end_meanwhile(make_bridge):
    bridge = make_bridge(drives=2, sim_drives=3, bus=BUS)
    starts_moving(bridge, 2)
    stops = bridge.sim.get("drive2")["stp"]
    bridge.sections["drive drive3"] = drive_keys(3)
    bridge.sections["bus other"] = {"protocol": "vsmd-serial", "device": bridge.place / "none"}
    slow_reload(bridge)
    assert bridge.stop_bridge() == 0
    assert bridge.sim.get("drive2")["stp"] > stops


class Commands(threading.Thread):
    """A client that moves drive 1 a step at a time, each one told twice under its id."""

    STEP = 10

    def __init__(self, bridge):
        super().__init__()
        self.drive = bridge.connect()
        self.done = threading.Event()
        self.moved = 0
        self.failure = None
        args = {"target_position": self.STEP, "target_velocity": 64000}
        assert self.drive.command("move_relative", 1, **args) == DEVICE_FAILURE

    def step(self, number):
        """A drive in motion refuses a relative move: nothing else may keep one from being done."""
        args = {"target_position": self.STEP, "target_velocity": 64000}
        eventually(lambda: self.drive.read("axis_state") == STANDSTILL)
        for _ in range(2):
            code = self.drive.command("move_relative", number, **args)
            assert code == 0, (number, code, self.drive.read("result"))
        self.moved += 1

    def run(self):
        try:
            for number in itertools.count(2):
                if self.done.is_set():
                    return
                self.step(number % 65535 + 1)
        except Exception as failure:  # pylint: disable=broad-except
            self.failure = failure

    def end(self):
        self.done.set()
        self.join()
        self.drive.close()
        if self.failure:
            raise self.failure


def resident(bridge):
    """KiB."""
    with open(f"/proc/{bridge.process.pid}/status", encoding="utf-8") as file:
        return int(re.search(r"VmRSS:\s+(\d+) kB", file.read()).group(1))


def is_sanitized():
    program = find_program("drivebridged").read_bytes()
    return b"__asan_init" in program or b"__tsan_init" in program


def test_two_hundred_reloads(make_bridge):
    """While a client commands: every command executed once, and nothing left behind."""
    bridge = make_bridge(drives=2, sim_drives=3, bus={"drive-latency-ms": 500})
    witness = Witness(bridge)
    client = Commands(bridge)
    client.start()
    sizes = []
    for number in range(200):
        bridge.sections["drive drive2"]["max-velocity"] = 1000 + number % 7
        if number % 5 == 0:
            bridge.sections["drive drive3"] = drive_keys(3)
        elif number % 5 == 3:
            del bridge.sections["drive drive3"]
        bridge.reload()
        sizes.append(resident(bridge))
    # And without waiting for them to be done.
    for number in range(50):
        bridge.sections["drive drive2"]["max-velocity"] = 2000 + number % 3
        bridge.write_config()
        bridge.hang_up()
    client.end()
    bridge.wait_standing()
    assert client.moved > 20
    assert bridge.sim.get()["position"] == client.moved * client.STEP
    assert witness.look()["came_online"] == witness.before["came_online"]
    assert witness.look()["opens"] == witness.before["opens"]
    # Sanitizers keep what was freed for a while, and look for leaks themselves.
    if not is_sanitized():
        assert max(sizes[100:]) <= max(sizes[:100]) + 64


# --- other families -----------------------------------------------------------------------------------


def test_an_axis_comes_and_goes(make_bridge):
    """Of a controller whose other axis moves: a stop would be for both."""
    bridge = make_bridge(
        drives=2, sim_drives=1, bus={"protocol": "xyza", **BUS}, sim_bus={"protocol": "xyza"},
        per_drive={1: {"address": 3, "axis": "x"}, 2: {"address": 3, "axis": "y"}},
        sim_drive={"identity": None, "step-ms": 50, "address": 3,
                   "set": ["manual_speed=2000", "brake=15", "enable=15"]})
    second = bridge.drive(2)
    assert second.command("jog_positive") == 0
    eventually(lambda: second.read("axis_state") == CONTINUOUS)
    overruns = bridge.gateway().read("bus1_overruns")
    # The first one, which is asked for both, and then back.
    first = bridge.sections.pop("drive drive1")
    bridge.reload()
    assert exception_of(bridge.drive(1)) == NO_PATH
    position = second.read("position")
    eventually(lambda: second.read("position") > position)
    assert second.read("axis_state") == CONTINUOUS
    bridge.sections["drive drive1"] = first
    bridge.reload()
    eventually(lambda: is_ready(bridge.drive(1)), what="axis x to be back")
    assert second.read("axis_state") == CONTINUOUS
    assert second.read("came_online") == 1
    assert bridge.gateway().read("bus1_overruns") == overruns
    # One that moves is stopped when it goes.
    del bridge.sections["drive drive2"]
    bridge.reload()
    bridge.sections["drive drive2"] = {"bus": "line", "address": 3, "axis": "y", "unit": 2}
    bridge.reload()
    eventually(lambda: is_ready(second), what="axis y to be back")
    eventually(lambda: second.read("axis_state") == STANDSTILL)


def test_drives_on_can_come_and_go(make_bridge):
    can = {"protocol": "vsmd-can", "transport": "slcan", "bitrate": 1000000, "line": None}
    bridge = make_bridge(drives=2, sim_drives=3, bus={**can, "baud": 3000000, **BUS},
                         sim_bus={**can, "baud": None})
    starts_moving(bridge)
    witness = Witness(bridge)
    bridge.sections["drive drive3"] = drive_keys(3)
    bridge.sections["drive drive2"]["max-velocity"] = 700
    bridge.reload()
    for number in (2, 3):
        eventually(lambda n=number: is_ready(bridge.drive(n)), what=f"drive {number}")
    del bridge.sections["drive drive2"]
    bridge.reload()
    assert exception_of(bridge.drive(2)) == NO_PATH
    witness.undisturbed()
    assert bridge.drive().read("axis_state") == CONTINUOUS


def test_a_register_that_only_another_family_has(make_bridge):
    """A family that was not there before brings its registers along."""
    bridge = make_bridge(drives=1, bus=BUS)
    bridge.sections["bus arm"] = {"protocol": "xyza", "device": bridge.place / "none"}
    bridge.sections["drive arm"] = {"bus": "arm", "address": 3, "axis": "x", "unit": 2}
    with bridge.raw() as client:
        manual = bridge.map.find("manual_speed", family="xyza").address
        read = bytes([3]) + manual.to_bytes(2, "big") + bytes([0, 2])
        assert client.request(read, 1) == bytes([0x83, ILLEGAL_ADDRESS])
        assert client.request(read, 2) == bytes([0x83, NO_PATH])
        bridge.reload()
        # Known, but its bus is down.
        assert client.request(read, 2) == bytes([0x83, NO_PATH])
        assert client.request(bytes([3, 0xF0, 0, 0, 1]), 2) == bytes([0x83, ILLEGAL_ADDRESS])


# --- systemd --------------------------------------------------------------------------------------------


class Notified:
    """The other end of NOTIFY_SOCKET."""

    def __init__(self, path, monkeypatch):
        self.link = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.link.bind(str(path))
        self.link.settimeout(20)
        monkeypatch.setenv("NOTIFY_SOCKET", str(path))

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        self.link.close()

    def told(self, wanted):
        """The next message that is, or is not, about the status."""
        while True:
            text = self.link.recv(4096).decode()
            if text.startswith("STATUS=") == wanted:
                return text

    def state(self):
        return self.told(False)

    def status(self, pattern):
        """Until the status is like this."""
        deadline = time.monotonic() + 20
        while not re.fullmatch("STATUS=" + pattern, text := self.told(True)):
            assert time.monotonic() < deadline, text


def test_systemd_is_told(make_bridge, tmp_path, monkeypatch):
    with Notified(tmp_path / "notify", monkeypatch) as link:
        bridge = make_bridge(drives=2, bus=BUS)
        assert link.state() == "READY=1"
        del bridge.sections["drive drive2"]
        before = time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000
        bridge.reload()
        stamp = re.fullmatch(r"RELOADING=1\nMONOTONIC_USEC=(\d+)", link.state())
        assert before <= int(stamp.group(1)) <= time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000
        assert link.state() == "READY=1"
        # A file that is not taken ends the reload, too.
        bridge.reload("nonsense = 1\n")
        assert link.state().startswith("RELOADING=1\n")
        assert link.state() == "READY=1"
        assert bridge.stop_bridge() == 0
        assert link.state() == "STOPPING=1"


def test_systemctl_status_has_a_line_that_says_how_it_goes(make_bridge, tmp_path, monkeypatch):
    with Notified(tmp_path / "notify", monkeypatch) as link:
        bridge = make_bridge(drives=2, bus=BUS)
        link.status(r"2 of 2 drives online, 2 clients; worst bus line: \d+ % busy")
        bridge.sim.fault("silence on", "drive2")
        link.status(r"1 of 2 drives online, 2 clients; worst bus line: 1 drive silent")
        bridge.reload("nonsense = 1\n")
        link.status(r".*; the configuration on disk was refused, see the log")
        bridge.sim.fault("silence off", "drive2")
        bridge.reload()
        link.status(r"2 of 2 drives online, 2 clients; worst bus line: \d+ % busy")
