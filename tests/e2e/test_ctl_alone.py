# SPDX-License-Identifier: Apache-2.0
"""drivebridgectl in front of a control socket that the test plays: what the real one does only when something is
wrong, and when exactly a jog says what."""

import errno
import json
import os
import pty
import re
import signal
import subprocess
import tempfile
import termios
import threading
import time
from pathlib import Path

import pytest
from bridgelib import ROOT, eventually, find_program
from fakecontrol import Fake

RIGHT, LEFT = b"\033[C", b"\033[D"


@pytest.fixture
def fake():
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as folder:
        made = Fake(Path(folder) / "control")
        yield made
        made.close()


def ctl(fake, *words, status=0, **options):
    """Runs it; what it says on both outputs."""
    done = subprocess.run([find_program("drivebridgectl"), "--socket", fake.path, *words],
                          capture_output=True, text=True, timeout=20, check=False, **options)
    assert done.returncode == status, done
    return done.stdout + done.stderr


class Terminal:
    """drivebridgectl on a terminal of its own."""

    def __init__(self, path, *words, env=None):
        self.leader, follower = pty.openpty()
        self.before = termios.tcgetattr(follower)
        self.process = subprocess.Popen(
            [find_program("drivebridgectl"), "--socket", path, *words], stdin=follower,
            stdout=follower, stderr=follower, start_new_session=True,
            env={**os.environ, "TERM": "xterm", **(env or {})})
        self.follower = follower
        os.set_blocking(self.leader, False)
        self.text = ""

    def read(self):
        try:
            while True:
                self.text += os.read(self.leader, 65536).decode(errors="replace")
        except BlockingIOError:
            pass
        except OSError as error:
            assert error.errno == errno.EIO
        return self.text

    def shows(self, pattern):
        return eventually(lambda: re.search(pattern, self.read()), what=pattern)

    def press(self, key):
        os.write(self.leader, key)

    def hold(self, key, until, timeout=10):
        """Repeats a key as a terminal does, until something is so."""
        deadline = time.monotonic() + timeout
        while not until():
            assert time.monotonic() < deadline, self.read()[-200:]
            self.press(key)
            time.sleep(0.03)
            self.read()

    def ends(self, status):
        self.process.wait(10)
        assert self.process.returncode == status, self.read()[-400:]
        assert termios.tcgetattr(self.follower) == self.before
        return self.read()

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self.follower)
        if self.leader is not None:
            os.close(self.leader)


@pytest.fixture
def terminal(fake):
    made = []

    def make(*words, **options):
        made.append(Terminal(fake.path, *words, **options))
        return made[-1]

    yield make
    for one in made:
        one.close()


# --- what a service may answer ---------------------------------------------------------------------


@pytest.mark.parametrize("answer", [b"hello\0", b"[]\0", b'{"error":1}\0', b"\0", b"\xff\xfe\0",
                                    b'{"parameters":{"drives":3,"buses":"x"}}\0'])
def test_what_is_no_answer_ends_it(fake, answer):
    fake.answers["Describe"] = lambda parameters: answer
    said = ctl(fake, "get", "feeder", "position", status=2 if b"drives" in answer else 3)
    assert said.startswith("drivebridgectl: ")


@pytest.mark.parametrize("method", ["Registers", "Commands", "Run"])
def test_answers_of_the_wrong_type_do_no_harm(fake, method):
    fake.answers[method] = {"registers": 3, "commands": {"a": 1}, "result": ["ok"]}
    done = subprocess.run([find_program("drivebridgectl"), "--socket", fake.path, "run", "feeder",
                           "enable"], capture_output=True, text=True, timeout=20, check=False)
    assert done.returncode in (0, 1, 2, 3) and "Sanitizer" not in done.stderr, done.stderr[-500:]


def test_an_answer_without_end_is_not_waited_for_for_ever(fake):
    fake.answers["Describe"] = lambda parameters: b'{"parameters":' + b" " * (20 << 20)
    assert "too long" in ctl(fake, "status", status=3)


def test_a_connection_lost_in_between_is_said(fake):
    def lose(parameters):
        fake.cut()

    fake.answers["Read"] = lose
    assert "closed the connection" in ctl(fake, "status", status=3)
    error = json.loads(ctl(fake, "--json", "status", status=3))
    assert error["error"] == "io.drivebridge.Client.Lost"


def test_a_service_of_another_version_is_named_as_that(fake):
    assert "of another version" in ctl(fake, "metrics", status=1)


def test_nobody_there_says_what_to_do(fake):
    fake.close()
    assert "is the service running?" in ctl(fake, "status", status=3)
    os.unlink(fake.path)
    assert "is the service running?" in ctl(fake, "status", status=3)


def test_texts_of_drives_do_not_reach_the_terminal_as_they_are(fake):
    fake.values["identity"] = "VSMD\033[2J\007"
    said = ctl(fake, "show", "feeder")
    assert "VSMD?[2J?" in said and "\033" not in said


# --- status ----------------------------------------------------------------------------------------


def test_the_worst_comes_first_with_what_to_do(fake):
    bad = {"axis_state": 0, "error": 1, "status": 0, "age_ms": 4294967295}
    fake.answers["Read"] = lambda parameters: {
        "values": bad if parameters["drive"] == "lift" else fake.values}
    fake.troubles["lift"] = ("no_answer", "act", "check its power")
    lines = ctl(fake, "status", status=1).splitlines()
    assert lines[1].split()[:3] == ["lift", "line", "Offline"] and "never" in lines[1]
    assert lines[2].split()[0] == "feeder"
    assert "lift: no_answer: check its power" in lines


def test_what_is_wrong_the_service_alone_says(fake):
    """Whatever the values are: all that shows it shows the same."""
    fake.values.update(axis_state=7, error=3, status=1 | 1 << 10)
    assert ctl(fake, "status").splitlines()[-1] == "all is well"
    fake.troubles["line"] = ("of_tomorrow", "later", "do this")
    assert "bus line: of_tomorrow: do this" in ctl(fake, "status")
    fake.troubles["line"] = ("aside", "look", "wait")
    assert "bus line: aside: wait" in ctl(fake, "status", status=1)


def test_a_hint_is_no_fault(fake):
    fake.troubles["feeder"] = ("params_unsaved", "hint", "save them")
    fake.troubles["lift"] = ("params_unsaved", "hint", "save them")
    lines = ctl(fake, "status").splitlines()
    assert lines[1].endswith("  save_parameters") and lines[-1] == "no faults, 2 hints"


def test_the_trouble_of_a_bus_is_said_once(fake):
    """Also where nobody says how wide the output may be."""
    scan = "control, user root, drivebridgectl (process 24382)"
    for name in ("line", "feeder", "lift"):
        fake.troubles[name] = ("aside", "look", f"bus line is out of service for a scan of {scan}", scan)
    lines = ctl(fake, "status", status=1).splitlines()
    assert [line.split("  ")[-1] for line in lines[1:3]] == ["wait: bus is scanned"] * 2
    assert lines[3:] == ["", f"bus line: aside: bus line is out of service for a scan of {scan}", "1 to look at"]


def test_hints_about_the_gateway_are_counted(fake):
    fake.answers["Describe"].update(restart_needed="/usr/sbin/drivebridged", audit_trouble="Read-only file system")
    lines = ctl(fake, "status").splitlines()
    assert lines[-3].startswith("an upgrade has replaced") and lines[-2].startswith("the audit trail cannot be written")
    assert lines[-1] == "no faults, 2 hints"


def test_status_fits_the_terminal(fake, terminal):
    fake.troubles["feeder"] = ("watchdog", "act", "its client fell silent; when the client is back: drivebridgectl run feeder clear_fault")
    text = terminal("status", env={"NO_COLOR": "1"}).ends(1).replace("\r", "")
    assert max(map(len, text.splitlines())) <= 80 and text.endswith("\n1 to act on\n")
    assert re.search(r"^feeder .* clear_fault$", text, re.M)


def test_help_is_asked_for_in_each_way(fake):
    assert ctl(fake, "help") == ctl(fake, "--help")
    assert ctl(fake, "help", "params", "restore") == ctl(fake, "params", "restore", "--help")
    assert "--with-address" in ctl(fake, "help", "params", "restore")
    assert "there is no command \"mvoe\"; " in ctl(fake, "help", "mvoe", status=2)
    assert "; did you mean move?" in ctl(fake, "help", "mvoe", status=2)
    assert "drivebridgectl help lists them" in ctl(fake, "mvoe", status=2)
    assert 'drivebridgectl: there is no option "--bogus"; ' in ctl(fake, "status", "stop", "--bogus", status=2)


def test_options_have_their_former_names_too(fake):
    """Of scripts that were written for them."""
    assert "goes without --all-bauds" in ctl(fake, "scan", "line", "--speed", "9600", "--all-speeds", status=2)
    assert "get has no option --baud" in ctl(fake, "get", "feeder", "position", "--speed=9600", status=2)
    assert "speed" not in ctl(fake, "help", "scan")


def test_a_service_of_before_an_upgrade_does_not_say_it(fake):
    del fake.answers["Troubles"]
    said = ctl(fake, "status", status=1)
    assert "feeder" in said and "does not say what is wrong" in said and "all is well" not in said


def test_colour_is_for_terminals_that_want_it(fake, terminal):
    assert "\033" not in ctl(fake, "status")
    on = terminal("status")
    assert "\033[32mall is well" in on.ends(0)
    off = terminal("status", env={"NO_COLOR": "1"})
    assert "\033" not in off.ends(0)


# --- address ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("end", ["cancelled", "port", "lost", "later"])
def test_whatever_ends_it_where_a_drive_may_be_is_said(fake, end):
    """Once it was told another address, or may have been."""
    find = {"speed": 115200, "address": 1, "verdict": "one", "identity": "", "other": "", "drives": [], "asked": 3,
            "answered": 3, "time_min_us": 1, "time_mean_us": 1, "time_max_us": 1}
    failed = {"error": "io.drivebridge.Control.ScanFailed", "parameters": {"why": end, "text": "it ended"}}
    told = []

    def scan(parameters):
        if end == "later" and told:
            return failed
        return {"asked": 1, "total": 1, "speed": 115200, "address": 1, "foreign": [], "wait_us": 30000,
                "finds": [find] if parameters["first"] == 1 else []}

    def set_up(parameters):
        told.append(parameters["value"])
        if end == "later":
            return {}
        if end == "lost":
            fake.cut()
            return None
        return failed

    fake.answers["Describe"]["buses"][0].update(address_effect="power_up", speed_effect="power_up", can=False)
    fake.answers.update(Scan=scan, SetUp=set_up)
    said = ctl(fake, "address", "line", "1", "9", "--yes", status=3 if end == "lost" else 1)
    assert told == [9] and "the drive may be found at address 1 or 9 of line" in said


# --- run -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("result, status", [("ok", 0), ("unproven", 0), ("pending", 1),
                                            ("cancelled", 1)])
def test_the_exit_status_follows_the_result(fake, result, status):
    fake.answers["Run"] = {"result": result}
    assert ctl(fake, "run", "feeder", "enable", status=status) == f"feeder: enable: {result}\n"
    assert fake.called("Run")[-1]["until_end"] is True


def test_without_waiting_pending_is_well(fake):
    fake.answers["Run"] = {"result": "pending"}
    ctl(fake, "run", "--no-wait", "feeder", "move_velocity", "target_velocity=-3.5")
    assert fake.called("Run")[-1] == {"drive": "feeder", "command": "move_velocity",
                                      "arguments": {"target_velocity": -3.5}, "until_end": False,
                                      "token": "8f3a2c71-123456"}


@pytest.mark.parametrize("words", [["run", "feeder", "move_absolute", "target_position=5"], ["move", "feeder", "5"],
                                   ["position", "feeder", "go", "pick"]])
def test_what_moves_carries_proof_of_its_age(fake, words):
    """A service that hangs and goes on when this program has said that it does not answer moves nothing then."""
    ctl(fake, *words)
    assert fake.called("Run")[-1]["token"] == "8f3a2c71-123456"


def test_a_refusal_says_why(fake):
    fake.answers["Run"] = {"error": "io.drivebridge.Control.Refused", "parameters": {
        "result": "latched", "code": 10, "reason": "the watchdog has stopped it; clear_fault"}}
    assert "latched: the watchdog has stopped it" in ctl(fake, "run", "feeder", "enable", status=1)
    error = json.loads(ctl(fake, "--json", "run", "feeder", "enable", status=1))
    assert error["parameters"]["code"] == 10


# --- stop ------------------------------------------------------------------------------------------


STOPPED = {"drive": "feeder", "result": "ok"}
SILENT = {"drive": "lift", "result": "pending", "reason": "it does not\033[2J answer"}


def test_stop_is_the_first_thing_that_is_said(fake):
    """Nothing is asked before, which could take long."""
    fake.answers["Stop"] = [{"stopped": [STOPPED]}, {"stopped": [{"drive": "lift", "result": "ok"}]}]
    assert ctl(fake, "stop") == "feeder: stop: ok\nlift: stop: ok\n"
    assert [method for method, _ in fake.calls] == ["Stop"]
    assert fake.called("Stop")[0]["drives"] == [] and fake.called("Stop")[0]["command"] == "stop"


@pytest.mark.parametrize("option, command", [("--quick", "quick_stop"), ("--disable", "disable")])
def test_there_are_other_stops(fake, option, command):
    fake.answers["Stop"] = {"stopped": [STOPPED]}
    assert ctl(fake, "stop", option, "feeder") == f"feeder: {command}: ok\n"
    assert fake.called("Stop")[0]["drives"] == ["feeder"] and fake.called("Stop")[0]["command"] == command


def test_what_is_not_confirmed_is_said(fake):
    fake.answers["Stop"] = [{"stopped": [STOPPED]}, {"stopped": [SILENT]}]
    said = ctl(fake, "stop", status=1)
    assert "feeder: stop: ok\nlift: stop: NOT CONFIRMED: it does not?[2J answer\n" in said
    assert "use the emergency stop" in said
    told = [json.loads(line) for line in ctl(fake, "--json", "stop", status=1).splitlines()]
    assert told[0] == {**STOPPED, "command": "stop"} and told[1] == {**SILENT, "command": "stop"}
    assert told[2]["error"] == "io.drivebridge.Client.NotConfirmed"


@pytest.mark.parametrize("answer", [{}, {"stopped": []}, {"stopped": 3}, {"stopped": ["feeder"]},
                                    {"stopped": [{"drive": "feeder"}]}, "io.drivebridge.Control.NotAllowed"])
def test_no_answer_is_taken_for_a_confirmation(fake, answer):
    fake.answers["Stop"] = answer
    done = subprocess.run([find_program("drivebridgectl"), "--socket", fake.path, "stop", "feeder"],
                          capture_output=True, text=True, timeout=20, check=False)
    assert done.returncode in (1, 3) and "use the emergency stop" in done.stderr, done


@pytest.mark.parametrize("words", [["run", "feeder", "stop"], ["disable", "feeder"], ["run", "feeder", "quick_stop"]])
def test_a_stop_by_another_word_says_that_nobody_answers(fake, words):
    """It asks nothing before it stops, so the first who could say that the service hangs is its own clock."""
    fake.answers["Run"] = lambda parameters: None
    said = ctl(fake, *words, status=3)
    assert said.index("not confirmed yet; if somebody is in danger use the emergency stop") < \
        said.index("the service does not answer within 5000 ms") < \
        said.index("the stop is not confirmed: use the emergency stop")
    assert len(fake.called("Run")) == 1


def test_a_service_that_hangs_is_not_waited_for_for_ever(fake):
    fake.answers["Stop"] = lambda parameters: None
    said = ctl(fake, "stop", status=3)
    assert said.index("not confirmed yet") < said.index("the service does not answer")
    assert len(fake.called("Stop")) == 1


@pytest.mark.parametrize("trouble", ["full", "lost"])
def test_a_stop_is_said_again_until_it_is_taken(fake, trouble):
    def answer(parameters):
        if len(fake.called("Stop")) == 3:
            return {"stopped": [STOPPED]}
        if trouble == "full":
            return "io.drivebridge.Control.Busy"
        fake.cut()
        return None

    fake.answers["Stop"] = answer
    assert ctl(fake, "stop", "feeder") == "feeder: stop: ok\n"


def test_nobody_there_to_stop(fake):
    fake.close()
    said = ctl(fake, "stop", status=3)
    assert "is the service running?" in said and "use the emergency stop" in said


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_who_interrupts_a_motion_stops_it(fake, number):
    fake.answers["Run"] = lambda parameters: (
        {"result": "ok"} if parameters["command"] == "stop" else None)
    process = subprocess.Popen([find_program("drivebridgectl"), "--socket", fake.path, "run",
                                "feeder", "move_velocity", "target_velocity=10"],
                               stderr=subprocess.PIPE, text=True)
    eventually(lambda: fake.runs() == ["move_velocity"])
    eventually(lambda: os.path.exists(f"/proc/{process.pid}") and "SigBlk:\t00000000" in Path(
        f"/proc/{process.pid}/status").read_text() and not re.search(
        r"SigBlk:\t0+\n", Path(f"/proc/{process.pid}/status").read_text()))
    process.send_signal(number)
    assert "feeder has been told to stop" in process.communicate(timeout=10)[1]
    assert process.returncode == 1
    assert fake.runs() == ["move_velocity", "stop"]


# --- jog -------------------------------------------------------------------------------------------


def moves(fake):
    return [parameters["arguments"]["target_velocity"] for parameters in fake.called("Run")
            if parameters["command"] == "move_velocity"]


def jogging(fake, terminal, *words):
    one = terminal("jog", "feeder", *words)
    one.shows("hold an arrow key")
    one.hold(RIGHT, lambda: fake.runs() == ["move_velocity"])
    return one


def test_a_held_key_moves_and_its_release_stops(fake, terminal):
    one = jogging(fake, terminal)
    # A tenth of what the register takes.
    assert moves(fake) == [500.0]
    began = time.monotonic()
    one.hold(RIGHT, lambda: time.monotonic() - began > 0.6)
    assert fake.runs() == ["move_velocity"]
    released = time.monotonic()
    eventually(lambda: fake.runs() == ["move_velocity", "stop"])
    assert 0.15 < time.monotonic() - released < 1
    one.hold(LEFT, lambda: len(moves(fake)) == 2)
    assert moves(fake)[1] == -500.0
    one.press(b"q")
    one.ends(0)
    assert fake.runs() == ["move_velocity", "stop", "move_velocity", "stop"]


def test_a_jog_is_held_by_beats_with_the_newest_token(fake, terminal):
    one = jogging(fake, terminal, "--velocity", "7")
    assert moves(fake) == [7.0]
    assert fake.called("Run")[0]["hold_ms"] == 300
    assert fake.called("Run")[0]["token"] == "8f3a2c71-123456"
    fake.answers["Clock"] = {"token": "8f3a2c71-123999"}
    count, reads, began = len(fake.called("Beat")), len(fake.called("Read")), time.monotonic()
    one.hold(RIGHT, lambda: time.monotonic() - began > 1)
    assert 5 <= len(fake.called("Beat")) - count <= 15
    assert 5 <= len(fake.called("Read")) - reads <= 15
    assert fake.called("Beat")[-1] == {"drive": "feeder", "token": "8f3a2c71-123999"}
    # Nothing is repeated that the drive has been told.
    assert fake.runs() == ["move_velocity"]
    # Released, nobody says that it is held.
    eventually(lambda: fake.runs() == ["move_velocity", "stop"])
    count, reads = len(fake.called("Beat")), len(fake.called("Read"))
    eventually(lambda: len(fake.called("Read")) > reads + 3)
    assert len(fake.called("Beat")) == count


@pytest.mark.parametrize("key", [b"q", b"\033", b"\003", b"\x1a"])
def test_keys_that_end_it_stop_first(fake, terminal, key):
    one = jogging(fake, terminal)
    one.press(key)
    one.ends(0)
    assert fake.runs() == ["move_velocity", "stop"]


def test_any_other_key_stops_until_all_are_released(fake, terminal):
    one = jogging(fake, terminal)
    one.press(b" ")
    one.hold(RIGHT, lambda: fake.runs() == ["move_velocity", "stop"])
    began = time.monotonic()
    one.hold(RIGHT, lambda: time.monotonic() - began > 0.5)
    assert fake.runs() == ["move_velocity", "stop"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT,
                                    signal.SIGTSTP])
def test_signals_stop_it(fake, terminal, number):
    one = jogging(fake, terminal)
    one.process.send_signal(number)
    one.ends(0)
    assert fake.runs() == ["move_velocity", "stop"]


def test_a_terminal_that_goes_away_stops_it(fake, terminal):
    one = jogging(fake, terminal)
    os.close(one.leader)
    one.leader = None
    assert one.process.wait(10) is not None
    assert fake.runs() == ["move_velocity", "stop"]


def test_a_terminal_that_takes_no_output_does_not_keep_it_from_stopping(fake, terminal):
    one = jogging(fake, terminal)
    termios.tcflow(one.follower, termios.TCOOFF)
    for position in range(50):
        fake.values["position"] = position
        one.press(RIGHT)
        time.sleep(0.02)
    released = len(fake.called("Read"))
    # A busy machine may have kept the key away for long enough before.
    eventually(lambda: fake.runs()[-1] == "stop" and len(fake.called("Read")) > released + 5)
    one.press(b"q")
    one.process.wait(10)
    termios.tcflow(one.follower, termios.TCOON)
    one.ends(0)


def test_a_lost_connection_stops_it_over_a_new_one(fake, terminal):
    one = jogging(fake, terminal)
    fake.cut()
    assert "has been told to stop over a new one" in one.ends(3)
    assert fake.runs() == ["move_velocity", "stop"]


def test_a_service_that_is_gone_leaves_the_watchdog(fake, terminal):
    one = jogging(fake, terminal)
    fake.close()
    assert "its watchdog is to stop it" in one.ends(3)


def test_a_stop_overtakes_a_move_that_waits(fake, terminal):
    answered = threading.Event()

    def answer(parameters):
        if parameters["command"] == "move_velocity":
            answered.wait(10)
        return {"result": "ok"}

    fake.answers["Run"] = answer
    one = jogging(fake, terminal)
    # Past the move, which still waits, and then behind it.
    eventually(lambda: fake.runs() == ["move_velocity", "stop"])
    answered.set()
    eventually(lambda: fake.runs() == ["move_velocity", "stop", "stop"])
    one.press(b"q")
    one.ends(0)


@pytest.mark.parametrize("result, runs", [("limit", ["move_velocity"]),
                                          ("indeterminate", ["move_velocity", "stop"])])
def test_a_failed_move_is_shown_and_not_repeated(fake, terminal, result, runs):
    """Who was refused leaves alone what somebody else may be moving."""
    fake.answers["Run"] = lambda parameters: (
        {"result": "ok"} if parameters["command"] == "stop" else
        {"error": "io.drivebridge.Control.Refused",
         "parameters": {"result": result, "code": 9, "reason": "just so"}})
    one = terminal("jog", "feeder")
    one.shows("hold an arrow key")
    one.hold(RIGHT, lambda: f"{result}: just so" in one.read())
    began = time.monotonic()
    one.hold(RIGHT, lambda: time.monotonic() - began > 0.5)
    assert fake.runs() == runs
    one.press(b"q")
    one.ends(0)
    assert fake.runs() == runs


def test_a_drive_that_cannot_move_is_not_jogged(fake, terminal):
    fake.values["axis_state"] = 1
    assert "drivebridgectl run feeder enable" in terminal("jog", "feeder").ends(1)
    fake.troubles["feeder"] = ("watchdog", "act", "clear_fault")
    assert "feeder: watchdog: clear_fault" in terminal("jog", "feeder").ends(1)
    assert fake.runs() == []


def test_jog_needs_a_terminal(fake):
    assert "needs a terminal" in ctl(fake, "jog", "feeder", status=2, stdin=subprocess.DEVNULL)
    assert fake.runs() == []


# --- watch -----------------------------------------------------------------------------------------


def stream(fake):
    """An endless one, of which only the beginning comes."""
    message = {"parameters": {"time_us": 1, "skipped": 0, "samples": [
        {"drive": "feeder", "values": fake.values}]}, "continues": True}
    return json.dumps(message).encode() + b"\0"


@pytest.mark.parametrize("key", [b"q", b"\003", b"\033"])
def test_watch_redraws_and_gives_the_terminal_back(fake, terminal, key):
    fake.answers["Subscribe"] = lambda parameters: stream(fake)
    fake.answers["Figures"] = {"buses": {"line": {"utilisation": 123, "cycle_us": 1234}}}
    one = terminal("watch")
    one.shows("feeder.*Standstill")
    one.shows("line: load 12 %, cycle 1.2 ms")
    assert "\033[?1049h" in one.read()
    one.press(key)
    assert one.ends(0).endswith("\033[?25h\033[?1049l")
    assert fake.called("Subscribe")[0]["drives"] == ["feeder", "lift"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_signals_give_the_terminal_back(fake, terminal, number):
    fake.answers["Subscribe"] = lambda parameters: stream(fake)
    one = terminal("watch", "feeder")
    one.shows("feeder.*Standstill")
    one.process.send_signal(number)
    assert one.ends(0).endswith("\033[?25h\033[?1049l")


def test_a_lost_connection_gives_the_terminal_back(fake, terminal):
    fake.answers["Subscribe"] = lambda parameters: stream(fake)
    one = terminal("watch")
    one.shows("feeder.*Standstill")
    fake.cut()
    assert "closed the connection" in one.ends(3)


def test_watch_as_objects_needs_no_terminal(fake):
    fake.answers["Subscribe"] = [{"time_us": at, "samples": [], "skipped": 0} for at in range(3)]
    lines = ctl(fake, "--json", "watch", "--interval", "0", "feeder").splitlines()
    assert [json.loads(line)["time_us"] for line in lines] == [0, 1, 2]
    assert fake.called("Subscribe")[0]["interval_ms"] == 0


# --- a gateway as one file ---------------------------------------------------------------------------

PORT = "/dev/serial/by-id/usb-OLD-if00-port0"
PLANT = f"""bus press {{
	protocol = vsmd-serial
	device   = "{PORT}" # not "/dev/ttyUSB0"
}}
drive feeder {{
	bus = press
	address = 1
	unit = 1
}}
end
"""


@pytest.mark.parametrize("place", ["conf.d/plant.conf", "edited/edited.conf"])
def test_a_gateway_goes_into_a_file_and_onto_another(fake, terminal, tmp_path, place):
    old, new, packed = tmp_path / "old", tmp_path / "new" / "drivebridge", tmp_path / "12:00.tar.gz"
    for folder, path in ((old, old / place), (new, new / "conf.d" / "other.conf")):
        path.parent.mkdir(parents=True)
        (folder / "drivebridge.conf").write_text("end\n")
        path.write_text(PLANT)
    (old / "web-users").write_text("anna\n")
    (old / "web-users").chmod(0o640)
    fake.answers["Describe"]["configuration"] = str(old / "drivebridge.conf")
    registers = fake.answers["Registers"]["registers"]
    bits = {**registers[2], "codes": {"0": "online", "12": "params_valid"}}
    fake.answers["Registers"] = {"registers": [*registers[:2], bits, *registers[3:]]}
    fake.values.update({"status": 1 | 1 << 12, "spd": 6400.0})
    assert "the parameters of 2 drives" in ctl(fake, "backup", packed)
    assert packed.stat().st_mode & 0o777 == 0o600 and sorted(path.name for path in tmp_path.iterdir())[0] == packed.name
    # Nothing is done where a port is not known, or with what is no backup.
    said = ctl(fake, "restore", packed, new, "--yes", status=2)
    assert f"{PORT} is not on this machine: say --ports {PORT}=DEVICE" in said
    assert "right is OLD=NEW" in ctl(fake, "restore", packed, new, "--yes", "--ports", PORT, status=2)
    (tmp_path / "none").write_text("none")
    assert "none cannot be unpacked" in ctl(fake, "restore", tmp_path / "none", new, "--yes", status=1)
    assert sorted(path.name for path in new.parent.iterdir()) == ["drivebridge"]
    assert (new / "conf.d" / "other.conf").read_text() == PLANT

    ctl(fake, "restore", packed, new, "--yes", "--ports", f"{PORT}=/dev/ttyS7")
    text = (new / place).read_text()
    assert text == PLANT.replace(PORT, "/dev/ttyS7")
    assert (new / "web-users").stat().st_mode & 0o777 == 0o640
    assert (new / "parameters" / "feeder.params").read_text().endswith("end\n")
    (kept,) = [path for path in new.parent.iterdir() if path != new]
    assert kept.name.startswith("drivebridge.before-20") and (kept / "conf.d" / "other.conf").exists()
    assert not (new / "conf.d" / "other.conf").exists()

    # By hand, into a folder that is not there yet; a configuration that is wrong stays outside.
    on = terminal("restore", packed, str(new.parent / "third"))
    on.shows("which one is it")
    on.press(b"/dev/ttyS8\n")
    on.shows("go on\\?")
    on.press(b"y\n")
    on.ends(0)
    assert '"/dev/ttyS8"' in (new.parent / "third" / place).read_text()
    (old / "drivebridge.conf").write_text("bogus = 1\nend\n")
    ctl(fake, "backup", packed)
    said = ctl(fake, "restore", packed, new, "--yes", "--ports", f"{PORT}=/dev/ttyS7", status=1)
    assert "is not right here; nothing was changed" in said and "bogus" in said
    assert (new / "drivebridge.conf").read_text() == "end\n"


# --- completion ------------------------------------------------------------------------------------


def complete(fake, line):
    """What bash offers behind this line."""
    words = line.split(" ")
    script = f"""
        source {ROOT}/packaging/completions/drivebridgectl
        PATH={find_program('drivebridgectl').parent}:$PATH DRIVEBRIDGE_SOCKET={fake.path}
        export DRIVEBRIDGE_SOCKET
        COMP_WORDS=({' '.join(f'"{word}"' for word in words)}) COMP_CWORD={len(words) - 1}
        _drivebridgectl
        printf '%s\\n' "${{COMPREPLY[@]}}"
    """
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=20,
                          check=True)
    return done.stdout.split()


def test_the_shell_knows_commands_options_and_names(fake):
    assert complete(fake, "drivebridgectl st") == ["status", "stop"]
    assert complete(fake, "drivebridgectl help com") == ["commission"]
    assert complete(fake, "drivebridgectl move f") == ["feeder"]
    assert complete(fake, "drivebridgectl stop feeder l") == ["lift"]
    assert complete(fake, "drivebridgectl stop --q") == ["--quick"]
    assert complete(fake, "drivebridgectl status --j") == ["--json"]
    assert complete(fake, "drivebridgectl show ")[-3:] == ["feeder", "lift", "gateway"]
    assert complete(fake, "drivebridgectl --json run f") == ["feeder"]
    assert complete(fake, "drivebridgectl run feeder move_") == ["move_velocity", "move_absolute"]
    assert complete(fake, "drivebridgectl run feeder move_velocity t") == ["target_velocity="]
    assert complete(fake, "drivebridgectl get feeder position vel") == ["velocity"]
    assert complete(fake, "drivebridgectl set feeder p") == []
    assert complete(fake, "drivebridgectl set feeder s") == ["spd="]
    assert "feeder" not in complete(fake, "drivebridgectl show feeder ")


def test_the_shell_goes_on_without_a_service(fake):
    fake.close()
    assert complete(fake, "drivebridgectl show f") == []
