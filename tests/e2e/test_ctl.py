# SPDX-License-Identifier: Apache-2.0
"""drivebridgectl in front of the real drivebridged and simulated drives, and the transcripts of its page in the
guide, which are typed here line by line."""

import getpass
import json
import re
import shlex
import signal
import socket
import subprocess
import time

import pytest
import varlink
from bridgelib import ROOT, STANDSTILL, as_shown, eventually, find_program
from test_ctl_alone import RIGHT, Terminal

PAGE = ROOT / "docs" / "guide" / "drivebridgectl.md"
NAMES = ["feeder", "conveyor", "lift"]


@pytest.fixture
def plant(make_bridge):
    """Three drives under names, the first with a watchdog of a second."""
    bridge = make_bridge(drives=3, drive={"counts-per-unit": 640.0, "unit-name": "mm",
                                          "max-velocity": 20.0, "max-position": 10000.0},
                         per_drive={1: {"watchdog-ms": 1000}},
                         sim_drive={"set": ["spd=6400", "acc=64000", "dec=64000"]})
    for number, name in enumerate(NAMES, 1):
        bridge.sections[f"drive {name}"] = bridge.sections.pop(f"drive drive{number}")
    bridge.reload()
    for number in range(1, 4):
        bridge.drive(number).reconnect()
        bridge.wait_ready(number)
    return bridge


def run(plant, *words, timeout=30):
    return subprocess.run([find_program("drivebridgectl"), "--socket", plant.control_path, *words],
                          capture_output=True, text=True, timeout=timeout, check=False, cwd=plant.place)


def ctl(plant, *words, status=0):
    done = run(plant, *words)
    assert done.returncode == status, done
    return done.stdout + done.stderr


def objects(plant, *words, status=0):
    """Each line is one."""
    return [json.loads(line) for line in ctl(plant, "--json", *words, status=status).splitlines()]


@pytest.mark.parametrize("words", ["run feedr", "run feedr enable", "get feedr position"])
def test_a_drive_that_there_is_not_is_one_error(plant, words):
    (error,) = objects(plant, *words.split(), status=2)
    assert error["error"] == "io.drivebridge.Control.NoSuchDrive"


# --- looking ---------------------------------------------------------------------------------------


def test_status_is_well_until_a_drive_is_silent(plant):
    assert ctl(plant, "status").splitlines()[-1] == "all is well"
    (told,) = objects(plant, "status")
    assert told["well"] is True and [drive["name"] for drive in told["drives"]] == NAMES
    plant.sim.fault("silence on", "drive3")
    eventually(lambda: run(plant, "status").returncode == 1, what="status to notice")
    lines = eventually(lambda: [line for line in run(plant, "status").stdout.splitlines()
                                if line.startswith("lift: no_answer: ")])
    assert "check its power" in lines[0]
    assert run(plant, "status").stdout.splitlines()[1].split()[0] == "lift"
    (told,) = objects(plant, "status", status=1)
    assert told["drives"][0]["need"] == "act" and told["drives"][0]["state"] == "Offline"
    # The service's own record: since when, and the latest event about it.
    trouble = told["drives"][0]["trouble"]
    assert trouble["cause"] == "no_answer" and trouble["since_us"] > 0
    assert told["drives"][0]["next"] == trouble["advice"]
    after = run(plant, "status").stdout.splitlines()
    told_of = after[after.index(lines[0]) + 1]
    assert told_of.startswith("  since 20") and told_of.endswith(trouble["event"]["text"])


def test_show_has_values_with_names_and_parameters(plant):
    said = ctl(plant, "show", "feeder")
    assert re.search(r"^feeder: vsmd-serial on bus line \(.*\), address 1, unit 1$", said, re.M)
    assert re.search(r"^  axis_state +Disabled$", said, re.M)
    assert re.search(r"^  position +-?\d+ counts$", said, re.M)
    assert re.search(r"^  position_units +\S+ mm$", said, re.M)
    assert re.search(r"^  status +online, .*params_valid", said, re.M)
    assert re.search(r"^  spd +6400 pulses/s +Preset speed", said, re.M)
    # What a number means stands next to it, and the drive's own bits have the vendor's names.
    assert re.search(r"^  mcs +5 \(1/32\) +Microstepping", said, re.M)
    assert re.search(r"^  active_command +0 \(none\)$", said, re.M)
    assert re.search(r"^  control_holder +0 \(nobody\)$", said, re.M)
    assert re.search(r"^  drive_status +s1, s2, .*stp", said, re.M)
    (told,) = objects(plant, "show", "feeder")
    assert told["values"]["spd"] == 6400 and told["values"]["axis_state"] == 1
    assert {"name", "type", "unit", "writable"} <= set(told["registers"][0])
    assert "history1_command" in ctl(plant, "show", "--all", "feeder")


def test_codes_of_another_register_have_its_words(plant):
    ctl(plant, "enable", "feeder")
    ctl(plant, "set", "feeder", "spd=3200")
    assert ctl(plant, "get", "feeder", "result_command", "write_result") == \
        "result_command = enable\nwrite_result = ok\n"


def test_get_gives_what_modbus_gives(plant):
    assert ctl(plant, "get", "feeder", "spd") == "6400 pulses/s\n"
    assert ctl(plant, "get", "feeder", "unit_name", "watchdog_ms") == \
        "unit_name = mm\nwatchdog_ms = 1000 ms\n"
    (told,) = objects(plant, "get", "feeder", "spd", "position")
    assert told == {"drive": "feeder", "values": {
        "spd": 6400.0, "position": plant.drive(1).read("position")}}


def test_the_gateways_own_registers_have_names_too(plant):
    assert ctl(plant, "get", "gateway", "drive_count") == "3\n"
    assert re.search(r"^gateway: drivebridge \S+, .*\n\nvalues\n", ctl(plant, "show", "gateway"))
    assert ctl(plant, "set", "gateway", "heartbeat=7") == "heartbeat = 7: ok\n"
    assert plant.gateway().read("heartbeat") == 7
    assert "heartbeat=" in ctl(plant, "names", "writable", "gateway").splitlines()
    assert ctl(plant, "names", "units").splitlines() == [*NAMES, "gateway"]
    assert "gateway has no register" in ctl(plant, "get", "gateway", "spd", status=2)


def test_codes_have_names(plant):
    assert ctl(plant, "get", "feeder", "quality", "active_command") == \
        "quality = good\nactive_command = 0\n"
    ctl(plant, "run", "feeder", "enable")
    assert ctl(plant, "get", "feeder", "history1_command") == "enable\n"


def test_history_tells_what_was_commanded_and_by_whom(plant):
    """The newest first, with arguments as run takes them; of a tool whom it acts for stands behind its own user."""
    unit = plant.drive(1)
    assert ctl(plant, "history", "feeder").split() == ["WHEN", "COMMAND", "ARGUMENTS", "RESULT", "TOOK", "CLIENT"]
    assert objects(plant, "history", "feeder") == []
    assert unit.command("enable") == 0
    ctl(plant, "run", "feeder", "move_absolute", "target_position=640", "target_velocity=1600")
    ctl(plant, "run", "feeder", "move_absolute", "target_position=9000000", status=1)
    ctl(plant, "set", "feeder", "spd=3200")
    with varlink.Client(f"unix:{plant.control_path}") as client, client.open("io.drivebridge.Control") as session:
        session.Introduce("Jürgen")
        session.Run("feeder", "stop")
    lines = ctl(plant, "history", "feeder").splitlines()[1:]
    when, took = r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3}", r"[\d.]+ ms"
    user = re.escape(f"control, user {getpass.getuser()}")
    for line, rest in zip(lines, (rf"stop +ok +{took} +{user} for Jürgen",
                                  rf"write +register={unit.row('spd').address} +ok +{took} +{user}",
                                  rf"move_absolute +target_position=9000000 target_velocity=0 +limit +{took} +{user}",
                                  rf"move_absolute +target_position=640 target_velocity=1600 +ok +{took} +{user}",
                                  rf"enable +ok +{took} +127\.0\.0\.1 port \d+, user {getpass.getuser()}"), strict=True):
        assert re.fullmatch(rf"{when}  {rest} *", line), line
    told = objects(plant, "history", "feeder")
    assert [one["sequence"] for one in told] == [5, 4, 3, 2, 1]
    assert told[0]["user"] == "Jürgen" and told[3]["arguments"] == {"target_position": 640, "target_velocity": 1600}
    assert (told[2]["result"], told[4]["address"], told[4]["user"]) == ("limit", as_shown("127.0.0.1"), "")


def test_bus_metrics_and_events_tell_of_the_same_plant(plant):
    said = ctl(plant, "bus")
    assert re.search(r"^line +vsmd-serial +up +[\d.]+, at most [\d.]+ ms +20.00 ms", said, re.M)
    assert re.search(r"^feeder +line +[\d.]+ ms", said, re.M)
    (told,) = objects(plant, "bus")
    assert told["buses"]["line"]["period_us"] == 20000
    assert told["drives"]["feeder"]["round_trip_us"] > 0
    assert re.search(r'^drivebridge_drive_up\{.*drive="feeder".*\} 1$', ctl(plant, "metrics"), re.M)
    events = objects(plant, "events")
    assert {"time_us", "level", "name", "text"} <= set(events[-1])
    assert any("listening on" in event["text"] for event in events)


def test_events_are_followed(plant):
    process = subprocess.Popen([find_program("drivebridgectl"), "--socket", plant.control_path,
                                "--json", "events", "--follow"], stdout=subprocess.PIPE, text=True)
    try:
        assert json.loads(process.stdout.readline())["time_us"] > 0
        plant.sim.fault("silence on", "drive2")
        while json.loads(process.stdout.readline()).get("drive") != "conveyor":
            pass
    finally:
        process.terminate()
    assert process.wait(10) == 0
    process.stdout.close()


# --- acting ----------------------------------------------------------------------------------------


def test_set_writes_what_can_be(plant):
    assert ctl(plant, "set", "feeder", "spd=5000", "watchdog_ms=1500") == \
        "spd = 5000 pulses/s: ok\nwatchdog_ms = 1500 ms: ok\n"
    assert plant.drive(1).read("spd") == 5000 and plant.drive(1).read("watchdog_ms") == 1500
    assert "is out of range, " in ctl(plant, "set", "feeder", "watchdog_ms=70000", status=2)
    assert "can only be read" in ctl(plant, "set", "feeder", "position=1", status=2)
    assert "did you mean watchdog_ms" in ctl(plant, "set", "feeder", "watchdog=1", status=2)


def test_what_the_configuration_limits_is_known_beforehand(plant):
    # 20 mm/s, and 640 counts are a millimetre.
    assert "target_velocity: 12801 is out of range, -12800 to 12800 counts/s" in \
        ctl(plant, "run", "feeder", "move_velocity", "target_velocity=12801", status=2)


def test_run_waits_for_the_end_of_the_motion(plant):
    assert ctl(plant, "run", "feeder", "enable") == "feeder: enable: ok\n"
    # Longer than its watchdog takes: who waits is there.
    assert ctl(plant, "run", "feeder", "move_absolute", "target_position=16000") == \
        "feeder: move_absolute: ok\n"
    assert plant.drive(1).read("axis_state") == STANDSTILL
    assert plant.drive(1).read("position") == 16000
    assert objects(plant, "run", "feeder", "disable") == [
        {"drive": "feeder", "command": "disable", "result": "ok"}]


def test_words_of_their_own_and_peoples_units(plant):
    unit = plant.drive(1)
    assert ctl(plant, "enable", "feeder") == "feeder: enable: ok\n"
    assert ctl(plant, "move", "feeder", "10mm") == "feeder: move_absolute: ok\n"
    assert unit.read("position") == 6400
    # A number below 0 is no option; what has no unit is counts.
    assert ctl(plant, "move", "--relative", "feeder", "-5mm", "20mm/s") == "feeder: move_relative: ok\n"
    assert unit.read("position") == 3200
    (told, *_) = objects(plant, "history", "feeder")
    assert (told["command"], told["arguments"]) == \
        ("move_relative", {"target_position": -3200, "target_velocity": 12800.0})
    ctl(plant, "run", "feeder", "move_absolute", "target_velocity=20mm/s", "-640")
    assert unit.read("position") == -640
    assert ctl(plant, "move", "feeder", "1cm", status=2) == \
        'drivebridgectl: target_position: "cm" is no unit of it; right are counts and mm\n'
    assert ctl(plant, "move", "feeder", "1mm", "1", "2", status=2).startswith("drivebridgectl: usage: ")
    assert ctl(plant, "run", "feeder", "enable", "7", status=2) == 'drivebridgectl: enable takes no "7"\n'
    assert "12806.4 is out of range, -12800 to 12800 counts/s" in \
        ctl(plant, "move", "feeder", "0mm", "20.01mm/s", status=2)
    assert ctl(plant, "disable", "feeder") == "feeder: disable: ok\n"


def test_what_is_refused_says_why_and_ends_with_1(plant):
    ctl(plant, "run", "feeder", "enable")
    move = ("run", "feeder", "move_absolute", "target_position=6400001")
    assert ctl(plant, *move, status=1).startswith("drivebridgectl: limit: ")
    (error,) = objects(plant, *move, status=1)
    assert error["parameters"]["result"] == "limit"
    assert "did you mean move_relative" in ctl(plant, "run", "feeder", "move_relativ", status=2)
    assert "did you mean feeder?" in ctl(plant, "run", "feder", "enable", status=2)
    assert "did you mean feeder?" in ctl(plant, "run", "feder", "stop", status=2)
    assert 'stop takes no "speed"' in ctl(plant, "run", "feeder", "stop", "speed=3", status=2)


def test_a_drive_without_power_is_said_to_have_none(plant):
    said = ctl(plant, "move", "feeder", "10mm", status=1)
    assert said == "drivebridgectl: refused: the drive refuses it\nfeeder is disabled: drivebridgectl enable feeder\n"
    ctl(plant, "enable", "feeder")
    assert ctl(plant, "run", "feeder", "move_relative", status=1) == \
        "drivebridgectl: target_position: move_relative needs it\n"


def test_run_lists_what_a_drive_can_be_told(plant):
    lines = ctl(plant, "run", "feeder").splitlines()
    assert "move_absolute target_position target_velocity" in lines and max(map(len, lines)) <= 80
    (told,) = objects(plant, "run", "feeder")
    assert {"stop", "save_parameters"} <= {command["name"] for command in told["commands"]}


def test_who_does_not_wait_feeds_nothing(plant):
    ctl(plant, "run", "feeder", "enable")
    ctl(plant, "run", "--no-wait", "feeder", "move_velocity", "target_velocity=3200")
    eventually(lambda: run(plant, "status").returncode == 1, what="the watchdog")
    assert "drivebridgectl run feeder clear_fault" in ctl(plant, "status", status=1)
    assert ctl(plant, "run", "feeder", "move_absolute", "target_position=0",
               status=1).startswith("drivebridgectl: latched: ")
    ctl(plant, "run", "feeder", "clear_fault")
    ctl(plant, "status")


def sessions(plant, count):
    lines = [socket.socket(socket.AF_UNIX) for _ in range(count)]
    for line in lines:
        line.connect(str(plant.control_path))
    return lines


def test_stop_stops_what_moves_whoever_holds_the_socket(plant):
    """All drives, over a socket that others fill; a silent one is named and delays no other."""
    for name in NAMES:
        ctl(plant, "run", name, "enable")
        ctl(plant, "run", "--no-wait", name, "move_velocity", "target_velocity=640")
    plant.sim.fault("silence on", "drive3")
    lines = sessions(plant, 64)
    try:
        done = run(plant, "stop")
        assert done.returncode == 1, done
        assert sorted(done.stdout.splitlines()[:2]) == ["conveyor: stop: ok", "feeder: stop: ok"]
        assert done.stdout.splitlines()[2].startswith("lift: stop: NOT CONFIRMED: ")
        assert "use the emergency stop" in done.stderr
        for number in (1, 2):
            plant.wait_standing(number)
        plant.sim.fault("silence off", "drive3")
        eventually(lambda: sorted(ctl(plant, "stop").splitlines()) == sorted(f"{name}: stop: ok" for name in NAMES))
        plant.wait_standing(3)
    finally:
        for line in lines:
            line.close()


@pytest.mark.parametrize("words", ["run feeder stop", "run feeder quick_stop", "run feeder disable", "disable feeder"])
def test_whoever_holds_the_socket_a_run_stops(plant, words):
    """People and scripts have more than one word for it."""
    ctl(plant, "run", "feeder", "enable")
    ctl(plant, "run", "--no-wait", "feeder", "move_velocity", "target_velocity=640")
    lines = sessions(plant, 64)
    try:
        assert ctl(plant, *words.split()) == f"feeder: {words.split()[-1] if 'run' in words else 'disable'}: ok\n"
        plant.wait_standing(1)
        # All else is refused: the service is full.
        assert "too much to do" in ctl(plant, "run", "feeder", "enable", status=1)
    finally:
        for line in lines:
            line.close()


def test_stop_of_some(plant):
    for name in NAMES[:2]:
        ctl(plant, "run", name, "enable")
        ctl(plant, "run", "--no-wait", name, "move_velocity", "target_velocity=640")
    plant.sim.fault("silence on", "drive3")
    assert ctl(plant, "stop", "--quick", "feeder") == "feeder: quick_stop: ok\n"
    plant.wait_standing(1)
    assert sorted(ctl(plant, "stop", "--disable", "conveyor", "conveyr", status=2).splitlines()) == [
        "conveyor: disable: ok", 'conveyr: disable: NOT CONFIRMED: no drive is called "conveyr"']
    eventually(lambda: plant.drive(2).read("velocity") == 0)


def test_an_interrupted_run_stops_the_drive(plant):
    ctl(plant, "run", "feeder", "enable")
    process = subprocess.Popen(
        [find_program("drivebridgectl"), "--socket", plant.control_path, "run", "feeder",
         "move_absolute", "target_position=1000000"], stderr=subprocess.PIPE, text=True)
    eventually(lambda: plant.drive(1).read("velocity") > 3000)
    process.terminate()
    assert "feeder has been told to stop" in process.communicate(timeout=10)[1]
    assert process.returncode == 1
    plant.wait_standing(1)
    assert plant.drive(1).read("axis_state") == STANDSTILL


def test_a_configuration_is_checked_and_taken(plant):
    assert ctl(plant, "check", str(plant.config_path)).startswith("modbus\n")
    plant.sections["drive lift"]["max-velocity"] = 10.0
    plant.write_config()
    ctl(plant, "reload")
    plant.write_config("bus line {\n\tprotocol = nothing\n}\n")
    assert "nothing" in ctl(plant, "check", str(plant.config_path), status=1)
    (told,) = objects(plant, "check", str(plant.config_path), status=1)
    assert told["right"] is False and told["lines"]
    assert "nothing" in ctl(plant, "reload", status=1)
    # It is there, and says that a restart would be another matter.
    assert "configuration: refused: " in ctl(plant, "status", status=1)


# --- terminals -------------------------------------------------------------------------------------


@pytest.fixture
def terminal(plant):
    made = []

    def make(*words):
        made.append(Terminal(plant.control_path, *words))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_a_jog_moves_while_the_key_is_held(plant, terminal):
    ctl(plant, "run", "feeder", "enable")
    one = terminal("jog", "feeder", "--velocity", "3200")
    one.shows("hold an arrow key")
    began = time.monotonic()
    # For longer than the watchdog of a second.
    one.hold(RIGHT, lambda: time.monotonic() - began > 2.5)
    assert plant.drive(1).read("velocity") > 3000
    plant.wait_standing(1)
    assert plant.drive(1).read("axis_state") == STANDSTILL
    assert plant.drive(1).read("position") > 3200
    one.press(b"q")
    one.ends(0)
    # It has been fed all the time.
    assert plant.drive(1).read("watchdog_trips") == 0


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_jog_that_dies_or_hangs_is_stopped_by_the_service(plant, terminal, number):
    """Whatever the watchdog says: here it is off."""
    ctl(plant, "run", "feeder", "enable")
    ctl(plant, "set", "feeder", "watchdog_ms=0")
    one = terminal("jog", "feeder", "--velocity", "3200")
    one.shows("hold an arrow key")
    one.hold(RIGHT, lambda: plant.drive(1).read("velocity") > 3000)
    one.process.send_signal(number)
    plant.wait_standing(1)
    assert plant.drive(1).read("watchdog_trips") == 0
    # What it says when it goes on moves nothing.
    one.process.send_signal(signal.SIGCONT)
    one.process.kill()
    one.process.wait()
    assert plant.drive(1).read("velocity") == 0


def test_watch_shows_what_moves(plant, terminal):
    one = terminal("watch")
    one.shows("feeder.*Disabled")
    ctl(plant, "run", "feeder", "enable")
    one.shows("feeder.*Standstill")
    one.shows("line: load [0-9]+ %")
    one.press(b"q")
    one.ends(0)


# --- the guide -------------------------------------------------------------------------------------


def transcripts(page=PAGE):
    """The page's blocks: lists of (what is typed, what is said)."""
    blocks = []
    for text in re.findall(r"^```console\n(.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S):
        block = []
        for line in text.splitlines():
            if line.startswith(("$ ", "# ")):
                block.append((line, []))
            else:
                block[-1][1].append(line)
        blocks.append(block)
    return blocks


def pattern_of(lines):
    """What is printed now: other numbers, other widths of columns; "..." for what is left out."""
    text = ""
    for line in lines:
        if line.strip() == "...":
            text += r"(?:.*\n)*?"
            continue
        words = []
        for word in line.split():
            if word.startswith("(/dev/"):
                words.append(r"\(\S+\),")
            elif word == "ms":
                words.append("m?s")
            elif word == "|":
                # The bytes behind it are what the words before it say.
                words.append(r"\|.*")
                break
            else:
                words.append(re.sub(r"\d+(?:\\\.\d+)?", r"\\d+(?:\\.\\d+)?", re.escape(word)))
        text += r"[ ]*" + r"\s+".join(words) + r"[ ]*\n"
    return text


# What happens between two lines.
EVENTS = {
    "# the cable of lift is pulled out": lambda plant: plant.sim.fault("silence on", "drive3"),
    "# and put back": lambda plant: plant.sim.fault("silence off", "drive3"),
    "# two seconds later": lambda plant: time.sleep(2),
}


def type_jog(plant, words):
    """With the right arrow held for a second, then q. The last that stood on each line."""
    one = Terminal(plant.control_path, *words)
    try:
        one.shows("hold an arrow key")
        began = time.monotonic()
        one.hold(RIGHT, lambda: time.monotonic() - began > 1)
        plant.wait_standing(1)
        time.sleep(0.3)
        one.press(b"q")
        text = one.ends(0).replace("\033[K", "")
    finally:
        one.close()
    return "\n".join(line.rstrip("\r").split("\r")[-1] for line in text.split("\n"))


def test_the_transcripts_of_the_guide(plant):
    typed = 0
    for block in transcripts():
        for line, expected in block:
            if line.startswith("# "):
                EVENTS[line](plant)
                continue
            words = shlex.split(line[2:])
            assert words.pop(0) == "drivebridgectl"
            typed += 1
            pattern = pattern_of(expected)

            def says(words=words, pattern=pattern):
                done = run(plant, *words)
                says.last = done.stdout + done.stderr
                return re.fullmatch(pattern, says.last)

            if words[0] == "jog":
                said = type_jog(plant, words)
                assert re.fullmatch(pattern, said), f"{line}\n{said}"
            elif words[0] in ("status", "events", "traces", "trace"):
                # It may take a moment until a drive is noticed.
                try:
                    eventually(says, 15, line)
                except AssertionError:
                    raise AssertionError(f"{line}\n{says.last}\n{pattern}") from None
            else:
                assert says(), f"{line}\n{says.last}"
    assert typed > 10
