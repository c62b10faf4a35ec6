# SPDX-License-Identifier: Apache-2.0
"""drivebridge-webd over plain HTTP: who may ask what, streams, and above all the dead man's rule."""

import base64
import contextlib
import http.client
import itertools
import json
import re
import signal
import socket
import subprocess
import threading
import time

import pytest
from bridgelib import ROOT, Path, code, eventually, find_program
from relay import Relay
from weblib import OPERATOR, READER, Failed, Page, Webd, memory_kib

PLC = "127.0.0.9"
SPEED = 3200.0


class Gateway:
    """All programs of a test; ended and judged behind it."""

    def __init__(self, place, make_bridge):
        self.place = Path(place)
        self.make_bridge = make_bridge
        self.webds = []
        self.pages = []

    def webd(self, bridge=None, **options):
        place = self.place / f"web{len(self.webds)}"
        place.mkdir()
        made = Webd(place, bridge, **options).start()
        self.webds.append(made)
        return made.wait_for_service() if bridge else made

    def page(self, webd, user=None, **options):
        made = Page(webd, user, **options)
        self.pages.append(made)
        if not user:
            made.load()
        return made

    def finish(self):
        for page in self.pages:
            page.close()
        return [problem for webd in self.webds for problem in webd.finish()]


@pytest.fixture
def gateway(request, tmp_path, make_bridge):
    made = Gateway(tmp_path, make_bridge)
    yield made
    problems = made.finish()
    if problems or getattr(request.node, "failed", False):
        for webd in made.webds:
            print(f"--- {webd.log_path}\n{webd.log()[-6000:]}")
    assert not problems, problems


def refused(status, ask, *arguments, **options):
    """What a request is refused with."""
    with pytest.raises(Failed) as caught:
        ask(*arguments, **options)
    assert caught.value.status == status, caught.value
    assert caught.value.text
    return caught.value


# --- who may ask ------------------------------------------------------------------------------------

LOOKING = {"Describe": {}, "Registers": {"drive": "drive1"}, "Commands": {"drive": "drive1"},
           "Read": {"drive": "drive1", "names": ["position"]}, "Traces": {}, "Figures": {}}
ACTING = {"Write": {"drive": "drive1", "values": {"target_velocity": 1.0}},
          "Run": {"drive": "drive1", "command": "enable"}, "Reload": {},
          "SetUp": {"bus": "line", "address": 9, "what": "save"}}
STREAMS = {"overview": {}, "Events": {}, "Trace": {"bus": "line"},
           "Subscribe": {"drives": [], "names": ["position"], "interval_ms": 50}}


def test_each_role_may_what_it_may(gateway):
    """Nobody nothing, an observer looks, an engineer acts; with `read = all` nobody looks, too. test_roles.py has the rest."""
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge)
    nobody, reader, operator = (gateway.page(webd, user) for user in (None, READER, OPERATOR))
    assert nobody.load()["role"] == "none" and nobody.load()["user"] is None
    assert reader.load()["role"] == "observer" and operator.load()["user"] == "olga"

    for method, parameters in {**LOOKING, **ACTING}.items():
        assert refused(401, nobody.call, method, **parameters).error == "LoginRequired"
    for method, parameters in STREAMS.items():
        assert refused(401, nobody.stream, method, **parameters).error == "LoginRequired"
    assert refused(401, nobody.beat, "drive1", 1, 1, SPEED).error == "LoginRequired"
    assert refused(401, nobody.alive).error == "LoginRequired"

    for page in (reader, operator):
        for method, parameters in LOOKING.items():
            assert page.call(method, **parameters)
        for method, parameters in STREAMS.items():
            assert page.stream(method, **parameters).wait(event="service" if method == "overview" else None)
    for method, parameters in ACTING.items():
        assert refused(403, reader.call, method, **parameters).error == "NotAllowed"
    assert refused(403, reader.stream, "Scan", bus="line").error == "NotAllowed"
    assert refused(403, reader.beat, "drive1", 1, 1, SPEED).error == "NotAllowed"
    assert refused(403, reader.stream, "commission", drive="drive1").error == "NotAllowed"

    assert operator.call("Write", **ACTING["Write"]) == {"result": "ok"}
    assert operator.run("drive1", "enable") == "ok"
    assert operator.call("Reload") == {"messages": []}
    assert refused(409, operator.call, "SetUp", **ACTING["SetUp"]).error == "ScanFailed"
    found = operator.stream("Scan", bus="line", first=1, last=2)
    assert found.wait(event="end", timeout=30) == {}
    assert any(find["address"] == 1 for _, data in found.events for find in data.get("finds", []))

    log = webd.log()
    assert 'olga at 127.0.0.1: Write {"drive":"drive1","values":{"target_velocity":1.0}}' in log
    assert "olga at 127.0.0.1: Scan" in log and "logged in as rudi, observer" in log
    assert OPERATOR[1] not in log and READER[1] not in log

    open_for_all = gateway.webd(bridge, access={"read": "all"})
    anybody = gateway.page(open_for_all)
    assert anybody.load()["role"] == "observer" and anybody.load()["user"] is None
    assert anybody.call("Describe")["drives"]
    assert refused(401, anybody.call, "Run", **ACTING["Run"]).error == "LoginRequired"


def ask_in_vain(page):
    with contextlib.suppress(Failed, OSError):
        page.call("Describe")


def test_errors_are_told_by_their_names(gateway):
    bridge = gateway.make_bridge(drive={"max-position": 10000.0})
    webd = gateway.webd(bridge)
    page = gateway.page(webd, OPERATOR)
    assert refused(404, page.call, "Read", drive="nope", names=[]).body["parameters"] == {"drive": "nope"}
    assert refused(404, page.call, "Read", drive="drive1", names=["nope"]).error == "NoSuchRegister"
    assert refused(404, page.run, "drive1", "nope").error == "NoSuchCommand"
    assert refused(400, page.call, "Write", drive="drive1", values={"position": 1}).error == "BadValue"
    assert refused(400, page.call, "Read", drive=7).error == "BadRequest"
    far = refused(409, page.run, "drive1", "move_absolute", target_position=20000, target_velocity=100.0)
    assert far.error == "Refused" and far.body["parameters"]["result"] == "limit"
    assert "failed: limit" in webd.log()
    stream = page.stream("Subscribe", drives=["nope"], names=[], interval_ms=0)
    assert stream.wait(event="error")["error"] == "NoSuchDrive"
    assert refused(400, page.ask, "POST", "/api/call/Run", {"drive": "drive1", "command": "enable"},
                   X_Tab=None).error == "BadRequest"
    assert refused(400, page.ask, "POST", "/api/alive", {}, X_Tab="nope").error == "BadRequest"

    bridge.process.send_signal(signal.SIGSTOP)
    try:
        # Whoever asks the service waits for it; a page, a session and a login do not.
        threading.Thread(target=ask_in_vain, args=(gateway.page(webd, OPERATOR),), daemon=True).start()
        assert page.load()["user"] == "olga"
        assert page.request("GET", "/")[0] == 200
    finally:
        bridge.process.send_signal(signal.SIGCONT)
    bridge.stop_bridge()
    eventually(lambda: not page.load()["service"])
    assert refused(502, page.call, "Describe").error == "ServiceUnreachable"
    assert refused(502, page.run, "drive1", "stop").error == "ServiceUnreachable"
    assert refused(502, page.stream, "Events").error == "ServiceUnreachable"


def test_requests_of_other_pages_are_refused(gateway):
    """Token, content type, Origin, Host: each alone keeps a page of somebody else out."""
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge, server={"hosts": ["gateway.example"]})
    page = gateway.page(webd, OPERATOR)
    host = f"{webd.address[0]}:{webd.address[1]}"
    run = ("POST", "/api/call/Run", {"drive": "drive1", "command": "enable"})

    assert refused(403, page.ask, *run, X_Drivebridge=None).error == "BadToken"
    assert refused(403, page.ask, *run, X_Drivebridge="0" * 32).error == "BadToken"
    stranger = gateway.page(webd)
    assert refused(403, page.ask, *run, X_Drivebridge=stranger.token).error == "BadToken"
    assert refused(403, stranger.ask, "POST", "/api/login", {"user": "olga", "password": "x"},
                   X_Drivebridge=page.token).error == "BadToken"
    assert refused(401, page.ask, *run, Cookie="drivebridge=" + "0" * 32).error == "LoginRequired"
    for kind in ("text/plain", "application/x-www-form-urlencoded", None):
        assert refused(415, page.ask, *run, Content_Type=kind).error == "BadContentType"
    for origin in ("http://evil.example", "null", "https://127.0.0.1", f"ftp://{host}"):
        assert refused(403, page.ask, *run, Origin=origin).error == "WrongOrigin"
    assert refused(403, page.ask, *run, Sec_Fetch_Site="cross-site").error == "WrongOrigin"
    assert page.ask(*run, Origin=f"http://{host}", Sec_Fetch_Site="same-origin") == {"result": "ok"}
    assert page.ask(*run, Content_Type="application/json; charset=utf-8") == {"result": "ok"}
    for name in ("evil.example", "gateway.example.evil", "127.0.0.1.evil", ""):
        assert refused(421, page.ask, "GET", "/api/session", Host=name).error == "WrongHost"
    for name in ("gateway.example:80", "LOCALHOST", "192.168.7.7", "[fd00::5]:8080"):
        session = page.ask("GET", "/api/session", Host=name)
        assert session["user"] == "olga" and set(session["stops"]) == {"stop", "quick_stop", "disable"}
    assert refused(405, page.ask, "GET", "/api/call/Run").error == "WrongMethod"
    assert refused(405, page.ask, "POST", "/", {}).error == "WrongMethod"
    for path in ("/nope", "/../etc/passwd", "/%2e%2e/etc/passwd", "/page/index.html", "/api/call/Quit",
                 "//index.html", "/web.conf"):
        assert page.request("GET", path)[0] == 404

    # Every answer says what browsers are to keep to.
    for method, path in (("GET", "/"), ("GET", "/nope"), ("GET", "/api/session"), ("POST", "/api/alive")):
        _, headers, _ = page.request(method, path, "{}" if method == "POST" else None)
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy and "unsafe" not in policy and "frame-ancestors 'none'" in policy
        assert headers["X-Frame-Options"] == "DENY" and headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["Cross-Origin-Opener-Policy"] == "same-origin"
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert headers["Cache-Control"] == ("no-cache" if path == "/" else "no-store")
        assert "Access-Control-Allow-Origin" not in headers
    fresh = Page(webd)
    cookie = fresh.request("GET", "/api/session")[1]["Set-Cookie"]
    assert "HttpOnly" in cookie and "SameSite=Strict" in cookie and "Path=/" in cookie
    fresh.close()

    # A file is asked for once.
    _, headers, body = page.request("GET", "/index.html")
    status, _, empty = page.request("GET", "/", If_None_Match=headers["ETag"])
    assert body and status == 304 and empty == b""


def test_logins(gateway):
    """Wrong ones are alike and limited; sessions end by themselves, with a logout, and with the user."""
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge)
    page = gateway.page(webd)
    wrong = refused(401, page.log_in, "olga", "not her word")
    unknown = refused(401, page.log_in, "nobody", "not her word")
    assert wrong.body == unknown.body and wrong.error == "LoginFailed"
    assert refused(400, page.ask, "POST", "/api/login", {"user": "olga"}).error == "BadRequest"
    assert refused(400, page.log_in, "olga", "a\0b").error == "BadRequest"
    before = page.cookie
    assert page.log_in(*OPERATOR)["role"] == "engineer"
    assert page.cookie != before, "a login makes a new session"

    stream = page.stream("Events")
    other = Page(webd)
    other.cookie, other.token = page.cookie, page.token
    assert page.log_out()["user"] is None
    assert stream.wait(event="error")["error"] == "LoginRequired"
    stream.wait_end()
    # With the cookie as it was nothing can be had.
    assert refused(401, other.call, "Describe").error == "LoginRequired"
    other.close()

    page.log_in(*READER)
    webd.add_user(READER[0], "another word of his", "operator")
    eventually(lambda: page.load()["user"] is None, what="the old session to end")
    page.log_in(READER[0], "another word of his")
    assert page.load()["role"] == "operator"
    assert webd.command("--remove-user", READER[0]).returncode == 0
    eventually(lambda: page.load()["user"] is None, what="the removed user's session to end")
    assert refused(401, page.log_in, READER[0], "another word of his").error == "LoginFailed"
    assert (webd.users_path.stat().st_mode & 0o777) == 0o640

    page = gateway.page(webd, OPERATOR)
    try:
        for _ in range(12):
            refused(401, page.log_in, "olga", "not her word")
        raise AssertionError("attempts are not limited")
    except AssertionError as error:
        assert "429" in str(error), error
    limited = refused(429, page.log_in, *OPERATOR)
    assert limited.error == "TooManyAttempts" and limited.body["retry_s"] > 0
    assert page.call("Describe"), "who is logged in stays so"
    # The same user from elsewhere, and another user from here, are limited as well.
    assert OPERATOR[1] not in webd.log() and "not her word" not in webd.log()


@pytest.mark.parametrize("believed", [True, False])
def test_what_a_proxy_says_is_believed_of_proxies_alone(gateway, believed):
    webd = gateway.webd(server={"proxies": ["127.0.0.1"]} if believed else {})
    page = gateway.page(webd)

    def log_in(address, user, word):
        return page.ask("POST", "/api/login", {"user": user, "password": word}, X_Forwarded_For=address)

    def is_limited(address, user):
        try:
            log_in(address, user, "not the word")
        except Failed as error:
            return error.status == 429
        return False

    # Whoever tries from one address is not helped by what he says in front of what the proxy says.
    names = (f"user{number}" for number in itertools.count())
    assert any(is_limited(f"10.0.0.{number}, 10.0.1.1", next(names)) for number in range(30))
    assert is_limited("10.0.1.2", next(names)) != believed
    assert ("nobody at 10.0.1.1 through 127.0.0.1: " in webd.log()) == believed
    assert "10.0.0." not in webd.log()
    if believed:
        assert log_in("10.0.1.3", *OPERATOR)["role"] == "engineer"
    # Metrics are for the local machine.
    assert page.request("GET", "/metrics", X_Forwarded_For="10.0.1.3", Cookie="none")[0] == (401 if believed else 200)
    # What came by TLS to the proxy stays on TLS.
    page.cookie = None
    headers = page.request("GET", "/api/session", X_Forwarded_Proto="https")[1]
    assert ("Secure" in headers["Set-Cookie"]) == believed
    page.cookie = None
    assert "Secure" not in page.request("GET", "/api/session", X_Forwarded_Proto="http")[1]["Set-Cookie"]


def test_users_and_files_are_checked(gateway, tmp_path):
    webd = gateway.webd(users=())
    path = webd.users_path
    assert not path.exists(), "there is nobody as installed"
    page = gateway.page(webd)
    assert refused(401, page.log_in, *OPERATOR).error == "LoginFailed"
    for name, role, word in (("o:a", "observer", "a word long enough"), ("", "observer", "a word long enough"),
                             ("olga", "chief", "a word long enough"), ("olga", "observer", "short"),
                             ("olga", "observer", "password1234"), ("olga", "observer", "olgaolgaolga")):
        assert webd.command("--add-user", name, "--role", role, input=word + "\n").returncode != 0
    assert not path.exists()
    webd.add_user(*OPERATOR, "engineer")
    assert page.log_in(*OPERATOR)["role"] == "engineer", "no restart is needed"
    path.write_text(path.read_text() + "# a note\n\nbad line\n")
    assert f"{path}:4: " in webd.command("--check").stderr
    done = webd.command("--add-user", "rudi", "--role", "observer", input="a word long enough\n")
    assert done.returncode != 0 and "bad line" in path.read_text(), "nothing is lost"
    path.write_text("")
    path.chmod(0o644)
    assert "everybody" in webd.command("--check").stderr

    config = tmp_path / "bad.conf"
    for text, where, what in (("server {\n listen = \"here\"\n}", 2, "ADDRESS:PORT"),
                              ("server {\n key-file = \"x\"\n}", 2, "belong together"),
                              ("access {\n read = none\n}", 2, "users all"),
                              ("server {\n hosts = {\"http://a\"}\n}", 2, "no host name"),
                              ("metrics {\n allow = {\"10.0.0.0/33\"}\n}", 2, "no network"),
                              ("server {\n nope = 1\n}", 2, "unknown key")):
        config.write_text(text)
        webd.config_path = config
        done = webd.command("--check")
        assert done.returncode == 78 and f"{config}:{where}: " in done.stderr and what in done.stderr
    example = ROOT / "conf" / "web.conf"
    webd.config_path = example
    assert f"{example}:" not in webd.command("--check").stderr


# --- streams ----------------------------------------------------------------------------------------

def test_streams_and_their_ends(gateway):
    bridge = gateway.make_bridge(drives=2)
    webd = gateway.webd(bridge)
    page = gateway.page(webd, OPERATOR)
    values = page.stream("Subscribe", drives=["drive1"], names=["position"], interval_ms=0)
    page.run("drive1", "enable")
    assert page.run("drive1", "move_absolute", target_position=3200, target_velocity=SPEED) == "ok"
    values.wait(lambda data: data["samples"] and data["samples"][0]["values"]["position"] == 3200)
    trace = page.stream("Trace", bus="line", past=True)
    assert trace.wait(lambda data: any(record["kind"] == "command" for record in data["records"]))
    quiet = page.stream("Subscribe", drives=["drive1"], names=["position"], interval_ms=3600000)
    quiet.wait()
    eventually(lambda: quiet.comments >= 2, what="signs of life")

    # One more than there may be; then there is room again.
    events = [page.stream("Events") for _ in range(9)]
    assert refused(503, page.stream, "Events").error == "Busy"
    events.pop().close()

    def again():
        try:
            return page.stream("Events")
        except (Failed, ConnectionError):
            return None

    assert eventually(again, what="room for a stream").wait()


def test_the_overview_of_everybody(gateway):
    """Describes, then tells what changes; goes on when the service was away; made once for all."""
    bridge = gateway.make_bridge(drives=3)
    webd = gateway.webd(bridge)
    pages = [gateway.page(webd, READER) for _ in range(3)]
    streams = [page.stream("overview") for page in pages]
    for stream in streams:
        told = stream.wait(event="service")
        assert told["up"] is True and sorted(told["stops"]) == ["disable", "quick_stop", "stop"]
        assert [drive["name"] for drive in stream.wait(lambda one: "describe" in one)["describe"]["drives"]] == \
            ["drive1", "drive2", "drive3"]
        first = stream.wait(lambda one: "samples" in one)
        assert {one["drive"] for one in first["samples"]} == {"drive1", "drive2", "drive3"}
        assert stream.wait(lambda one: "figures" in one)["figures"]["line"]["up"] == 1
    operator = gateway.page(webd, OPERATOR)
    operator.run("drive2", "enable")
    seen = streams[0].count()
    operator.run("drive2", "move_absolute", target_position=6400, target_velocity=SPEED)
    for stream in streams:
        stream.wait(lambda one: any(sample["drive"] == "drive2" and sample["values"]["position"] == 6400
                                    for sample in one.get("samples", [])))
    # The drives that stand are not told each time.
    told = [sample["drive"] for _, data in streams[0].events[seen:] for sample in data.get("samples", [])]
    assert told.count("drive2") > 2 * told.count("drive1")
    assert webd.log_path.exists() and "Subscribe" not in webd.log()

    seen = [stream.count() for stream in streams]
    bridge.process.kill()
    bridge.process.wait()
    bridge.units = {}
    for stream, since in zip(streams, seen):
        assert stream.wait(event="service", since=since)["up"] is False
    assert pages[0].load()["service"] is False
    seen = [stream.count() for stream in streams]
    bridge.start_bridge()
    for stream, since in zip(streams, seen):
        assert stream.wait(event="service", since=since)["up"] is True
        stream.wait(lambda one: "describe" in one, since=since)
        stream.wait(lambda one: "samples" in one, since=since)


def test_slow_readers_take_no_memory(gateway):
    """Who takes nothing gets fewer, and is dropped in the end; the others notice nothing."""
    bridge = gateway.make_bridge(drives=4)
    webd = gateway.webd(bridge)
    page = gateway.page(webd, READER)
    good = page.stream("overview")
    good.wait(lambda one: "samples" in one)
    slow = []
    for method, parameters in (("overview", {}), ("Trace", {"bus": "line", "past": True}),
                               ("Subscribe", {"drives": [], "names": [], "interval_ms": 0})) * 2:
        link = socket.socket()
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        link.connect(webd.address)
        body = json.dumps(parameters)
        head = "".join(f"{key}: {value}\r\n" for key, value in page.headers().items())
        link.sendall(f"POST /api/stream/{method} HTTP/1.1\r\nHost: {webd.address[0]}\r\n{head}"
                     f"Content-Length: {len(body)}\r\n\r\n{body}".encode())
        assert link.recv(12) == b"HTTP/1.1 200"
        slow.append(link)
    before = memory_kib(webd.process)
    seen = good.count()
    eventually(lambda: good.count() > seen + 16, 30, "the others to get theirs")
    grown = memory_kib(webd.process) - before
    assert grown < 8192, grown
    # Of the overview there is less to take while all drives stand: those may stay for longer.
    eventually(lambda: re.search(rb"web_streams [1-3]\n", page.request("GET", "/metrics")[2]), 60,
               "those that take nothing to be dropped")
    for link in slow:
        link.close()


# --- the dead man's rule ----------------------------------------------------------------------------

def moving(bridge, target="drive1"):
    return bridge.sim.get(target)["velocity"] != 0


def jogging(gateway, bridge, webd=None, **options):
    """A page that holds a button, and the drive moves."""
    webd = webd or gateway.webd(bridge)
    page = gateway.page(webd, OPERATOR, **options)
    page.run("drive1", "enable")
    grip = page.hold("drive1", SPEED)
    eventually(lambda: moving(bridge), what="the drive to move")
    return webd, page, grip


def stands(bridge, within=5.0):
    eventually(lambda: not moving(bridge), within, "the drive to stand")


def orders(bridge):
    """What the drive was told to do, with the time in seconds of the clock that does not jump."""
    found = []
    for line in bridge.sim.trace_path.read_text(encoding="utf-8").splitlines():
        match = re.match(r"(\d+) line > .*\|\d+ (mov|pos|rmv|stp|dcm|ena|off)\b", line)
        if match:
            found.append((int(match[1]) / 1e6, match[2]))
    return found


def test_a_jog_moves_while_the_button_is_held(gateway):
    bridge = gateway.make_bridge(drive={"watchdog-ms": 500})
    webd, page, grip = jogging(gateway, bridge)
    # Longer than the watchdog's time: that is fed.
    began = bridge.sim.get()["position"]
    eventually(lambda: bridge.sim.get()["position"] > began + 2 * SPEED)
    assert all(answer["held"] and answer["why"] == "" for answer in grip.answers)
    assert grip.last("result") == "ok"
    assert grip.let_go() == {"held": False, "why": "released", "text": "", "result": "ok"}
    stands(bridge)
    # Nothing of this grip moves anything again: late, doubled, or with a higher number.
    place = bridge.sim.get()["position"]
    told = len(orders(bridge))
    for beat in (grip.beats, grip.beats + 1, grip.beats + 2, grip.beats + 100):
        assert page.beat("drive1", grip.number, beat, SPEED)["held"] is False
    assert page.beat("drive1", grip.number, grip.beats + 101, -SPEED)["why"] == "released"
    # Back, at another speed while it is held.
    back = page.hold("drive1", -SPEED)
    eventually(lambda: bridge.sim.get()["position"] < place, what="the drive to move back")
    assert len([what for _, what in orders(bridge)[told:] if what == "mov"]) == 1, "by its own grip alone"
    back.velocity = -SPEED / 4
    eventually(lambda: abs(bridge.sim.get()["velocity"]) <= SPEED / 4 + 1, what="it to slow down")
    assert moving(bridge)
    # An older grip's beat does not disturb.
    assert page.beat("drive1", grip.number, 999, SPEED)["held"] is False
    assert moving(bridge)
    back.let_go()
    stands(bridge)
    assert bridge.drive().read("axis_state") != 7
    log = webd.log()
    assert "olga at 127.0.0.1: jog of drive1 begins at 3200" in log
    assert "olga at 127.0.0.1: jog of drive1 ended: released" in log
    for wrong in ({"drive": "drive1", "grip": 0, "beat": 1, "velocity": 1},
                  {"drive": "drive1", "grip": 9, "beat": 1, "velocity": "fast"},
                  {"drive": "drive1", "grip": "9", "beat": 1, "velocity": 1}, {"grip": 9}):
        assert refused(400, page.ask, "POST", "/api/jog", wrong).error == "BadRequest"
    assert not moving(bridge)


@pytest.mark.parametrize("how", ["beats", "connection", "doubled"])
def test_missing_beats_stop_the_drive(gateway, how):
    """300 ms behind the last one, by the server's clock; the drive stands within half a second."""
    bridge = gateway.make_bridge(drive={"watchdog-ms": 3000})
    webd, page, grip = jogging(gateway, bridge)
    grip.vanish()
    last = time.monotonic()
    if how == "connection":
        grip.page.close()
        page.close()
    elif how == "doubled":
        # The same beat again and again, as a broken proxy might send it, keeps nothing moving.
        while moving(bridge) and time.monotonic() - last < 3:
            page.beat("drive1", grip.number, grip.beats, SPEED)
    stands(bridge, 3.0)
    stopped = [when for when, what in orders(bridge) if what == "stp" and when > last - 0.05]
    assert stopped and 0.15 < stopped[0] - last < 0.5, (stopped, last)
    # The service has the same rule, and may have been the first.
    webd.wait_for_log("jog of drive1 ended: late")
    assert "watchdog" not in bridge.log_path.read_text(), "it was not needed"
    page = gateway.page(webd, OPERATOR, tab=page.tab)
    assert b"drivebridge_web_late_jogs_total 1" in page.request("GET", "/metrics")[2]


def test_whatever_else_ends_a_grip(gateway):
    bridge = gateway.make_bridge(drive={"watchdog-ms": 3000, "max-velocity": 5000.0})
    webd, page, grip = jogging(gateway, bridge)
    # The stop of this page.
    assert page.run("drive1", "stop") == "ok"
    stands(bridge)
    eventually(lambda: grip.last("why") == "stopped")
    assert not moving(bridge)
    grip.vanish()
    # Somebody else's.
    grip = page.hold("drive1", SPEED)
    eventually(lambda: moving(bridge) and page.call("Read", drive="drive1", names=["velocity"])["values"]["velocity"])
    bridge.drive().command("stop")
    stands(bridge)
    eventually(lambda: grip.last("why") == "stopped")
    grip.velocity = SPEED / 2
    seen = len(grip.answers)
    eventually(lambda: len(grip.answers) > seen + 3)
    assert not moving(bridge)
    grip.vanish()
    # Too fast from the start, and while it moves.
    grip = page.hold("drive1", 6000.0)
    eventually(lambda: grip.last("why") == "refused")
    assert "limit" in grip.last("text") and grip.last("result") == "limit"
    grip.vanish()
    grip = page.hold("drive1", SPEED)
    eventually(lambda: moving(bridge))
    grip.velocity = 6000.0
    eventually(lambda: grip.last("why") == "refused")
    stands(bridge)
    grip.vanish()
    # Every drive's stop.
    grip = page.hold("drive1", SPEED)
    eventually(lambda: moving(bridge))
    assert page.call("Write", drive="", values={"group_stop": 1})["result"] in ("ok", "pending")
    stands(bridge)
    eventually(lambda: grip.last("why") == "stopped")
    grip.vanish()
    # Logged out by another session of the same user; it is told of no other user's, and ends none.
    reader = gateway.page(webd, READER)
    grip = page.hold("drive1", SPEED)
    eventually(lambda: moving(bridge))
    sessions = page.ask("POST", "/api/sessions", {})["sessions"]
    assert [(one["from"], one["own"]) for one in sessions] == [("127.0.0.1", True)]
    number = sessions[0]["number"]
    assert refused(409, page.ask, "POST", "/api/sessions/end", {"number": number}).error == "NoSuchSession"
    assert refused(409, reader.ask, "POST", "/api/sessions/end", {"number": number}).error == "NoSuchSession"
    assert refused(400, page.ask, "POST", "/api/sessions/end", {}).error == "BadRequest"
    assert refused(400, page.ask, "POST", "/api/sessions/end", {"number": number, "others": True}).error == "BadRequest"
    assert moving(bridge)
    other = gateway.page(webd, OPERATOR)
    assert [one["own"] for one in other.ask("POST", "/api/sessions", {})["sessions"]] == [False, True]
    assert len(other.ask("POST", "/api/sessions/end", {"number": number})["sessions"]) == 1
    stands(bridge, 2.0)
    eventually(lambda: isinstance(grip.answers[-1], Failed))
    grip.vanish()
    assert page.load()["user"] is None and reader.load()["user"] == READER[0]
    assert "olga at 127.0.0.1: logged out another session, from 127.0.0.1" in webd.log()
    page.log_in(*OPERATOR)
    assert len(other.ask("POST", "/api/sessions/end", {"others": True})["sessions"]) == 1
    assert page.load()["user"] is None and reader.load()["user"] == READER[0]
    page.log_in(*OPERATOR)
    # Logging out.
    grip = page.hold("drive1", SPEED)
    eventually(lambda: moving(bridge))
    page.log_out()
    stands(bridge, 2.0)
    assert "jog of drive1 ended: logout" in webd.log()
    eventually(lambda: isinstance(grip.answers[-1], Failed))
    grip.vanish()


def test_a_call_comes_once_and_not_behind_a_stop_that_was_pressed_later(gateway):
    """A browser sends a call again by itself when its connection breaks, and calls overtake each other on the way."""
    bridge = gateway.make_bridge(drives=2)
    webd = gateway.webd(bridge)
    page = gateway.page(webd, OPERATOR)
    step = {"drive": "drive1", "command": "move_relative",
            "arguments": {"target_position": 100, "target_velocity": SPEED}}
    page.run("drive1", "enable")
    began = bridge.sim.get()["position"]

    def run(number, parameters):
        return page.ask("POST", "/api/call/Run", parameters, X_Call=str(number))

    def beat(number, velocity, of=page):
        return of.ask("POST", "/api/jog", {"drive": "drive1", "grip": 1, "beat": number, "velocity": velocity,
                                           "token": of.newest_token()}, X_Call=str(number))

    assert run(1001, step)["result"] in ("ok", "pending")
    assert refused(409, run, 1001, step).error == "Repeated"
    eventually(lambda: bridge.sim.get()["position"] == began + 100)
    bridge.wait_standing()
    told = len(orders(bridge))
    assert run(1004, {"drive": "drive1", "command": "stop"})["result"] == "ok"
    assert refused(409, run, 1002, step).error == "Overtaken"
    assert beat(1003, SPEED) == {"held": False, "why": "stopped", "text": "", "result": ""}
    # So it is when the stop is the first that comes of a page at all.
    fresh = gateway.page(webd, OPERATOR)
    assert fresh.ask("POST", "/api/call/Run", {"drive": "drive1", "command": "stop"}, X_Call="7")["result"] == "ok"
    assert beat(6, SPEED, fresh)["why"] == "stopped"
    assert {what for _, what in orders(bridge)[told:]} == {"stp"}
    assert bridge.sim.get()["position"] == began + 100
    # What is pressed behind the stop moves; letting go is never too late.
    assert beat(1005, SPEED)["held"]
    eventually(lambda: moving(bridge))
    assert run(1007, {"drive": "drive2", "command": "stop"})["result"] == "ok"
    assert beat(1006, 0)["why"] == "released"
    stands(bridge)
    for wrong in (None, "", "0", "01", "-1", "one", "1000000000000000"):
        assert refused(400, page.ask, "POST", "/api/call/Run", step, X_Call=wrong).error == "BadRequest"


def test_a_stop_waits_for_no_other(gateway):
    """A drive that is silent does not confirm its stop. Another one is stopped meanwhile, by each button of any page and
    by letting go, and moves again."""
    bridge = gateway.make_bridge(drives=3, drive={"watchdog-ms": 0})
    webd = gateway.webd(bridge)
    page, other = gateway.page(webd, OPERATOR), gateway.page(webd, OPERATOR)
    for drive in "drive1", "drive2", "drive3":
        page.run(drive, "enable")
    waiting = []

    def press(who, drive, command):
        beside = who.beside()
        gateway.pages.append(beside)

        def run():
            # That it is not confirmed in time is not the question here.
            with contextlib.suppress(Failed):
                beside.run(drive, command)

        waiting.append(threading.Thread(target=run))
        waiting[-1].start()

    for drive in "drive1", "drive2":
        bridge.sim.fault("silence on", drive)
    # As many as there are places, and one more.
    for drive, command in itertools.product(("drive1", "drive2"), ("stop", "quick_stop", "disable")):
        for who in page, other:
            press(who, drive, command)
    for who, command in (page, "stop"), (other, "quick_stop"), (page, "disable"):
        assert page.run("drive3", "enable") == "ok"
        assert page.run("drive3", "move_velocity", target_velocity=SPEED) == "ok"
        eventually(lambda: moving(bridge, "drive3"))
        assert who.run("drive3", command) in ("ok", "pending")
        eventually(lambda: not moving(bridge, "drive3"))
    page.run("drive3", "enable")
    grip = page.hold("drive3", SPEED)
    eventually(lambda: moving(bridge, "drive3"))
    grip.let_go()
    eventually(lambda: not moving(bridge, "drive3"))
    for drive in "drive1", "drive2":
        bridge.sim.fault("silence off", drive)
    for one in waiting:
        one.join(30)


def test_a_press_on_the_next_drive_waits_for_the_stop_of_the_one_before(gateway):
    """And a press that was let go meanwhile moves nothing, whatever of it comes later."""
    bridge = gateway.make_bridge(drives=2, drive={"watchdog-ms": 0})
    webd = gateway.webd(bridge)
    page = gateway.page(webd, OPERATOR)
    for drive in "drive1", "drive2":
        page.run(drive, "enable")
    token = page.newest_token
    assert page.beat("drive1", 1, 1, SPEED)["held"]
    eventually(lambda: moving(bridge))
    bridge.sim.fault("silence on", "drive1")
    assert page.beat("drive1", 1, 2, 0)["why"] == "released"
    waits = page.beat("drive2", 2, 1, SPEED)
    assert (waits["held"], waits["why"], waits["text"]) == (False, "waiting", "drive1 is still being stopped")
    assert page.beat("drive2", 2, 2, 0)["why"] == "released"
    assert page.beat("drive2", 3, 1, SPEED)["why"] == "waiting"
    # A newer press, so the one before is over although its release is lost.
    assert page.beat("drive2", 4, 1, SPEED)["why"] == "waiting"
    # A stop of the drive that waits, or of all, ends the press before it has begun.
    page.run("drive2", "stop")
    assert page.beat("drive2", 4, 2, SPEED)["why"] == "stopped"
    assert page.beat("drive2", 5, 1, SPEED)["why"] == "waiting"
    # drive1 does not confirm it.
    with pytest.raises(Failed):
        page.call("Write", drive="", values={"group_stop": 1})
    assert page.beat("drive2", 5, 2, SPEED)["why"] == "stopped"
    bridge.sim.fault("silence off", "drive1")
    told = len(orders(bridge))
    eventually(lambda: not moving(bridge), what="drive1 to stand")
    for grip in 4, 5:
        assert page.beat("drive2", grip, 9, SPEED, token())["why"] in ("released", "stopped")
    assert {what for _, what in orders(bridge)[told:]} <= {"stp"} and not moving(bridge, "drive2")
    numbers = itertools.count(2)
    eventually(lambda: page.beat("drive2", 6, next(numbers), SPEED)["held"])
    eventually(lambda: moving(bridge, "drive2"))
    page.beat("drive2", 6, next(numbers), 0)
    eventually(lambda: not moving(bridge, "drive2"))
    told = len(orders(bridge))
    for grip, beat in (2, 1), (2, 3), (3, 2), (4, 2):
        assert page.beat("drive2", grip, beat, SPEED, token())["why"] == "released"
    assert {what for _, what in orders(bridge)[told:]} <= {"stp"}
    assert not moving(bridge, "drive2")


def test_when_programs_end_while_a_button_is_held(gateway):
    """SIGTERM stops the drive first; so does on-exit when the service goes."""
    bridge = gateway.make_bridge(drive={"watchdog-ms": 600})
    webd, _, grip = jogging(gateway, bridge)
    assert webd.stop() == 0
    stands(bridge, 0.5)
    assert "ended: ending" in webd.log()
    grip.vanish()
    assert "watchdog" not in bridge.log_path.read_text()

    webd, page, grip = jogging(gateway, bridge)
    bridge.process.send_signal(signal.SIGTERM)
    assert bridge.process.wait(10) == 0
    stands(bridge)
    eventually(lambda: grip.last("why") in (None, "lost"))
    grip.vanish()
    bridge.units = {}
    bridge.start_bridge()
    eventually(lambda: page.load()["service"])
    assert not moving(bridge), "nothing moves by itself when the service is there again"


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_server_that_runs_no_more_holds_nothing(gateway, how):
    """The rule that stops a held motion is the service's as well, whatever the watchdog says."""
    bridge = gateway.make_bridge(drive={"watchdog-ms": 0})
    webd, page, grip = jogging(gateway, bridge)
    since = time.monotonic()
    webd.process.send_signal(how)
    stands(bridge)
    stopped = next(when for when, what in orders(bridge) if what == "stp" and when > since)
    print(f"{how.name}: the stop was on the wire after {stopped - since:.3f} s")
    assert stopped - since < 1.5
    bridge.told("the motion that it held is stopped")
    told = orders(bridge)
    if how == signal.SIGKILL:
        webd.process.wait(10)
    else:
        # What waited in it meanwhile moves nothing.
        webd.process.send_signal(signal.SIGCONT)
        eventually(lambda: grip.last("held") is False or isinstance(grip.answers[-1], Exception))
        assert page.load()["service"]
    grip.vanish()
    assert [what for _, what in orders(bridge)[len(told):] if what != "stp"] == []
    assert bridge.drive().read("watchdog_trips") == 0


def test_a_slow_drive_is_held_as_well(gateway):
    """It confirms a motion later than the dead man's time; beats do not wait for that, nor behind what asks how it is."""
    bridge = gateway.make_bridge(bus={"drive-latency-ms": 900}, sim_bus={"latency-us": 300000})
    webd, page, grip = jogging(gateway, bridge)
    began = time.monotonic()
    eventually(lambda: time.monotonic() - began > 2.5 or not moving(bridge))
    held = [what for _, what in orders(bridge) if what in ("mov", "stp")]
    if grip.last("why") != "late":  # which would be the machine's
        assert held == ["mov"] and moving(bridge), webd.log()
        assert "the motion that it held" not in bridge.log_since(0)
    grip.let_go()
    stands(bridge)


def beat_request(page, token):
    """The first beat of a press, as it stands on the wire."""
    body = json.dumps({"drive": "drive1", "grip": 1, "beat": 1, "velocity": SPEED, "token": token})
    head = "".join(f"{key}: {value}\r\n" for key, value in page.headers().items())
    return (f"POST /api/jog HTTP/1.1\r\nHost: {page.webd.address[0]}\r\n{head}"
            f"Content-Length: {len(body)}\r\n\r\n{body}").encode()


@pytest.mark.parametrize("late", [0.0, 0.5, 2.0, 5.0])
def test_a_first_beat_that_was_long_on_its_way_moves_nothing(gateway, late):
    """A hole in a wireless network, or a proxy that buffers, delivers it when nobody holds the button any more."""
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge)
    webd.host, webd.port = webd.address  # for a Relay
    page = gateway.page(webd, OPERATOR)
    page.run("drive1", "enable")
    with Relay(webd) as line, socket.create_connection(("127.0.0.1", line.port)) as link:
        request = beat_request(page, page.newest_token())
        if late > 0:
            line.hold()
        began = time.monotonic()
        link.sendall(request)
        eventually(lambda: time.monotonic() - began >= late)
        line.go_on()
        answer = json.loads(re.search(rb"\r\n\r\n(.*)", link.recv(4096), re.DOTALL)[1])
        if late == 0:
            eventually(lambda: "mov" in [what for _, what in orders(bridge)], what="what is in time to move it")
            return
    # It is over, and so is what comes of this press in time.
    assert answer["held"] is False and answer["why"] == "old"
    said = float(re.fullmatch(r"came (\S+) s late and was not carried out", answer["text"])[1])
    assert said >= late - 0.05
    assert page.beat("drive1", 1, 2, SPEED)["held"] is False
    webd.wait_for_log(f"olga at 127.0.0.1: a jog of drive1 {answer['text']}")
    assert "mov" not in [what for _, what in orders(bridge)] and bridge.sim.get()["position"] == 0


def test_what_starts_a_motion_is_refused_when_it_comes_late(gateway):
    bridge = gateway.make_bridge()
    page = gateway.page(gateway.webd(bridge), OPERATOR)
    page.run("drive1", "enable")
    old = page.newest_token()
    began = time.monotonic()
    eventually(lambda: time.monotonic() - began > 0.6)
    step = {"drive": "drive1", "command": "move_relative",
            "arguments": {"target_position": 100, "target_velocity": SPEED}}
    late = refused(409, page.call, "Run", **step, token=old)
    assert late.error == "TooOld" and late.body["parameters"]["age_ms"] >= 600
    assert re.fullmatch(r"came 0\.\d s late and was not carried out|came \S+ s late .*", late.text)
    unknown = refused(409, page.call, "Run", **step, token="00000000-1")
    assert unknown.text == "came too late and was not carried out"
    write = {"drive": "drive1", "values": {"command": code("command", "move_relative"), "target_position": 100}}
    assert refused(409, page.call, "Write", **write, token=old).error == "TooOld"
    # A stop is never too late, nor is what moves nothing.
    assert page.call("Run", drive="drive1", command="stop", token=old)["result"] == "ok"
    assert page.call("Write", drive="drive1", values={"target_velocity": 5.0}, token=old) == {"result": "ok"}
    assert bridge.sim.get()["position"] == 0
    assert page.call("Run", **step, token=page.newest_token())["result"] == "ok"
    eventually(lambda: bridge.sim.get()["position"] == 100)


def test_pages_and_a_plc_compete(gateway):
    """Control is claimed by each page for itself, and a PLC's is respected; a stop is always taken."""
    bridge = gateway.make_bridge(modbus={"control": "drive", "control-timeout-ms": 5000,
                                         "allow-write": ["127.0.0.0/8"]})
    webd = gateway.webd(bridge)
    one, other = gateway.page(webd, OPERATOR), gateway.page(webd, OPERATOR)
    plc = bridge.drive()
    plc.settle("enable")
    assert refused(403, one.run, "drive1", "move_relative", target_position=10, target_velocity=100.0).error == \
        "NotAllowed"
    answer = one.beat("drive1", 1, 1, SPEED)
    eventually(lambda: one.beat("drive1", 1, 2, SPEED)["why"] == "refused")
    assert answer["held"] and not moving(bridge)
    assert one.run("drive1", "stop") == "ok"
    plc.write("control_request", 0)
    one.grip = 1
    grip = one.hold("drive1", SPEED)
    eventually(lambda: moving(bridge))
    assert refused(403, other.run, "drive1", "enable").error == "NotAllowed"
    assert other.run("drive1", "stop") == "ok"
    stands(bridge)
    grip.vanish()
    # What a page holds it lets go of when it is gone.
    one.close()

    def take_over():
        try:
            return other.run("drive1", "enable") == "ok"
        except Failed:
            return False

    eventually(take_over, 20, "the other page to get control")


def test_a_page_that_acts_lives_by_saying_so(gateway):
    """A long motion goes on while its page is there, and is stopped by the watchdog when that is gone."""
    bridge = gateway.make_bridge(drive={"watchdog-ms": 1000}, sim_drive={"set": ["spd=6400", "acc=64000",
                                                                                  "dec=64000", "pae=1"]})
    webd = gateway.webd(bridge)
    page = gateway.page(webd, OPERATOR)
    page.run("drive1", "enable")
    page.run("drive1", "move_relative", target_position=1000000, target_velocity=SPEED)
    began = time.monotonic()
    while time.monotonic() - began < 6.5:
        assert page.alive()["acting"] is True
        assert moving(bridge)
        time.sleep(0.5)
    stands(bridge, 15.0)
    bridge.told("watchdog")
    # Too many pages that act; one that is gone makes room.
    pages = [gateway.page(webd, OPERATOR) for _ in range(5)]
    for one in pages:
        one.call("Write", drive="drive1", values={"target_velocity": 5.0})
    late = gateway.page(webd, OPERATOR)
    assert refused(503, late.call, "Write", drive="drive1", values={"target_velocity": 5.0}).error == "Busy"
    assert late.run("drive1", "stop") == "ok", "a stop needs no room"
    pages[0].log_out()
    assert late.call("Write", drive="drive1", values={"target_velocity": 5.0}) == {"result": "ok"}


def test_what_a_page_has_taken_is_its_own_until_it_lets_go(gateway):
    """Control, and a drive that it has moved and that stands: neither needs another command."""
    bridge = gateway.make_bridge(modbus={"control": "drive", "control-timeout-ms": 300},
                                 drive={"watchdog-ms": 700})
    page = gateway.page(gateway.webd(bridge), OPERATOR)
    drive = bridge.drive()
    page.run("drive1", "enable")
    page.run("drive1", "move_relative", target_position=10, target_velocity=SPEED)
    page.call("Write", drive="drive1", values={"control_request": 1})
    # Longer than what was written counts as a command that may move something.
    began = time.monotonic()
    while time.monotonic() - began < 4.5:
        assert drive.read("control_port") != 0
        page.alive()
        time.sleep(0.1)
    assert drive.read("watchdog_trips") == 0
    page.call("Write", drive="drive1", values={"control_request": 0})
    eventually(lambda: drive.read("control_port") == 0)


def test_nobody_knows_the_end_of_a_command_that_is_lost(gateway):
    """The service breaks while it is carried out: it may have been done, and whoever commands it again is to know that."""
    bridge = gateway.make_bridge()
    page = gateway.page(gateway.webd(bridge), OPERATOR)
    page.run("drive1", "enable")
    end = threading.Thread(target=lambda: eventually(lambda: moving(bridge)) and bridge.process.kill())
    end.start()
    answer = refused(502, page.call, "Run", drive="drive1", command="move_relative", until_end=True,
                     arguments={"target_position": 9600, "target_velocity": SPEED})
    end.join()
    bridge.process.wait()
    bridge.units = {}
    bridge.start_bridge()
    assert answer.error == "ServiceUnreachable" and "whether it was carried out is not known" in answer.text


def test_the_history_names_who_is_logged_in(gateway):
    """Beside the server's own user; also of a stop by somebody who has no page that acts, and of a hand on the button. Control is
    that user's."""
    bridge = gateway.make_bridge(modbus={"control": "drive"})
    webd = gateway.webd(bridge, users=((*OPERATOR, "operator"), ("otto", "otto's own word", "operator")))
    olga, drive = gateway.page(webd, OPERATOR), bridge.drive()

    def newest(command, user):
        given = [drive.read(f"history1_{what}") for what in ("command", "address", "user")]
        return given == [code("command", command), "control, user root", user]

    olga.run("drive1", "enable")
    assert newest("enable", "olga") and drive.read("control_user") == "olga"
    # No page of his acts: over the connection that all share for stops.
    for _ in range(2):
        otto = gateway.page(webd, ("otto", "otto's own word"))
        otto.tab = None
        assert otto.run("drive1", "stop") == "ok"
        assert newest("stop", "otto")
        assert olga.run("drive1", "stop") == "ok"
        assert newest("stop", "olga")
    otto = gateway.page(webd, ("otto", "otto's own word"))
    assert refused(403, otto.run, "drive1", "enable").error == "NotAllowed"
    held = olga.hold("drive1", SPEED)
    eventually(lambda: newest("move_velocity", "olga"))
    held.let_go()
    eventually(lambda: newest("stop", "olga"))
    eventually(lambda: "client control, user root for olga: connected" in bridge.log_since(0))
    said = subprocess.run([find_program("drivebridgectl"), "--socket", bridge.control_path, "history", "drive1"],
                          capture_output=True, text=True, timeout=20, check=True).stdout
    assert re.fullmatch(r"\S+ \S+ +stop +ok .* control, user root for olga *", said.splitlines()[1])


# --- what the network sends -------------------------------------------------------------------------

def test_malformed_and_too_much(gateway):
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge)
    page = gateway.page(webd, OPERATOR)
    for body in ("", "[]", "{", "{}}", "\0", '{"a":1,"a":2}', "[" * 8000, '{"drive":"\ud800"}'.encode("utf-8", "surrogatepass"),
                 "nul", '{"a":1e999}'):
        status, _, data = page.request("POST", "/api/call/Read", body)
        assert status in (200, 400), (body, data)

    def told(*arguments, **headers):
        """The status, unless the connection was closed before everything was sent."""
        try:
            return page.request(*arguments, **headers)[0]
        except (OSError, http.client.HTTPException):
            return "closed"

    assert told("POST", "/api/call/Read", "x" * 16385) in (413, "closed")
    assert told("POST", "/api/call/Read", iter([b"x" * 9000, b"y" * 9000]),
                Transfer_Encoding="chunked") in (400, 413, "closed")
    assert told("GET", "/" + "a" * 30000) in (404, 414, 431, "closed")
    assert told("GET", "/", X_Long="b" * 30000) in (413, 431, "closed")
    for raw in (b"", b"\r\n\r\n", b"GET / HTTP/1.1\r\n\r\n", b"GET /\r\n\r\n", b"\x16\x03\x01\x02\x00\x01\x00",
                b"POST /api/jog HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: -5\r\n\r\n",
                b"POST /api/jog HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 99999999999999999999\r\n\r\n",
                b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: evil\r\nCookie: drivebridge=" + b"n" * 900 + b"\r\n\r\n"):
        with socket.create_connection(webd.address) as link:
            link.sendall(raw)
            link.shutdown(socket.SHUT_WR)
            link.settimeout(0.3)
            try:
                while link.recv(65536):
                    pass
            except TimeoutError:
                pass
    assert page.call("Describe")["drives"]


def test_many_connections(gateway):
    """Bounded, for each address too; who has one is served all the while, and the drive can be stopped."""
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge, server={"connections": 64, "connections-per-address": 40})
    page = gateway.page(webd, OPERATOR)
    links = []

    def count():
        return int(re.search(rb"web_connections (\d+)", page.request("GET", "/metrics")[2])[1])

    def come(address):
        link = socket.create_connection(webd.address, 20, source_address=(address, 0))
        links.append(link)
        link.sendall(b"GET /nothing HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert link.recv(4096)

    for number in range(45):
        come("127.0.0.2")
    eventually(lambda: count() == 41, what="forty of one address")
    for number in range(30):
        come("127.0.0.3")
    eventually(lambda: count() == 49, what="three quarters, and who is logged in")
    assert page.call("Describe")["drives"]
    assert page.run("drive1", "stop") == "ok"
    # Of those that say nothing there are fewer still; all that say nothing more, or begin to say something, are closed.
    for number in range(20):
        links.append(socket.create_connection(webd.address, 20, source_address=(f"127.0.0.{4 + number}", 0)))
    assert page.run("drive1", "stop") == "ok"
    eventually(lambda: count() <= 49 + 16, what="the silent ones to be few")
    for link in links[-4:]:
        with contextlib.suppress(OSError):
            link.sendall(b"GET / HTTP")
    eventually(lambda: count() == 1, 30, "the connections to be gone")
    for link in links:
        link.close()


class HalfRequests:
    """So many connections from eight addresses that never come to the end of a head, a byte each now and then; where one is
    closed another one comes at once."""

    def __init__(self, webd, count):
        self.webd = webd
        self.links = [None] * count
        self.going = True
        self.thread = threading.Thread(target=self._go_on, daemon=True)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *unused):
        self.going = False
        self.thread.join(20)
        for link in self.links:
            if link:
                link.close()

    def _begin(self, number):
        link = socket.create_connection(self.webd.address, 20, (f"127.0.0.{2 + number % 8}", 0))
        link.sendall(b"GET / HTTP/1.1\r\nX-Slow: ")
        return link

    def _go_on(self):
        while self.going:
            for number, link in enumerate(self.links):
                try:
                    if link:
                        link.sendall(b"x")
                    else:
                        self.links[number] = self._begin(number)
                except OSError:
                    if link:
                        link.close()
                    self.links[number] = None
            time.sleep(0.1)

    def there(self):
        return all(self.links)


def test_half_requests_keep_nobody_out(gateway):
    """Who has not sent a whole head gives way to the next one: a stop over a new connection waits for none of them, nor does
    whoever has not logged in yet."""
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge, server={"connections": 64, "connections-per-address": 32})
    page = gateway.page(webd, OPERATOR)
    page.run("drive1", "enable")

    def time_stop():
        beside = page.beside()
        began = time.monotonic()
        assert beside.run("drive1", "stop") == "ok"
        took = time.monotonic() - began
        beside.close()
        return took

    alone = [time_stop() for _ in range(9)]
    with HalfRequests(webd, 100) as attack:
        eventually(attack.there, what="each of them to have been there")
        beside = [time_stop() for _ in range(9)]
        assert gateway.page(webd).load()["service"]
        print(f"a stop took {sorted(alone)[4]:.4f} s alone, {sorted(beside)[4]:.4f} s beside them")
        # In the middle, because either may have met a moment of a busy machine.
        assert sorted(beside)[4] < max(1.5 * sorted(alone)[4], sorted(alone)[-1]) + 0.02, (alone, beside)
        # Who is at it all the while is not disturbed.
        stream = page.stream("overview")
        seen = stream.wait(lambda one: "samples" in one) and stream.count()
        eventually(lambda: stream.count() > seen + 5, what="the stream to go on")
    eventually(lambda: b"web_connections 2\n" in page.request("GET", "/metrics")[2], 20, "them to be gone")


def test_ends_while_streams_are_suspended(gateway):
    """The library aborts when it is stopped with a connection that is suspended."""
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge)
    page = gateway.page(webd, OPERATOR)
    streams = [page.stream("overview"), page.stream("Events"),
               page.stream("Subscribe", drives=["drive1"], names=["position"], interval_ms=3600000)]
    for stream in streams:
        stream.wait(event="service" if stream is streams[0] else None)
    bridge.process.send_signal(signal.SIGSTOP)
    try:
        waiting = threading.Thread(target=lambda: refused(503, gateway.page(webd, OPERATOR).call, "Describe"))
        waiting.start()
        eventually(lambda: webd.log().count("logged in") == 2)
        time.sleep(0.2)
        assert webd.stop() == 0
        waiting.join(10)
    finally:
        bridge.process.send_signal(signal.SIGCONT)
    for stream in streams:
        assert stream.wait_end()[0] == "error"


def test_tls(gateway, tmp_path):
    import ssl
    subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1",
                    "-nodes", "-keyout", "key.pem", "-out", "cert.pem", "-days", "2", "-subj", "/CN=gw",
                    "-addext", "subjectAltName=IP:127.0.0.1"], cwd=tmp_path, check=True, capture_output=True)
    (tmp_path / "key.pem").chmod(0o640)
    bridge = gateway.make_bridge()
    trusted = ssl.create_default_context(cafile=tmp_path / "cert.pem")
    place = tmp_path / "tls"
    place.mkdir()
    webd = Webd(place, bridge, server={"certificate-file": tmp_path / "cert.pem",
                                       "key-file": tmp_path / "key.pem"}).start()
    gateway.webds.append(webd)
    assert webd.url.startswith("https://")
    page = Page(webd)
    page.connect = lambda: http.client.HTTPSConnection(*webd.address, timeout=30, context=trusted)
    gateway.pages.append(page)
    eventually(lambda: page.load()["service"])
    page.log_in(*OPERATOR)
    assert page.cookie.startswith("__Host-drivebridge=")
    assert page.call("Describe")["drives"]
    stream = page.stream("overview")
    assert stream.wait(lambda one: "samples" in one)
    (tmp_path / "key.pem").chmod(0o644)
    assert "everybody" in webd.command("--check").stderr


def test_a_trace_has_the_words_and_the_file_of_drivebridgectl(gateway):
    """The same kept seconds, from the page's server and from the command."""
    bridge = gateway.make_bridge(bus={"protocol": "vsmd-can", "transport": "slcan", "bitrate": 1000000, "line": None},
                                 sim_bus={"protocol": "vsmd-can", "transport": "slcan", "bitrate": 1000000, "line": None})
    page = gateway.page(gateway.webd(bridge), READER)
    bridge.sim.fault("silence on", "drive1")
    kept = eventually(lambda: page.call("Traces")["kept"], what="a trace to be kept")[0]["number"]
    bridge.sim.fault("silence off", "drive1")

    def ctl(*words):
        return subprocess.run([find_program("drivebridgectl"), "--socket", bridge.control_path, "trace", "--kept", str(kept),
                               *words], capture_output=True, timeout=30, check=True)

    def trace(**more):
        stream = page.stream("Trace", bus="line", kept=kept, **more)
        stream.wait_end()
        return [data for name, data in stream.events if name is None]

    def complete():
        """It is kept for half a second after its event."""
        count = sum(len(answer["records"]) for answer in trace())
        return count == len([line for line in ctl().stdout.splitlines() if not line.startswith(b"#")]) and \
            count == sum(len(answer["records"]) for answer in trace()) and time.time() * 1e6 - page.call(
                "Traces")["kept"][0]["time_us"] > 1e6

    eventually(complete, what="the kept trace to be complete")
    answers = trace(pcapng=True)
    records = [record for answer in answers for record in answer["records"]]
    lines = [line for line in ctl().stdout.decode().splitlines() if not line.startswith("#")]
    assert [f"{record['kind']:<10} {record['words']}" + (f" | {record['bytes']}" if "bytes" in record else "")
            for record in records] == [line.split(" ", 2)[2] for line in lines]
    assert not any("data" in record for record in records)
    path = bridge.control_path.parent / "kept.pcapng"
    ctl("--output", str(path))
    blocks = [answers[0]["pcapng"], *(record["pcapng"] for record in records if "pcapng" in record)]
    assert b"".join(base64.b64decode(block) for block in blocks) == path.read_bytes()
    assert len(blocks) > 10
    # Who wants no file gets none.
    assert not any("pcapng" in answer or any("pcapng" in record for record in answer["records"]) for answer in trace())


def test_a_trigger_marks_the_samples_that_meet_it(gateway):
    """As of drivebridgectl record --trigger: an edge, also of a state by its name."""
    bridge = gateway.make_bridge()
    page = gateway.page(gateway.webd(bridge), OPERATOR)
    for trigger, right in (("drive1.position", "right is DRIVE.NAME=VALUE"), ("drive1.position>", "right is DRIVE.NAME"),
                           ("x" * 300, "a trigger is a text"), (7, "a trigger is a text")):
        error = refused(400, page.stream, "Subscribe", drives=["drive1"], names=["position"], interval_ms=0, trigger=trigger)
        assert error.error == "BadValue" and right in error.text
    for trigger, right in (("drive1.position>far", "no whole number"), ("drive1.none=1", 'drive1 has no register "none"'),
                           ("drive1.identity=x", "a text cannot be waited for")):
        stream = page.stream("Subscribe", drives=["drive1"], names=["position"], interval_ms=0, trigger=trigger)
        assert right in stream.wait(event="error")["text"]
    error = page.stream("Subscribe", drives=["drive1"], names=["position"], interval_ms=0, trigger="none.position=1").wait(event="error")
    assert error["error"] == "NoSuchDrive"

    stream = page.stream("Subscribe", drives=["drive1"], names=["position", "axis_state"], interval_ms=0,
                         trigger="drive1.position>100")
    states = page.stream("Subscribe", drives=["drive1"], names=["axis_state"], interval_ms=0,
                         trigger="drive1.axis_state=standstill")
    stream.wait(lambda data: data["samples"])
    page.run("drive1", "enable")
    page.run("drive1", "move_absolute", target_position=400, target_velocity=SPEED)
    eventually(lambda: bridge.sim.get()["position"] == 400)
    states.wait(lambda data: any(sample.get("triggers") for sample in data["samples"]))
    stream.wait(lambda data: any(sample["values"]["position"] == 400 for sample in data["samples"]))
    samples = [sample for name, data in stream.events if name is None for sample in data["samples"]]
    marked = [at for at, sample in enumerate(samples) if "triggers" in sample]
    assert len(marked) == 1
    assert samples[marked[0]]["values"]["position"] > 100 >= samples[marked[0] - 1]["values"]["position"]
