# SPDX-License-Identifier: Apache-2.0
"""Modbus/TCP Security: drivebridge-tls in front of the service. Who has which certificate may do what, who is kept
out, what a flood of strangers costs a client that is in, and what happens when one of the programs ends."""

import os
import select
import signal
import socket
import ssl
import struct
import subprocess
import tempfile
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from bridgelib import (
    BUSY,
    ILLEGAL_FUNCTION,
    NO_PATH,
    STANDSTILL,
    Raw,
    Refused,
    build_directory,
    encode,
    eventually,
    find_program,
)
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID
from test_commission import SERVO, SERVO_SIM
from tlslib import DAY, NOW, ROLE_OID, Authority, Holder, SecureUnit, Tlsd, utf8

READ = struct.pack(">BHH", 3, 0, 10)


class Plant:
    """Certificates for everybody in these tests."""

    def __init__(self, place):
        self.authority = Authority(place)
        issue = self.authority.issue
        self.server = issue("gateway", usage=ExtendedKeyUsageOID.SERVER_AUTH, hosts=["gateway"])
        self.plc = issue("press-plc", utf8("Operator"))
        self.panel = issue("panel", utf8("Reader"))
        self.feeder = issue("feeder-plc", utf8("Feeder"))
        self.foreign = Authority(place, "foreign").issue("stranger", utf8("Operator"))
        self.roleless = {
            "unknown": issue("unknown", utf8("Stranger")),
            "none": issue("none"),
            "ia5": issue("ia5", b"\x16\x08Operator"),
            "behind": issue("behind", utf8("Operator") + b"\x00"),
            "empty": issue("empty", utf8("")),
            "blank": issue("blank", utf8("Oper ator")),
            "long": issue("long", utf8("O" * 33)),
        }


@pytest.fixture(scope="module")
def plant():
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory:
        yield Plant(Path(directory))


ROLES = {
    "role Operator": {"write": "all", "parameters": "yes", "control": "yes"},
    "role Reader": {},
    "role Feeder": {"read": ["drive1"], "write": ["drive1"]},
}


@pytest.fixture
def make_tls(make_bridge, plant):
    """A bridge with the roles above, and drivebridge-tls in front of it."""
    made = []
    with tempfile.TemporaryDirectory(prefix="drivebridge-") as directory:

        def make(keys=None, modbus=None, authority=None, own=None, start=True, **options):
            place = Path(directory) / str(len(made))
            place.mkdir()
            # Everybody may try.
            Path(directory).chmod(0o755)
            socket_path = place / "modbus"
            bridge = make_bridge(modbus={"secure-socket": socket_path, **(modbus or {})}, **options)
            bridge.sections.update(ROLES)
            bridge.reload()
            tlsd = Tlsd(place, bridge, authority or plant.authority, own or plant.server, keys or {})
            made.append(tlsd)
            if start:
                tlsd.start()
            return tlsd

        yield make
        problems = [problem for tlsd in made for problem in tlsd.finish()]
        for tlsd in made:
            print(f"--- tls.log\n{tlsd.log()}")
        assert not problems, problems


def refuses(act):
    with pytest.raises(Refused) as refused:
        act()
    return refused.value.code


# --- who may what


def test_a_role_commands_and_is_named(make_tls, plant):
    tlsd = make_tls()
    bridge = tlsd.bridge
    drive = SecureUnit(tlsd, plant.plc)
    port = drive.client.socket.getsockname()[1]
    assert drive.command("enable") == 0
    assert drive.command("move_absolute", target_position=500) == 0
    eventually(lambda: drive.read("axis_state") == STANDSTILL and drive.read("position") == 500)
    # The same three words everywhere: in the log, the history and the list of clients.
    name = "127.0.0.1, certificate press-plc, role Operator"
    assert bridge.told(f"client {name}: connected (port {port}, may read and write)")
    assert drive.read("history1_address") == name[: name.rindex(",")]
    assert drive.read("history1_port") == port
    gateway = SecureUnit(tlsd, plant.panel, 255, "gateway")
    eventually(lambda: gateway.read("clients") >= 2)
    assert "127.0.0.1, certificate press-plc" in [
        gateway.read(f"client{number}_address") for number in range(1, gateway.read("clients") + 1)]
    assert tlsd.told("client 127.0.0.1, certificate press-plc: role Operator")


def test_what_roles_may(make_tls, plant):
    tlsd = make_tls(drives=2)
    reader, feeder = SecureUnit(tlsd, plant.panel), SecureUnit(tlsd, plant.feeder)
    other = SecureUnit(tlsd, plant.feeder, 2)
    gateway = SecureUnit(tlsd, plant.feeder, 255, "gateway")
    operator = SecureUnit(tlsd, plant.plc, 255, "gateway")
    # Who reads does not command.
    assert reader.online() and reader.command("enable") == ILLEGAL_FUNCTION
    # A role for one drive: neither the other nor what reaches all.
    assert feeder.command("enable") == 0
    assert refuses(other.online) == ILLEGAL_FUNCTION
    assert other.write("command", int(tlsd.bridge.commands["stop"]["code"])) == ILLEGAL_FUNCTION
    assert gateway.write("group_stop", 1) == ILLEGAL_FUNCTION
    assert gateway.read("window1_online") == 1 and gateway.read("window1_unit") == 1
    assert gateway.read("window2_online") == 0 and gateway.read("window2_unit") == 0
    # Parameters, and commands that keep them, are a right of their own; a stop beside them is carried out.
    assert feeder.write("watchdog_ms", 1000) == ILLEGAL_FUNCTION
    assert feeder.write("acc", 32000) == ILLEGAL_FUNCTION
    assert feeder.command("save_parameters") == ILLEGAL_FUNCTION
    assert feeder.command("stop") == 0
    assert operator.write("group_stop", 1) == 0
    assert SecureUnit(tlsd, plant.plc).write("acc", 32000) == 0
    # A unit that nobody has is that, whoever asks.
    assert refuses(SecureUnit(tlsd, plant.feeder, 77).online) == NO_PATH
    assert tlsd.bridge.told("certificate feeder-plc") and tlsd.bridge.told("its role does not allow")


def test_an_endpoint_has_its_own(make_tls, plant, tmp_path):
    """Unit 1 is drive2 at the secure socket of hall2, for rights too."""
    place = tmp_path / "hall2"
    tlsd = make_tls(keys={"service": {"socket": place}}, drives=2, per_drive={2: {"endpoint": "hall2", "unit": 1}},
                    endpoints={"hall2": {"secure-socket": place}})
    drive, feeder = SecureUnit(tlsd, plant.plc), SecureUnit(tlsd, plant.feeder)
    assert drive.command("move_absolute", target_position=300) == 0
    eventually(lambda: tlsd.bridge.drive(2).read("position") == 300)
    assert tlsd.bridge.drive(1).read("position") == 0
    assert tlsd.bridge.told("certificate press-plc, role Operator: connected")[-1].endswith("endpoint hall2, may read and write)")
    # The role Feeder is for drive1, which is unit 1 of the other endpoint.
    assert refuses(feeder.online) == ILLEGAL_FUNCTION
    assert feeder.write("command", int(tlsd.bridge.commands["stop"]["code"])) == ILLEGAL_FUNCTION
    assert refuses(SecureUnit(tlsd, plant.plc, 2).online) == NO_PATH
    assert SecureUnit(tlsd, plant.panel, 255, "gateway").read("drive_count") == 1


def test_without_a_role_everything_is_answered_01(make_tls, plant):
    tlsd = make_tls()
    requests = [READ, struct.pack(">BHH", 6, 0, 0), b"\x11", b"\x2b\x0e\x01\x00", struct.pack(">BHH", 3, 0, 2000), b"\x63"]
    for holder in plant.roleless.values():
        with tlsd.connect(holder) as client:
            for request in requests:
                assert client.request(request) == bytes([request[0] | 0x80, ILLEGAL_FUNCTION])
            assert client.request(READ, unit=99) == bytes([0x83, ILLEGAL_FUNCTION])
    # The reload gives one of them its role, over the connection that it has.
    client = tlsd.connect(plant.roleless["unknown"])
    assert client.request(READ)[0] == 0x83
    tlsd.bridge.sections["role Stranger"] = {}
    tlsd.bridge.reload()
    assert client.request(READ)[0] == 3
    del tlsd.bridge.sections["role Stranger"]
    tlsd.bridge.reload()
    assert client.request(READ)[0] == 0x83


def test_addresses_hold_as_well(make_tls, plant):
    tlsd = make_tls(modbus={"allow-read": ["127.0.0.2"], "allow-write": ["127.0.0.1"]})
    with tlsd.connect(plant.plc, source="127.0.0.2") as client:
        assert client.request(READ)[0] == 3
        assert client.request(struct.pack(">BHH", 6, 100, 1)) == bytes([0x86, ILLEGAL_FUNCTION])
    assert tlsd.connect(plant.plc, source="127.0.0.3").closed()


def test_a_role_that_may_less_gives_up_control(make_tls, plant):
    tlsd = make_tls(drives=2, modbus={"control": "drive", "control-timeout-ms": 60000})
    boss = plant.authority.issue("boss", utf8("Boss"))
    tlsd.bridge.sections["role Boss"] = {"write": "all"}
    tlsd.bridge.reload()
    first, second = (SecureUnit(tlsd, plant.plc, number) for number in (1, 2))
    others = [SecureUnit(tlsd, boss, number) for number in (1, 2)]
    for drive in (first, second):
        assert drive.command("enable") == 0
    assert [drive.command("enable") for drive in others] == [BUSY, BUSY]
    tlsd.bridge.sections["role Operator"] = {"write": ["drive1"], "control": "yes"}
    tlsd.bridge.reload()
    assert [drive.command("enable") for drive in others] == [BUSY, 0]
    assert first.command("enable") == 0 and second.command("enable") == ILLEGAL_FUNCTION


def test_what_reaches_a_bus_needs_all_its_drives(make_tls, plant):
    tlsd = make_tls(drives=2, **SERVO, drive={"sync": "yes"}, sim_drive={**SERVO_SIM, "sync": "true"})
    operator = SecureUnit(tlsd, plant.plc, 2)
    feeder = SecureUnit(tlsd, plant.feeder, 1)
    assert operator.command("enable") == 0
    assert operator.command("move_velocity", target_velocity=300) == 0
    assert feeder.command("enable") == 0
    assert feeder.command("sync_start") == ILLEGAL_FUNCTION
    assert float(tlsd.bridge.sim.get("drive2")["velocity"]) == 0
    assert operator.command("sync_start") == 0
    eventually(lambda: operator.read("velocity") > 0, what="the motion")


def test_no_secure_socket_no_secure_clients(make_tls, plant):
    tlsd = make_tls()
    client = tlsd.connect(plant.plc)
    assert client.request(READ)[0] == 3
    socket_path = tlsd.bridge.sections["modbus"].pop("secure-socket")
    tlsd.bridge.reload()
    assert client.closed(30)
    tlsd.bridge.sections["modbus"]["secure-socket"] = socket_path
    tlsd.bridge.reload()
    with tlsd.connect(plant.plc) as client:
        assert client.request(READ)[0] == 3


def test_ids_are_the_certificates(make_tls, plant):
    """A PLC that comes back from another address with its last id is not executed again."""
    tlsd = make_tls(modbus={"command-id-scope": "client"})
    row = tlsd.bridge.map.find("command_id").address
    block = lambda number, command: struct.pack(">BHHBHH", 16, row, 2, 4, number, command)
    enable = int(tlsd.bridge.commands["enable"]["code"])
    first = tlsd.connect(plant.plc, source="127.0.0.2")
    assert first.request(block(7, enable), 1)[0] == 0x90  # the first id is only the baseline
    assert first.request(block(8, enable), 1)[0] == 16
    first.close()
    drive = tlsd.bridge.drive()
    executed = drive.read("history1_sequence")
    again = tlsd.connect(plant.plc, source="127.0.0.3")
    assert again.request(block(8, enable), 1)[0] == 16
    assert drive.read("history1_sequence") == executed
    assert again.request(block(9, enable), 1)[0] == 16
    assert drive.read("history1_sequence") == executed + 1


# --- who is kept out


def is_refused(tlsd, holder, **more):
    try:
        return tlsd.connect(holder, **more).closed()
    except OSError:
        return True


def test_certificates_that_are_not_good(make_tls, plant):
    tlsd = make_tls()
    issue = plant.authority.issue
    wrong = {
        "no certificate": None,
        "foreign": plant.foreign,
        "ended": issue("ended", utf8("Operator"), since=NOW - 9 * DAY, until=NOW - DAY),
        "early": issue("early", utf8("Operator"), since=NOW + DAY),
        "server's": plant.server,
        "two roles": issue("two", utf8("Operator"), utf8("Reader")),
    }
    for what, holder in wrong.items():
        for version in (ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3):
            assert is_refused(tlsd, holder, most=version), what
    assert tlsd.told("client 127.0.0.1, certificate stranger refused: ")
    assert "certificate stranger" not in tlsd.bridge.log_since(0)
    with tlsd.connect(plant.plc) as client:
        assert client.request(READ)[0] == 3


def s_client(tlsd, holder, *options, send=b""):
    command = ["openssl", "s_client", "-connect", f"127.0.0.1:{tlsd.port}", "-CAfile", tlsd.authority.pem, "-cert",
               holder.pem, "-key", holder.key_pem, *options]
    done = subprocess.run(command, input=send, capture_output=True, timeout=60, check=False)
    return (done.stdout + done.stderr).decode(errors="replace")


def test_what_openssl_gets(make_tls, plant):
    tlsd = make_tls()
    assert "Verification: OK" in s_client(tlsd, plant.plc, "-tls1_3")
    assert "Verification: OK" in s_client(tlsd, plant.plc, "-tls1_2")
    for old in (["-tls1_1", "-cipher", "ALL:@SECLEVEL=0"], ["-tls1", "-cipher", "ALL:@SECLEVEL=0"],
                ["-tls1_2", "-cipher", "AES128-SHA256:AES128-GCM-SHA256"], ["-tls1_2", "-cipher", "ECDHE-ECDSA-AES128-SHA"]):
        assert "Cipher is (NONE)" in s_client(tlsd, plant.plc, *old), old
    # Nothing to come back with.
    assert "New, TLSv1.3" in (text := s_client(tlsd, plant.plc, "-tls1_3", "-reconnect"))
    assert "Reused" not in text and "TLS session ticket:" not in text
    text = s_client(tlsd, plant.plc, "-tls1_2", "-reconnect")
    assert "Reused" not in text and "TLS session ticket:" not in text
    # A new greeting inside a connection ends it.
    process = subprocess.Popen(["openssl", "s_client", "-connect", f"127.0.0.1:{tlsd.port}", "-tls1_2", "-cert",
                                plant.plc.pem, "-key", plant.plc.key_pem], stdin=subprocess.PIPE,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    process.stdin.write(b"R\n")
    process.stdin.flush()
    assert process.wait(30) != 0
    process.stdin.close()
    process.stdout.close()


# --- certificates that change


def test_revoked_and_ended_while_connected(make_tls, tmp_path):
    authority = Authority(tmp_path)
    server = authority.issue("gateway", usage=ExtendedKeyUsageOID.SERVER_AUTH, hosts=["gateway"])
    plc, other = authority.issue("plc", utf8("Operator")), authority.issue("other", utf8("Operator"))
    tlsd = make_tls({"certificates": {"certificate-file": server.pem, "key-file": server.key_pem}}, authority=authority)
    client, beside = tlsd.connect(plc), tlsd.connect(other)
    assert client.request(READ)[0] == 3
    # Wrong files change nothing, and nobody is cut off.
    good = authority.crl.read_text()
    for wrong in ("junk", Authority(tmp_path, "foreign").crl.read_text()):
        authority.crl.write_text(wrong)
        assert "the former files stay in use" in tlsd.hang_up()
        assert tlsd.command("--check").returncode == 78
    authority.crl.write_text(good)
    # A list that is overdue still holds, and says so.
    authority.write_crl(due=NOW - DAY / 2)
    assert "a newer list was due" in tlsd.hang_up()
    assert client.request(READ)[0] == 3
    # One by a clock that is ahead of this one, too.
    authority.write_crl(since=NOW + DAY / 24)
    assert "are read again" in tlsd.hang_up()
    with tlsd.connect(other) as late:
        assert client.request(READ)[0] == 3 and late.request(READ)[0] == 3
    authority.revoked.append(plc.certificate.serial_number)
    authority.write_crl(since=NOW + DAY / 24)
    tlsd.hang_up()
    assert client.closed(60)
    assert tlsd.told("client 127.0.0.1, certificate plc disconnected: ")
    assert is_refused(tlsd, plc)
    assert beside.request(READ)[0] == 3
    # Another certificate of its own is shown from now on.
    renewed = authority.issue("renewed", usage=ExtendedKeyUsageOID.SERVER_AUTH, hosts=["gateway"])
    server.pem.write_bytes(renewed.pem.read_bytes())
    assert "stay in use" in tlsd.hang_up()
    server.key_pem.write_bytes(renewed.key_pem.read_bytes())
    assert "are read again" in tlsd.hang_up()
    assert "CN = renewed" in s_client(tlsd, other).replace("CN=", "CN = ")
    assert beside.request(READ)[0] == 3


def test_check(make_tls, plant, tmp_path):
    tlsd = make_tls(start=False)
    done = tlsd.command("--check")
    assert done.returncode == 0 and "is valid until" in done.stdout
    certificates = tlsd.keys["certificates"]

    def complains(about, **keys):
        before = dict(certificates)
        certificates.update({key.replace("_", "-"): value for key, value in keys.items()})
        tlsd.write_config()
        done = tlsd.command("--check")
        certificates.clear()
        certificates.update(before)
        assert done.returncode == 78 and about in done.stdout + done.stderr, done

    (tmp_path / "junk").write_text("junk")
    complains("certificate-file", certificate_file=tmp_path / "junk")
    complains("does not belong to the certificate", key_file=plant.plc.key_pem)
    complains("ca-file", ca_file=tmp_path / "none")
    complains("not signed by an authority", crl_file=Authority(tmp_path, "foreign").crl)
    complains("crl-file", crl_file=tmp_path / "none")
    ended = plant.authority.issue("old", since=NOW - 9 * DAY, until=NOW - DAY, usage=ExtendedKeyUsageOID.SERVER_AUTH)
    complains("has ended", certificate_file=ended.pem, key_file=ended.key_pem)
    complains("is not for server authentication", certificate_file=plant.feeder.pem, key_file=plant.feeder.key_pem)
    plant.plc.key_pem.chmod(0o644)
    complains("key-file", certificate_file=plant.plc.pem, key_file=plant.plc.key_pem)
    plant.plc.key_pem.chmod(0o600)


def test_without_a_list_nobody_is_revoked_and_it_is_said(make_tls, plant):
    tlsd = make_tls({"certificates": {"crl-file": ""}})
    with tlsd.connect(plant.plc) as client:
        assert "none is revoked" in tlsd.hang_up()
        assert client.request(READ)[0] == 3


def test_an_end_that_comes_is_said(make_tls, plant):
    soon = plant.authority.issue("soon", utf8("Reader"), until=NOW + 6 * DAY)
    tlsd = make_tls()
    with tlsd.connect(soon) as client:
        assert client.request(READ)[0] == 3
        assert tlsd.told("127.0.0.1, certificate soon: the certificate ends on ")
    assert "certificate-file" not in tlsd.log()


def ctl(*arguments, status=0, **options):
    done = subprocess.run([find_program("drivebridgectl"), *map(str, arguments)], capture_output=True, text=True,
                          timeout=60, check=False,
                          env={**os.environ, "PATH": f"{build_directory()}:{os.environ['PATH']}"}, **options)
    assert done.returncode == status, done
    return done.stdout


def test_certificates_by_one_command_each(make_tls, tmp_path):
    folder = tmp_path / "tls"
    made = ("--folder", folder)
    ctl("certificate", "authority", *made)
    ctl("certificate", "server", "gateway", "127.0.0.1", "fd00::2", *made)
    ctl("certificate", "client", "press-plc", "Operator", *made)
    ctl("certificate", "client", "panel", *made, "--days", 20)
    # What is there stays, wrong names and roles make nothing.
    for wrong in (["authority"], ["client", "press-plc", "Reader"]):
        ctl("certificate", *wrong, *made, status=1)
    for wrong in (["client", "server"], ["client", "../x"], ["client", "a-key"], ["client", "x", "two words"],
                  ["revoke", "nobody"]):
        ctl("certificate", *wrong, *made, status=1)
    assert {path.name for path in folder.iterdir()} == {"revoked.pem"} | {
        f"{name}{end}.pem" for name in ("authority", "server", "press-plc", "panel") for end in ("", "-key")}
    assert {path.name: oct(path.stat().st_mode & 0o777) for path in folder.glob("*-key.pem")} == {
        "authority-key.pem": "0o600", "press-plc-key.pem": "0o600", "panel-key.pem": "0o600",
        "server-key.pem": oct((folder / "server-key.pem").stat().st_mode & 0o777)}
    assert (folder / "server-key.pem").stat().st_mode & 0o007 == 0
    for name, purpose in (("server", "sslserver"), ("press-plc", "sslclient"), ("panel", "sslclient")):
        subprocess.run(["openssl", "verify", "-x509_strict", "-crl_check", "-CRLfile", folder / "revoked.pem", "-purpose",
                        purpose, "-CAfile", folder / "authority.pem", folder / f"{name}.pem"], check=True, timeout=60)
    own, plc, panel = (Holder(x509.load_pem_x509_certificate((folder / f"{name}.pem").read_bytes()), None,
                              folder / f"{name}.pem", folder / f"{name}-key.pem")
                       for name in ("server", "press-plc", "panel"))
    role = plc.certificate.extensions.get_extension_for_oid(ROLE_OID)
    assert role.value.value == utf8("Operator") and not role.critical
    authority = SimpleNamespace(pem=folder / "authority.pem", crl=folder / "revoked.pem")
    tlsd = make_tls(authority=authority, own=own)
    with tlsd.connect(plc) as client, tlsd.connect(panel) as beside:
        assert client.request(READ)[0] == 3
        assert beside.request(READ) == bytes([0x83, ILLEGAL_FUNCTION])
        # The end that comes first is in the status and in the figures.
        socket_path = tlsd.bridge.control_path
        eventually(lambda: "the certificate of a connected client ends on" in ctl("--socket", socket_path, "status"))
        figures = ctl("--socket", socket_path, "metrics")
        ends = int(panel.certificate.not_valid_after_utc.timestamp())
        assert f'drivebridge_tls_certificate_expires_timestamp_seconds{{of="client"}} {ends}' in figures
        assert "drivebridge_tls_up 1" in figures and "drivebridge_tls_clients 2" in figures
        ctl("certificate", "revoke", "press-plc", *made)
        ctl("certificate", "revoke", "panel", *made)
        tlsd.hang_up()
        assert client.closed(60) and beside.closed(60)
    assert is_refused(tlsd, plc) and is_refused(tlsd, panel)
    # Another one of the same name is another one.
    plc.pem.unlink()
    plc.key_pem.unlink()
    ctl("certificate", "client", "press-plc", "Operator", *made)
    with tlsd.connect(plc) as client:
        assert client.request(READ)[0] == 3
    tlsd.stop()
    eventually(lambda: "drivebridge_tls_up 0" in ctl("--socket", socket_path, "metrics"))


# --- one of the programs ends


def test_the_service_ends(make_tls, plant):
    tlsd = make_tls()
    client = tlsd.connect(plant.plc)
    assert client.request(READ)[0] == 3
    tlsd.bridge.stop_bridge()
    assert client.closed()
    assert is_refused(tlsd, plant.plc)
    assert tlsd.told("drivebridged is not there")
    tlsd.bridge.start_bridge()
    with tlsd.connect(plant.plc) as client:
        assert client.request(READ)[0] == 3


def test_the_watchdog_when_the_program_dies(make_tls, plant):
    tlsd = make_tls(per_drive={1: {"watchdog-ms": 1000, "on-client-loss": "stop"}})
    drive = SecureUnit(tlsd, plant.plc)
    assert drive.command("enable") == 0
    assert drive.command("move_velocity", target_velocity=2000.0) == 0
    # Reads feed it, as on port 502.
    until = time.monotonic() + 1.5
    while time.monotonic() < until:
        assert drive.read("watchdog_trips") == 0
    tlsd.stop(signal.SIGKILL)
    seen = tlsd.bridge.drive()
    eventually(lambda: seen.read("watchdog_trips") == 1)
    eventually(lambda: seen.read("velocity") == 0)
    assert tlsd.bridge.told("127.0.0.1, certificate press-plc, role Operator: disconnected")


def motion(drive):
    """The request for move_velocity with 2000 counts/s."""
    start, end = drive.row("command"), drive.row("target_velocity")
    words = drive.words(start.address, end.address + end.size - start.address)
    words[0] = int(drive.bridge.commands["move_velocity"]["code"])
    words[end.address - start.address:] = encode(end.type, 2000.0, drive.bridge.low_first)
    return struct.pack(f">BHHB{len(words)}H", 16, start.address, len(words), 2 * len(words), *words)


def hello(name, role, waited_ms):
    """What drivebridge-tls says before a client's Modbus."""
    address = bytes(10) + b"\xff\xff" + bytes([127, 0, 0, 1])
    return struct.pack(">6sBH16s32sqB20s64s32sI", b"DBTLS\x01", 1, 50123, address, b"\xab" * 32, 2**32, 0, b"",
                       name.encode(), role.encode(), waited_ms).ljust(256, b"\0")


def test_a_program_that_hangs_is_not_up(make_tls, plant):
    tlsd = make_tls()
    up = lambda: "drivebridge_tls_up 1" in ctl("--socket", tlsd.bridge.control_path, "metrics")
    eventually(up)
    tlsd.process.send_signal(signal.SIGSTOP)
    eventually(lambda: not up(), timeout=60)
    tlsd.process.send_signal(signal.SIGCONT)
    eventually(up, timeout=60)


@pytest.mark.parametrize("how", ["stopped", "told"])
def test_who_has_left_does_not_keep_a_drive_going(make_tls, plant, how):
    """A command that waited in drivebridge-tls is carried out; but its time began when it came."""
    tlsd = make_tls(per_drive={1: {"watchdog-ms": 2000, "on-client-loss": "stop"}})
    drive = tlsd.bridge.drive()
    assert drive.command("enable") == 0
    pdu = motion(drive)
    if how == "stopped":
        client = tlsd.connect(plant.plc)
        assert client.request(READ)[0] == 3
        tlsd.process.send_signal(signal.SIGSTOP)
        client.send(client.adu(1, 1, pdu))
        client.close()
        time.sleep(2.2)
        tlsd.process.send_signal(signal.SIGCONT)
    else:
        client = socket.socket(socket.AF_UNIX)
        client.connect(str(tlsd.keys["service"]["socket"]))
        client.sendall(hello("press-plc", "Operator", 2200) + Raw.adu(1, 1, pdu))
        client.close()
    eventually(lambda: drive.read("watchdog_trips") == 1, what="the watchdog")
    eventually(lambda: drive.read("velocity") == 0, what="standstill")
    assert "move_velocity" == next(name for name, entry in tlsd.bridge.commands.items()
                                   if int(entry["code"]) == drive.read("history2_command"))
    # Two seconds would be 4000.
    assert drive.read("position") < 2500


def test_nobody_else_is_believed(make_tls, plant):
    tlsd = make_tls(start=False)
    path = str(tlsd.keys["service"]["socket"])
    script = ("import socket,sys\ns = socket.socket(socket.AF_UNIX)\ns.connect(sys.argv[1])\ns.settimeout(20)\n"
              "sys.exit(0 if s.recv(1) == b'' else 1)")
    done = subprocess.run(["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", "/usr/bin/python3", "-c",
                           script, path], timeout=60, check=False, capture_output=True)
    assert done.returncode == 0, done.stderr
    # What is no hello is not Modbus either.
    with socket.socket(socket.AF_UNIX) as odd:
        odd.connect(path)
        odd.sendall(b"\0" * 300)
        odd.settimeout(20)
        try:
            assert odd.recv(1) == b""
        except ConnectionError:
            pass
    assert tlsd.bridge.told("secure socket: ")


# --- floods


class Reader(threading.Thread):
    """A PLC that reads on and on; its times."""

    def __init__(self, client):
        super().__init__(daemon=True)
        self.client = client
        self.times = []
        self.wrong = None
        self.ends = threading.Event()

    def run(self):
        try:
            while not self.ends.is_set():
                begun = time.monotonic()
                assert self.client.request(READ)[0] == 3
                self.times.append(time.monotonic() - begun)
                time.sleep(0.01)
        except (OSError, AssertionError) as error:
            self.wrong = error

    def finish(self):
        self.ends.set()
        self.join(30)
        assert self.wrong is None
        return sorted(self.times)


def silent(port, count, first=b"", source=None):
    made = []
    for _ in range(count):
        stranger = socket.create_connection(("127.0.0.1", port), 20, source_address=(source, 0) if source else None)
        stranger.sendall(first)
        made.append(stranger)
    return made


def is_closed(stranger):
    stranger.settimeout(30)
    try:
        while stranger.recv(100):
            pass
    except ConnectionError:
        pass
    return True


def test_half_greetings_cost_nothing(make_tls, plant):
    tlsd = make_tls()
    plc = tlsd.connect(plant.plc, source="127.0.0.9")
    reader = Reader(plc)
    reader.start()
    hello = b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03"
    strangers = silent(tlsd.port, 60, hello[:1], "127.0.0.2") + silent(tlsd.port, 60, hello, "127.0.0.3")
    # Another one comes in beside them, and the one that is in does not wait.
    with tlsd.connect(plant.panel, source="127.0.0.4") as late:
        assert late.request(READ)[0] == 3
    before, begun = tlsd.cpu_s(), time.monotonic()
    time.sleep(1.0)
    spent, passed = tlsd.cpu_s() - before, time.monotonic() - begun
    times = reader.finish()
    # The reader costs something, too; spinning would take all there is.
    assert spent < 0.5 * passed
    assert len(times) > 10 and times[len(times) // 2] < 0.5
    assert sum(stranger.fileno() >= 0 for stranger in strangers) == 120
    eventually(lambda: "others came" in tlsd.log())
    # And who does not finish is let go.
    for stranger in strangers:
        assert is_closed(stranger)
        stranger.close()


def test_a_full_queue_of_connections_is_waited_for(make_tls, plant, tmp_path):
    """Whoever fills the queue of the service's socket does not keep a PLC out that comes just then."""
    path = tmp_path / "full"
    with socket.socket(socket.AF_UNIX) as service, socket.socket(socket.AF_UNIX) as filler:
        service.bind(str(path))
        service.listen(0)
        filler.connect(str(path))
        tlsd = make_tls({"service": {"socket": path}})
        client = tlsd.connect(plant.plc)
        client.socket.settimeout(0.05)
        with pytest.raises(TimeoutError):
            client.socket.recv(1)
        client.socket.settimeout(20)
        request = struct.pack(">HHHB", 1, 0, 1 + len(READ), 1) + READ
        client.socket.sendall(request)
        # Also drivebridge-tls itself has a connection, with its status.
        got = {}
        deadline = time.monotonic() + 20
        while not any(data.endswith(request) for data in got.values()):
            assert time.monotonic() < deadline
            for ready in select.select([service, *got], [], [], 1)[0]:
                if ready is service:
                    got[service.accept()[0]] = b""
                else:
                    got[ready] += ready.recv(4096)
        for taken in got:
            taken.close()


def test_sixty_clients_beside_a_plc(make_tls, plant):
    tlsd = make_tls({"server": {"clients": 64, "clients-per-address": 20}}, modbus={"max-clients": 80})
    plc = tlsd.connect(plant.plc, source="127.0.0.9")
    others = [tlsd.connect(plant.panel, source=f"127.0.0.{2 + number // 20}") for number in range(60)]
    assert is_refused(tlsd, plant.panel, source="127.0.0.2")
    assert tlsd.told("clients-per-address")
    reader = Reader(plc)
    reader.start()
    for other in others:
        assert other.request(READ)[0] == 3
    times = reader.finish()
    assert times[len(times) // 2] < 0.5
    for other in others:
        other.close()


def test_who_sends_more_than_is_taken(make_tls, plant):
    """Requests that wait too long are no sign of life: the connection ends instead."""
    tlsd = make_tls(modbus={"max-requests-per-second": 20})
    client = tlsd.connect(plant.plc)
    client.socket.settimeout(20)
    try:
        for _ in range(3000):
            client.send(client.adu(1, 1, READ) * 100)
    except OSError:
        pass
    assert client.closed(30)
    assert tlsd.told("it sends more than the service takes")
