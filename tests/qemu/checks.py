# SPDX-License-Identifier: Apache-2.0
"""What real drivers, udev and systemd do to the installed service: each check takes something away from
it. They run in this order on one machine; a check leaves all drives standing and all ports plugged in."""

import argparse
import shutil
import socket
import sys
import tempfile
import time
import traceback
from pathlib import Path

from machine import ADAPTER, CAN_PORT, FarEnds, Late, Machine, Plc, eventually

FEEDER, RAM, TURNTABLE = 1, 2, 3  # units: the 16550, the adapter on USB, CAN
NAMES = {FEEDER: "feeder", RAM: "ram", TURNTABLE: "turntable"}
ENABLE, STOP, MOVE_VELOCITY, MOVE_ABSOLUTE, CLEAR_FAULT = 1, 3, 5, 6, 11
OFFLINE = 0  # axis_state
CLIENT_LOSS = 3  # error
WATCHDOG_SECONDS = 3.0  # watchdog-ms, of drives whose section does not say it
ONLINE_PATIENCE = 60.0


class Failure(Exception):
    """The service did something else than it should."""


def expect(truth, what):
    if not truth:
        raise Failure(what)


class Plant:
    """The machine, its drives, and a PLC."""

    def __init__(self, machine, drives, plc):
        self.machine = machine
        self.drives = drives
        self.plc = plc
        self.facts = []

    def note(self, text):
        """A fact for the report."""
        self.facts.append(text)
        print(f"    {text}", flush=True)

    def velocity(self, unit):
        """Of the motor, as its simulator knows it."""
        if unit != TURNTABLE:
            return self.drives.velocity(NAMES[unit])
        answer = self.machine.ask("echo get turntable | socat -t 5 - UNIX-CONNECT:/run/can-drive")
        return float(dict(word.split("=", 1) for word in answer.split() if "=" in word)["velocity"])

    def wait_good(self, unit, patience=ONLINE_PATIENCE):
        return eventually(lambda: self.plc.good(unit), f"fresh data of {NAMES[unit]}", patience)[1]

    def wait_standing(self, unit, patience=ONLINE_PATIENCE):
        """Seconds until the motor stands, without the PLC saying anything."""
        return eventually(lambda: self.velocity(unit) == 0, f"{NAMES[unit]} to stand", patience)[1]

    def command(self, unit, code, **arguments):
        exception = self.plc.command(unit, code, **arguments)
        expect(exception == 0, f"command {code} to {NAMES[unit]} was answered {exception}")

    def jog(self, unit, velocity=2000.0):
        """Runs on, and the motor turns when this returns."""
        self.wait_good(unit)
        if self.plc.state(unit)[1] == CLIENT_LOSS:
            self.command(unit, CLEAR_FAULT)  # by the watchdog, while the PLC asked about other drives
        self.command(unit, ENABLE)
        self.command(unit, MOVE_VELOCITY, velocity=velocity)
        eventually(lambda: self.velocity(unit) != 0, f"{NAMES[unit]} to move", 10)

    def stop(self, unit):
        self.wait_good(unit)
        self.command(unit, STOP)
        self.wait_standing(unit)

    def service(self, name):
        return self.machine.ask(f"systemctl show drivebridge --property {name} --value")

    def log(self, since):
        """What the service said since the mark."""
        return self.machine.ask(f"journalctl -u drivebridge -o cat --after-cursor '{since}'")

    def mark(self):
        return self.machine.ask("journalctl -n 0 --show-cursor -q | sed -n 's/^-- cursor: //p'")


def check_start(plant):
    """After a boot the service runs, the drives whose ports are there are online, the other is not."""
    for unit in (FEEDER, TURNTABLE):
        plant.note(f"{NAMES[unit]} online {plant.wait_good(unit):.1f} s after the system was up")
    for name in ("ActiveState", "NRestarts", "ActiveEnterTimestampMonotonic"):
        plant.note(f"{name}: {plant.service(name)}")
    expect(plant.service("ActiveState") == "active", "the service is not active")
    expect(plant.service("NRestarts") == "0", "the service was restarted")
    expect(plant.machine.ask("systemctl list-units --failed --plain --no-legend") == "",
           "failed units: " + plant.machine.ask("systemctl list-units --failed --plain --no-legend"))
    state, exception = plant.plc.state(RAM), plant.plc.position_answer(RAM)
    plant.note(f"ram, not plugged in: axis_state {state[0]}, error {state[1]}, position answered {exception:02X}")
    expect(state[0] == OFFLINE and exception in (0x0A, 0x0B), "a drive without a port looks online")
    order = plant.machine.ask(
        "journalctl -b -o short-monotonic | grep -m 40 -E 'ttyS1|can[01]|drivebridged?\\['")
    for line in order.splitlines():
        plant.note(line)


def check_first_plug(plant):
    """An adapter whose driver is loaded after the start of the service: DeviceAllow, udev's name, latency."""
    status, _ = plant.machine.run("grep -qE '^(ftdi_sio|usbserial) ' /proc/modules")
    expect(status != 0, "the driver is loaded already: this shows nothing")
    process = plant.service("MainPID")
    plant.machine.plug(ADAPTER)
    plant.note(f"ram online {plant.wait_good(RAM):.1f} s after plugging in")
    plant.note(plant.machine.ask("grep -oE '^(ftdi_sio|usbserial) ' /proc/modules | xargs echo modules:"))
    plant.note(plant.machine.ask("ls -l /dev/drives-press /dev/ttyUSB0 | cut -d' ' -f1,3-4,5-"))
    latency = plant.machine.ask("cat /sys/bus/usb-serial/devices/ttyUSB0/latency_timer")
    plant.note(f"latency_timer {latency} ms")
    expect(latency == "1", "the rule for the latency did nothing")
    expect(plant.service("MainPID") == process, "the service was restarted")


def check_moves(plant):
    """Each drive goes where it is told."""
    for unit in NAMES:
        plant.wait_good(unit)
        plant.command(unit, ENABLE)
        plant.command(unit, MOVE_ABSOLUTE, position=3200)

        def arrived(unit=unit):
            words = plant.plc.registers(unit, 12, 2)
            return isinstance(words, list) and words[0] << 16 | words[1] == 3200

        _, seconds = eventually(arrived, f"{NAMES[unit]} at 3200", 20)
        plant.wait_standing(unit)
        plant.note(f"{NAMES[unit]} at 3200 after {seconds:.1f} s")


def unplug_while_moving(plant, unit, unplug):
    """The other drive does not feel it, this one goes offline; what its motor does."""
    other = FEEDER
    plant.jog(unit)
    plant.plc.slowest = 0.0
    unplug()
    bad = []

    def gone():
        if not plant.plc.good(other):
            bad.append(plant.plc.state(other))
        return plant.plc.position_answer(unit) in (0x0A, 0x0B)

    _, seconds = eventually(gone, f"{NAMES[unit]} to be offline", 20)
    state = plant.plc.state(unit)
    plant.note(f"offline {seconds:.1f} s later: axis_state {state[0]}, error {state[1]}, "
               f"position answered {plant.plc.position_answer(unit):02X}")
    expect(state[0] == OFFLINE, "not Offline")
    expect(not bad, f"{NAMES[other]} was disturbed: {bad}")
    plant.note(f"slowest answer meanwhile {plant.plc.slowest * 1000:.0f} ms")
    plant.note(f"motor meanwhile: velocity {plant.velocity(unit):.0f}")


def check_unplug_moving(plant):
    """The adapter is pulled while its drive moves and put back: with a PLC that goes on asking."""
    process = plant.service("MainPID")
    try:
        unplug_while_moving(plant, RAM, lambda: plant.machine.unplug(ADAPTER))
    finally:
        plant.machine.plug(ADAPTER)
    plant.note(f"back {plant.wait_good(RAM):.1f} s after plugging in")
    state = plant.plc.state(RAM)
    plant.note(f"then: axis_state {state[0]}, error {state[1]}, motor velocity {plant.velocity(RAM):.0f}")
    expect(plant.service("MainPID") == process, "the service was restarted")
    plant.stop(RAM)


def check_unplug_silent(plant):
    """The same, and the PLC is gone when the adapter comes back: the watchdog stops the drive."""
    plant.jog(RAM)
    plant.machine.unplug(ADAPTER)
    plant.plc.close()
    time.sleep(WATCHDOG_SECONDS + 1)  # the silence that the watchdog waits for
    expect(plant.velocity(RAM) != 0, "the drive stood before it could be told to")
    plant.machine.plug(ADAPTER)
    plant.note(f"motor stands {plant.wait_standing(RAM):.1f} s after plugging in")
    plant.wait_good(RAM)
    state = plant.plc.state(RAM)
    plant.note(f"then: axis_state {state[0]}, error {state[1]}, trips {plant.plc.watchdog_trips(RAM)}")
    expect(state[1] == CLIENT_LOSS, "no client loss")
    plant.command(RAM, CLEAR_FAULT)


def open_ports(plant):
    """The serial ports that the service has open."""
    return plant.machine.ask(f"ls -l /proc/{plant.service('MainPID')}/fd | grep -oE '/dev/(tty|drives).*' "
                             "| sort | xargs echo")


def check_unplug_many(plant):
    """Pulled and put back ten times in a row."""
    process, slowest = plant.service("MainPID"), 0.0
    plant.wait_good(RAM)
    before = open_ports(plant)
    for _ in range(10):
        plant.machine.unplug(ADAPTER)
        eventually(lambda: not plant.plc.good(RAM), "ram to be offline", 20)
        plant.machine.plug(ADAPTER)
        slowest = max(slowest, plant.wait_good(RAM))
    plant.note(f"ten times: back within {slowest:.1f} s at most")
    names = plant.machine.ask("ls /dev/ttyUSB*")
    plant.note(f"names at the end: {names}")
    plant.note(f"open before: {before}; after: {open_ports(plant)}")
    expect(open_ports(plant) == before, "ports are left open")
    expect(plant.service("MainPID") == process, "the service was restarted")


def check_can_down(plant):
    """The CAN interface is set down and up while its drive moves."""
    try:
        unplug_while_moving(plant, TURNTABLE, lambda: plant.machine.ask("ip link set can0 down"))
    finally:
        plant.machine.ask("ip link set can0 up")
    plant.note(f"back {plant.wait_good(TURNTABLE):.1f} s after up")
    plant.stop(TURNTABLE)


def check_can_unplug(plant):
    """The CAN controller is pulled and put back; systemd-networkd sets it up again."""
    try:
        unplug_while_moving(plant, TURNTABLE, lambda: plant.machine.unplug(CAN_PORT))
    finally:
        plant.machine.plug(CAN_PORT)
    plant.note(f"back {plant.wait_good(TURNTABLE):.1f} s after plugging in")
    plant.stop(TURNTABLE)


def check_can_rates(plant):
    """Two bit rates on one wire. The model has none: what is said, and that nothing is misread."""
    since = plant.mark()
    plant.machine.ask("ip link set can0 down; ip link set can0 type can bitrate 500000; ip link set can0 up")
    plant.wait_good(TURNTABLE)
    plant.note("frames cross between 500 kbit/s and 1 Mbit/s: the model has no bit rate, no error "
               "counters and no bus-off")
    plant.note(plant.machine.ask("ip -details -statistics link show can0 | grep -E 'state|bitrate'"))
    said = [line for line in plant.log(since).splitlines() if "500000" in line]
    plant.note(f"said: {said[:1]}")
    expect(said, "the service did not say that the interface has another rate")
    plant.machine.ask("ip link set can0 down; networkctl reconfigure can0")
    plant.wait_good(TURNTABLE)
    expect("1000000" in plant.machine.ask("ip -details link show can0"), "the rate is not back")


def check_restart(plant):
    """systemctl restart while drives move: on-exit stops each before the process ends."""
    for unit in NAMES:
        plant.jog(unit)
    plant.machine.ask("systemctl stop drivebridge")
    for unit in NAMES:
        expect(plant.velocity(unit) == 0, f"{NAMES[unit]} moves though the service has ended")
    plant.note("all three stand when systemctl stop returns")
    plant.plc.close()
    plant.machine.ask("systemctl start drivebridge")
    for unit in NAMES:
        plant.wait_good(unit)


def check_watchdog(plant):
    """The process hangs while drives move: systemd restarts it, and silence of the PLC stops them."""
    plant.jog(FEEDER)
    plant.jog(RAM)
    process = plant.service("MainPID")
    plant.machine.ask(f"kill -STOP {process}")
    plant.plc.close()
    start = time.monotonic()
    _, seconds = eventually(
        lambda: plant.service("MainPID") not in (process, "0"), "another process", 60, 0.2)
    plant.note(f"another process {seconds:.1f} s after it hung, WatchdogSec "
               f"{plant.service('WatchdogUSec')}; NRestarts {plant.service('NRestarts')}")
    for unit in (FEEDER, RAM):
        plant.wait_standing(unit)
        plant.note(f"{NAMES[unit]} stands {time.monotonic() - start:.1f} s after it hung")
    for unit in (FEEDER, RAM):
        plant.wait_good(unit)
        state = plant.plc.state(unit)
        plant.note(f"{NAMES[unit]}: axis_state {state[0]}, error {state[1]}, "
                   f"trips {plant.plc.watchdog_trips(unit)}")
        expect(plant.plc.watchdog_trips(unit) == 1, "its watchdog was not armed")
        plant.command(unit, CLEAR_FAULT)


def check_kill(plant):
    """The process is killed while drives move."""
    plant.jog(FEEDER)
    plant.jog(RAM)
    plant.machine.ask(f"kill -KILL {plant.service('MainPID')}")
    plant.plc.close()
    for unit in (FEEDER, RAM):
        plant.note(f"{NAMES[unit]} stands {plant.wait_standing(unit):.1f} s later")
    for unit in (FEEDER, RAM):
        plant.wait_good(unit)
        expect(plant.plc.watchdog_trips(unit) == 1, "its watchdog was not armed")
        plant.command(unit, CLEAR_FAULT)


def check_power_cut(plant):
    """The gateway's power goes off and on while drives move. Nobody connects after that. The CAN
    bus is of no use afterwards."""
    plant.jog(FEEDER)
    plant.jog(RAM)
    plant.machine.reset()
    plant.plc.close()
    start = time.monotonic()
    expect(plant.velocity(FEEDER) != 0, "the drive stood by itself")
    for unit in (FEEDER, RAM):
        plant.wait_standing(unit, 300)
        plant.note(f"{NAMES[unit]} stands {time.monotonic() - start:.1f} s after the cut")
    plant.machine.wait_booted()
    # Not the one on CAN: qemu's controllers do not survive a reset, see docs/real-drivers.md.
    for unit in (FEEDER, RAM):
        plant.wait_good(unit)
        state = plant.plc.state(unit)
        plant.note(f"{NAMES[unit]}: axis_state {state[0]}, error {state[1]}, "
                   f"trips {plant.plc.watchdog_trips(unit)}")
        expect(plant.plc.watchdog_trips(unit) == 1, "its watchdog was not armed")
        plant.command(unit, CLEAR_FAULT)
    plant.note(f"service active {int(plant.service('ActiveEnterTimestampMonotonic')) / 1e6:.1f} s "
               "after the kernel began; NRestarts " + plant.service("NRestarts"))


def check_power_button(plant):
    """A shutdown while drives move: they stand before the machine is off. The last check."""
    plant.jog(FEEDER)
    plant.jog(RAM)
    plant.machine.qmp("system_powerdown")
    plant.plc.close()
    for unit in (FEEDER, RAM):
        plant.note(f"{NAMES[unit]} stands {plant.wait_standing(unit):.1f} s after the button")
    plant.machine.process.wait(120)


CHECKS = {name.removeprefix("check_"): function
          for name, function in list(globals().items()) if name.startswith("check_")}


def run_checks(plant, names, logs):
    passed = failed = 0
    for name in names:
        print(f"== {name}: {CHECKS[name].__doc__.splitlines()[0]}", flush=True)
        try:
            CHECKS[name](plant)
            passed += 1
            print(f"{name} passed", flush=True)
        except (Failure, Late, RuntimeError, OSError) as error:
            failed += 1
            print(f"{name} failed: {error}", flush=True)
            traceback.print_exc(file=(logs / f"{name}.log").open("w", encoding="utf-8"))
        if plant.machine.process.poll() is None:
            journal = plant.machine.ask("journalctl -b -o short-monotonic -u drivebridge")
            (logs / f"{name}.journal").write_text(journal, encoding="utf-8")
    return passed, failed


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--image", type=Path, required=True)
    parser.add_argument("--logs", type=Path, required=True)
    parser.add_argument("checks", nargs="*", default=[])
    options = parser.parse_args()
    names = options.checks or list(CHECKS)
    unknown = [name for name in names if name not in CHECKS]
    if unknown:
        parser.error(f"no check {unknown}; there are {', '.join(CHECKS)}")
    options.logs.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        drives = FarEnds(options.image / "sim/usr/bin/drivebridge-sim", folder)
        port = free_port()
        machine = Machine(folder, options.image / "vmlinuz", options.image / "initrd",
                          options.image / "image", drives.ports, port)
        try:
            print(f"the system was up after {machine.wait_booted():.0f} s", flush=True)
            print(machine.ask("uname -srvm; systemctl --version | head -1; drivebridged --version"))
            if names[0] not in ("start", "first_plug"):
                machine.plug(ADAPTER)
            passed, failed = run_checks(Plant(machine, drives, Plc(port)), names, options.logs)
        finally:
            machine.stop()
            drives.stop()
            for name in ("console.log", "drives.trace"):
                if (folder / name).exists():
                    shutil.move(folder / name, options.logs / name)
    print(f"{passed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
