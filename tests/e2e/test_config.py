# SPDX-License-Identifier: Apache-2.0
"""drivebridged --check, and what a wrong file is told."""

import os
import shutil
import subprocess

import pytest
from bridgelib import ROOT, find_program

GOOD = """modbus {
    listen = "127.0.0.1:0"
}
bus line {
    protocol = vsmd-serial
    device = "/dev/null/none"
    baud = 115200
    cycle-ms = 50
}
drive feeder {
    bus = line
    address = 1
    unit = 1
}
"""

MODBUS, BUS, DRIVE = 1, 4, 10  # the lines where the sections begin


def check(path):
    done = subprocess.run(
        [find_program("drivebridged"), "--check", "--config", path],
        capture_output=True, text=True, timeout=20, check=False,
    )
    return done.returncode, done.stdout, done.stderr


def checked(tmp_path, text):
    path = tmp_path / "test.conf"
    path.write_text(text, encoding="utf-8")
    return path, *check(path)


@pytest.mark.parametrize(
    "path",
    sorted((ROOT / "conf").glob("examples/*.conf"))
    + [ROOT / "conf" / "drivebridge.conf", ROOT / "conf" / "demo.conf"],
    ids=lambda path: path.name,
)
def test_every_shipped_file_is_right(path):
    status, _, errors = check(path)
    assert status == 0, errors


def test_check_says_what_would_run(tmp_path):
    _, status, out, errors = checked(tmp_path, GOOD)
    assert status == 0, errors
    text = out + errors
    for word in ("line", "feeder", "vsmd-serial", "/dev/null/none, serial", "115200", "127.0.0.1"):
        assert word in text, word


def after(line, *more):
    """GOOD with lines put in behind this one."""
    lines = GOOD.splitlines()
    return "\n".join(lines[:line] + list(more) + lines[line:]) + "\n"


def instead(old, new):
    assert old in GOOD
    return GOOD.replace(old, new, 1)


SECOND = "drive second {\n    bus = line\n    address = 2\n    unit = 2\n}\n"


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        (after(MODBUS, "    lissten = 1"), MODBUS + 1, ["lissten"]),
        (instead("baud = 115200", "baud = fast"), 7, ["baud"]),
        (instead("baud = 115200", "baud = 1"), 7, ["baud", "300"]),
        (instead("cycle-ms = 50", "cycle-ms = 0"), 8, ["cycle-ms"]),
        (instead("vsmd-serial", "vsmd-cereal"), 5, ["vsmd-cereal", "vsmd-serial"]),
        (instead("address = 1", "address = 33"), 12, ["address", "32"]),
        (instead("address = 1", "address = 0"), 12, ["address"]),
        (instead("unit = 1", "unit = 248"), 13, ["unit", "247"]),
        (instead("unit = 1", "unit = 0"), 13, ["unit"]),
        (instead("bus = line", "bus = lime"), 11, ["lime", "bus"]),
        (instead('"127.0.0.1:0"', '"127.0.0.1"'), 2, ["listen"]),
        (instead('"127.0.0.1:0"', '"localhost.:99999"'), 2, ["listen"]),
        (after(MODBUS, '    allow-write = {"300.1.1.1"}'), MODBUS + 1, ["300.1.1.1"]),
        (after(MODBUS, '    allow-read = {"10.0.0.0/33"}'), MODBUS + 1, ["10.0.0.0/33"]),
        (after(MODBUS, "    confirm-ms = 0"), MODBUS + 1, ["confirm-ms"]),
        (after(MODBUS, "    word-order = middle"), MODBUS + 1, ["word-order", "high-first"]),
        (after(DRIVE, "    on-client-loss = run"), DRIVE + 1, ["on-client-loss", "quick-stop"]),
        (after(DRIVE, "    counts-per-unit = 0"), DRIVE + 1, ["counts-per-unit"]),
        (GOOD + SECOND.replace("address = 2", "address = 1"), 17, ["address", "feeder"]),
        (GOOD + SECOND.replace("unit = 2", "unit = 1"), 18, ["unit", "feeder"]),
        (instead("    address = 1\n", ""), None, ["address"]),
        (instead("    unit = 1\n", ""), None, ["unit"]),
        (instead('    device = "/dev/null/none"\n', ""), None, ["device"]),
        (after(BUS, "    line = rs232"), None, ["address"]),
        (after(BUS, "    bitrate = 500000"), BUS + 1, ["bitrate", "CAN", "baud"]),
        (after(BUS, '    interface = "can0"'), BUS + 1, ["interface", "CAN", "device"]),
        (after(BUS, "    transport = slcan"), BUS + 1, ["transport", "slcan", "serial"]),
        (after(BUS, "    transport = usb"), BUS + 1, ["transport", "serial socketcan slcan"]),
        (after(DRIVE, "    axis = x"), DRIVE + 1, ["axis", "vsmd-serial"]),
    ],
)
def test_wrong_files_name_file_and_line(tmp_path, text, line, words):
    path, status, _, errors = checked(tmp_path, text)
    assert status != 0
    assert f"{path}:{line}:" in errors if line else f"{path}:" in errors, errors
    for word in words:
        assert word in errors, errors


def test_two_drives_on_rs232(tmp_path):
    text = after(BUS, "    line = rs232").replace("    address = 1\n", "")
    text += SECOND.replace("    address = 2\n", "")
    path, status, _, errors = checked(tmp_path, text)
    assert status != 0
    assert f"{path}:" in errors and "rs232" in errors


def test_a_wrong_file_never_starts(tmp_path):
    path = tmp_path / "test.conf"
    path.write_text(after(MODBUS, "    lissten = 1"), encoding="utf-8")
    done = subprocess.run(
        [find_program("drivebridged"), "--config", path],
        capture_output=True, text=True, timeout=10, check=False,
    )
    assert done.returncode != 0
    assert f"{path}:2:" in done.stderr
    assert "listening" not in done.stderr


def test_a_missing_file(tmp_path):
    status, _, errors = check(tmp_path / "none.conf")
    assert status != 0
    assert "none.conf" in errors


def test_a_cycle_that_cannot_fit_is_warned_with_figures(tmp_path):
    text = GOOD.replace("cycle-ms = 50", "cycle-ms = 1").replace("115200", "9600")
    _, status, out, errors = checked(tmp_path, text)
    assert status == 0, errors
    assert "cycle-ms" in out + errors
    assert " ms" in out + errors


def test_a_confirmation_that_cannot_come_in_time_is_warned(tmp_path):
    text = after(MODBUS, "    confirm-ms = 1").replace("115200", "2400")
    _, status, out, errors = checked(tmp_path, text)
    assert status == 0, errors
    assert "confirm-ms" in out + errors


# --- what is no file, or no text

def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.conf")
    status, _, errors = check(tmp_path / "pipe.conf")
    assert status == 1
    assert errors == f"{tmp_path}/pipe.conf: it is a pipe, not a file; the path of a " \
        "configuration file\n"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (GOOD.encode("utf-16"), ":1: it is UTF-16 text; save it as UTF-8"),
        (GOOD.encode("utf-16-be"), ":1: there is a zero byte"),
        (GOOD.encode("utf-8-sig"), ":1: it begins with an invisible byte order mark"),
        (b"# comment\n" * 110000, ": it is longer than 1 MiB"),
        (GOOD.encode()[:60] + b"\0" + GOOD.encode()[60:], "there is a zero byte"),
    ],
    ids=["utf-16", "utf-16 without mark", "utf-8 with mark", "too long", "zero"],
)
def test_what_is_no_text(tmp_path, content, words):
    path = tmp_path / "test.conf"
    path.write_bytes(content)
    status, _, errors = check(path)
    assert status == 1
    assert f"{path}" in errors and words in errors
    assert errors.count("\n") == 1, errors


def test_a_folder_is_no_file(tmp_path):
    status, _, errors = check(tmp_path)
    assert status == 1 and "it is a folder, not a file" in errors


def test_a_file_that_may_not_be_read(tmp_path):
    path = tmp_path / "test.conf"
    path.write_text(GOOD, encoding="utf-8")
    path.chmod(0)
    tmp_path.chmod(0o755)
    for folder in [tmp_path, *tmp_path.parents]:
        if folder.owner() == "root" and os.geteuid() == 0 and str(folder) != "/":
            folder.chmod(folder.stat().st_mode | 0o055)
    nobody = {"user": "nobody", "group": "nogroup", "extra_groups": []} \
        if os.geteuid() == 0 else {}
    program = tmp_path / "drivebridged"
    shutil.copy(find_program("drivebridged"), program)
    done = subprocess.run([program, "--check", "--config", path], **nobody,
                          capture_output=True, text=True, timeout=20, check=False)
    assert done.returncode == 1
    assert "may not read it" in done.stderr and "chmod a+r" in done.stderr


RAW_FRAMES = """modbus {
}
bus table {
    protocol = xyza
    device = "/dev/null"
    raw-frames = on
}
drive x {
    bus = table
    address = 3
    axis = x
    unit = 1
}
"""


def test_raw_frames_are_warned_of(tmp_path):
    _, status, said, errors = checked(tmp_path, RAW_FRAMES)
    assert status == 0
    assert "raw-frames = on" in said
    assert "warning: raw-frames is on: " in errors
    errors = checked(tmp_path, RAW_FRAMES.replace("= on", "= off"))[3]
    assert "raw-frames is on" not in errors


def test_a_bus_without_a_frame_for_all_starts_one_by_one(tmp_path):
    for text in (RAW_FRAMES.replace("raw-frames = on", "group-start = broadcast"),
                 after(BUS, "    line = rs232\n    group-start = broadcast")):
        _, status, _, errors = checked(tmp_path, text)
        assert status != 0
        assert "has no frame for all drives; remove it" in errors
    assert checked(tmp_path, after(BUS, "    group-start = broadcast"))[1] == 0


# --- --check looks at the machine

def test_check_tells_every_value(tmp_path):
    _, status, out, errors = checked(tmp_path, after(DRIVE, "    max-velocity = 12.5"))
    assert status == 0, errors
    written = out.split("every value, as a file would say it\n")[1]
    for line in ("max-velocity = 12.5", "watchdog-ms = 3000", "cycle-ms = 50", "end"):
        assert line in written, line
    # Which is one: it says the same once more.
    _, status, again, errors = checked(tmp_path, written)
    assert status == 0, errors
    assert again.split("every value, as a file would say it\n")[1] == written


def test_check_looks_for_ports_and_interfaces(tmp_path):
    master, port = os.openpty()
    name = os.ttyname(port)
    device = '"/dev/null/none"'
    path, status, out, errors = checked(tmp_path, instead(device, f'"{name}"'))
    assert status == 0 and errors == ""
    assert f"bus line: {name} is a serial port, and " in out
    os.close(master)
    os.close(port)
    # What is missing is a warning: it may be plugged in later.
    path, status, _, errors = checked(tmp_path, instead(device, '"/dev/drivebridge-none"'))
    assert status == 0
    assert f"{path}:4: warning: bus line: /dev/drivebridge-none does not exist" in errors
    assert "ls /dev/serial/by-id" in errors
    path, status, _, errors = checked(tmp_path, instead(device, '"/dev/null"'))
    assert status == 0 and f"{path}:4: warning: bus line: /dev/null is no serial port" in errors
    can = instead("vsmd-serial", "vsmd-can").replace("    device = " + device, "    interface = {}")
    can = can.replace("    baud = 115200\n", "")
    for name, words in (("lo", "is no CAN interface"), ("nowhere7", "is no network interface")):
        path, status, _, errors = checked(tmp_path, can.replace("{}", name))
        assert status == 0 and f"{path}:4: warning: bus line: {name} {words}" in errors


def test_doors_that_are_open_to_everybody_are_warned_of(tmp_path):
    folder = tmp_path / "etc"
    folder.mkdir()
    _, status, _, errors = checked(folder, GOOD)
    assert status == 0 and "everybody" not in errors
    for networks, warned in (("0.0.0.0/0", True), ("::/0", True), ("10.0.0.0/8", False)):
        text = after(MODBUS, f'    allow-write = {{"{networks}"}}')
        assert "everybody" not in checked(folder, text)[3], "nobody else reaches the loopback"
        path, status, _, errors = checked(folder, text.replace('"127.0.0.1:0"', '"0.0.0.0:0"'))
        assert status == 0
        assert (f"{path}:{MODBUS + 1}: warning: allow-write has everybody: whoever reaches 0.0.0.0:0 moves the drives"
                in errors) == warned, errors
    more = folder / "conf.d"
    more.mkdir()
    (more / "10.conf").write_text("# nothing\n", encoding="utf-8")
    for target in (folder, path, more / "10.conf"):
        before = target.stat().st_mode & 0o7777
        target.chmod(before | 0o002)
        done = subprocess.run([find_program("drivebridged"), "--config", path, "--check"], capture_output=True, text=True,
                              timeout=30, check=False)
        assert done.returncode == 0
        assert f"{target} can be written by everybody" in done.stderr.replace("/ can", " can"), done.stderr
        target.chmod(before)
