# SPDX-License-Identifier: Apache-2.0
"""What strangers do at the page's door: half greetings, all connections, guesses at a name, old TLS, noise in the log."""

import contextlib
import http.client
import re
import socket
import ssl
import threading
import time

import pytest
from bridgelib import eventually
from certlib import make
from test_web import gateway, refused  # noqa: F401
from weblib import OPERATOR, READER, Failed, Page

# The begin of a greeting of TLS, whose end never comes.
HALF_GREETING = b"\x16\x03\x01\x02"


@pytest.fixture
def tls(tmp_path):
    """Keys of the page's configuration for TLS."""
    made = {"certificate-file": tmp_path / "page.pem", "key-file": tmp_path / "page.key"}
    make("gw").write(*made.values())
    return made


def from_address(page, address):
    """All that the page asks comes from there."""
    page.connect = lambda: http.client.HTTPConnection(*page.webd.address, timeout=30, source_address=(address, 0))
    return page


def over_tls(page):
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    page.connect = lambda: http.client.HTTPSConnection(*page.webd.address, timeout=30, context=context)
    return page


class Strangers:
    """So many connections from some addresses, each with its first bytes; where one is closed another one comes."""

    def __init__(self, webd, count, first, addresses=8):
        self.webd, self.first, self.addresses = webd, first, addresses
        self.links = [None] * count
        self.been = set()
        self.going = True
        self.thread = threading.Thread(target=self._go_on, daemon=True)

    def __enter__(self):
        self.thread.start()
        eventually(lambda: len(self.been) == len(self.links), 30, "each of them to have been there")
        return self

    def __exit__(self, *unused):
        self.going = False
        self.thread.join(30)
        for link in self.links:
            if link:
                link.close()

    def _begin(self, number):
        link = socket.create_connection(self.webd.address, 20, (f"127.0.0.{20 + number % self.addresses}", 0))
        link.sendall(self.first)
        link.setblocking(False)
        return link

    def _go_on(self):
        while self.going:
            for number, link in enumerate(self.links):
                try:
                    if not link:
                        self.links[number] = self._begin(number)
                        self.been.add(number)
                    elif not link.recv(4096):
                        raise ConnectionError
                except BlockingIOError:
                    pass
                except OSError:
                    if link:
                        link.close()
                    self.links[number] = None
            time.sleep(0.05)


def sleeps(webd):
    """How often the program has waited for something."""
    with open(f"/proc/{webd.process.pid}/status", encoding="utf-8") as file:
        return int(re.search(r"^voluntary_ctxt_switches:\s*(\d+)", file.read(), re.M)[1])


def connections(page):
    return int(re.search(rb"web_connections (\d+)", page.request("GET", "/metrics")[2])[1])


def test_half_a_greeting_takes_no_processor(gateway, tls):  # noqa: F811
    """A program that spins does not wait; this one does, and stops while 130 greetings are unfinished."""
    bridge = gateway.make_bridge()
    webd = gateway.webd(server=tls)
    webd.sections["service"]["socket"] = bridge.control_path
    webd.stop()
    webd.start()
    page = over_tls(Page(webd))
    gateway.pages.append(page)
    eventually(lambda: page.load()["service"], what="the service")
    page.log_in(*OPERATOR)
    with Strangers(webd, 16, HALF_GREETING, addresses=1):
        before = sleeps(webd)
        eventually(lambda: sleeps(webd) > before + 100, 20, "the program to wait")
    times = []
    with Strangers(webd, 130, HALF_GREETING):
        for _ in range(5):
            beside = over_tls(page.beside())
            began = time.monotonic()
            assert beside.run("drive1", "stop") == "ok"
            times.append(time.monotonic() - began)
            beside.close()
    # It was 3.5 s where it spun.
    assert sorted(times)[2] < 1.5, times


def test_who_is_not_logged_in_takes_no_place_of_who_is(gateway):  # noqa: F811
    """Not even with streams that everybody may read."""
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge, server={"connections": 16}, access={"read": "all"})
    page = gateway.page(webd, OPERATOR)
    page.stream("overview").wait()
    nobody = Page(webd)
    nobody.load()
    head = (f"POST /api/stream/overview HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
            f"Cookie: {nobody.cookie}\r\nX-Drivebridge: {nobody.token}\r\nContent-Length: 2\r\n\r\n{{}}").encode()
    nobody.close()
    with Strangers(webd, 40, head, addresses=5):
        for _ in range(3):
            beside = page.beside()
            assert beside.run("drive1", "stop") == "ok"
            beside.close()
        assert gateway.page(webd, READER).call("Describe")["drives"], "somebody can log in"
        seen = page.streams[0].count()
        eventually(lambda: page.streams[0].count() > seen + 3, what="the operator's stream to go on")


@pytest.mark.parametrize("first", [b"", b"GET / HTTP/1.1\r\nX-Slow: "])
def test_who_sends_no_head_is_closed(gateway, first):  # noqa: F811
    """However busily it goes on sending: the first ones within 2 s, because places run short, and all within 10 s."""
    webd = gateway.webd(server={"connections": 12})
    page = gateway.page(webd)
    links = [socket.create_connection(webd.address, 20, (f"127.0.0.{30 + number}", 0)) for number in range(7)]
    gone = 0
    began = time.monotonic()
    for link in links:
        link.sendall(first)
        link.setblocking(False)
    while gone < len(links):
        assert time.monotonic() < began + (30 if gone else 9), "they are still there"
        for link in [one for one in links if one.fileno() >= 0]:
            try:
                if first:
                    link.send(b"x")
                if link.recv(4096) == b"":
                    raise ConnectionError
            except BlockingIOError:
                continue
            except OSError:
                link.close()
                gone += 1
        time.sleep(0.05)
    assert connections(page) == 1


def test_a_stranger_does_not_lock_a_user_out(gateway):  # noqa: F811
    """Whoever has logged in with this browser before has attempts that no stranger takes."""
    webd = gateway.webd()
    page = gateway.page(webd, OPERATOR)
    other = gateway.page(webd, READER)
    page.log_out()
    assert len(page.devices) == 1

    def guess():
        try:
            stranger.log_in("olga", "a guess")
        except Failed as error:
            return error.status
        raise AssertionError("a guess was right")

    stranger = from_address(Page(webd), "127.0.0.66")
    gateway.pages.append(stranger)
    stranger.load()
    while guess() != 429:
        pass
    # From anywhere else, and with what the browser of another user has, or a changed cookie: as any stranger.
    new = gateway.page(webd)
    assert refused(429, new.log_in, *OPERATOR).error == "TooManyAttempts"
    name, value = next(iter(page.devices.items()))
    for devices in (other.devices, {name: next(iter(other.devices.values()))}, {name: value[:-1] + "x"},
                    {name: ("f" if value[0] != "f" else "0") + value[1:]}):
        new.devices = dict(devices)
        assert refused(429, new.log_in, *OPERATOR).error == "TooManyAttempts"
    assert page.log_in(*OPERATOR)["role"] == "engineer"
    # A restart forgets no browser; another password does.
    page.log_out()
    webd.stop()
    webd.start()
    stranger.close()
    stranger.load()
    while guess() != 429:
        pass
    page.close()
    page.load()
    assert page.log_in(*OPERATOR)["role"] == "engineer"
    page.log_out()
    webd.add_user("olga", "another word of hers", "operator")
    assert refused(429, page.log_in, "olga", "another word of hers").error == "TooManyAttempts"


def test_a_known_browser_guesses_no_more_than_others(gateway):  # noqa: F811
    webd = gateway.webd()
    page = gateway.page(webd, OPERATOR)
    page.log_out()
    statuses = []
    while 429 not in statuses:
        assert len(statuses) < 50, "attempts are not limited"
        with pytest.raises(Failed) as caught:
            page.log_in("olga", "a guess")
        statuses.append(caught.value.status)
    assert statuses[:10] == [401] * 10
    # Who has stolen the browser has not its user's name elsewhere.
    assert gateway.page(webd, OPERATOR).load()["user"] == "olga"


@pytest.mark.filterwarnings("ignore:ssl.TLSVersion.TLSv1:DeprecationWarning")
def test_old_tls_is_refused(gateway, tls):  # noqa: F811
    webd = gateway.webd(server=tls)

    def greet(**limits):
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        context.minimum_version = ssl.TLSVersion.TLSv1
        context.set_ciphers(limits.pop("ciphers", "ALL") + ":@SECLEVEL=0")
        for name, value in limits.items():
            setattr(context, name, value)
        with socket.create_connection(webd.address, 20) as link, context.wrap_socket(link) as channel:
            return channel.version(), channel.cipher()[0]

    versions = ssl.TLSVersion
    assert greet()[0] == "TLSv1.3"
    version, cipher = greet(maximum_version=versions.TLSv1_2)
    assert version == "TLSv1.2" and cipher.startswith("ECDHE-") and "SHA1" not in cipher
    for limits in ({"maximum_version": versions.TLSv1}, {"maximum_version": versions.TLSv1_1},
                   *({"maximum_version": versions.TLSv1_2, "ciphers": ciphers}
                     for ciphers in ("AES128-SHA", "AES256-GCM-SHA384", "ECDHE-ECDSA-AES256-SHA",
                                     "ECDHE-ECDSA-AES128-SHA256"))):
        with pytest.raises((ssl.SSLError, ConnectionError)):
            greet(**limits)


def test_what_strangers_are_told(gateway, tls):  # noqa: F811
    """Not the version; and a browser that came by TLS is to come in no other way."""
    plain = gateway.webd()
    page = gateway.page(plain)
    assert page.load()["version"] is None
    assert page.log_in(*OPERATOR)["version"]
    assert page.log_out()["version"] is None
    status, headers, _ = page.request("GET", "/")
    assert status == 200 and "Strict-Transport-Security" not in headers and "Server" not in headers
    secure = over_tls(Page(gateway.webd(server=tls)))
    gateway.pages.append(secure)
    assert secure.request("GET", "/")[1]["Strict-Transport-Security"] == "max-age=15552000"
    off = over_tls(Page(gateway.webd(server={**tls, "hsts-days": 0})))
    gateway.pages.append(off)
    assert off.request("GET", "/api/session")[1]["Strict-Transport-Security"] == "max-age=0"


def test_noise_hides_no_failed_login(gateway):  # noqa: F811
    webd = gateway.webd()
    page = from_address(Page(webd), "127.0.0.66")
    gateway.pages.append(page)
    page.load()
    for _ in range(60):
        with contextlib.suppress(Failed):
            page.log_in("nobody", "a guess")
    log = webd.log()
    assert log.count("127.0.0.66") <= 12 and "further lines about 127.0.0.66 are left out for a minute" in log
    other = from_address(Page(webd), "127.0.0.67")
    gateway.pages.append(other)
    other.load()
    assert refused(401, other.log_in, "rudi", "a guess").error == "LoginFailed"
    webd.wait_for_log("nobody at 127.0.0.67: login as rudi failed")
