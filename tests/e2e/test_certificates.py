# SPDX-License-Identifier: Apache-2.0
"""Certificates of the page, OPC UA and MQTT: looked at before they are used, renewed without a restart, and told before
they end."""

import json
import queue
import signal
import socket
import ssl
import subprocess

import paho.mqtt.client as paho
import pytest
from bridgelib import eventually, find_program, section
from certlib import make
from cryptography import x509
from mqttlib import Broker, Publisher
from opcualib import Server, at, connect, in_loop, make_certificate, until
from weblib import Webd

OPCUA_URI = "urn:gw:drivebridge"


class Tool:
    """One of the programs, with its certificate in two files."""

    der = False

    def __init__(self, place):
        self.place = place
        self.certificate = place / "own.pem"
        self.key = place / "own.key"
        self.thing = None

    def give(self, made, key=None):
        made.write(self.certificate, self.key, self.der)
        if key:
            self.key.write_bytes(key.key_der if self.der else key.key_pem)

    def check(self):
        self.configure()
        return subprocess.run([find_program(self.program), "--config", self.config, "--check"], capture_output=True,
                              text=True, timeout=60, check=False)

    def renew(self):
        self.thing.process.send_signal(signal.SIGHUP)

    def log(self):
        return self.thing.log()

    def stop(self):
        return self.thing.stop()


class Page(Tool):
    program = "drivebridge-webd"

    def make(self):
        return Webd(self.place, server={"certificate-file": self.certificate, "key-file": self.key}, users=())

    def configure(self):
        made = self.make()
        made.write_config()
        self.config = made.config_path

    def start(self):
        self.thing = self.make().start()

    def shown(self):
        """The certificate that somebody gets who connects now."""
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        with socket.create_connection(self.thing.address, 20) as link, context.wrap_socket(link) as channel:
            return channel.getpeercert(binary_form=True)


class Opcua(Tool):
    program = "drivebridge-opcua"
    der = True

    def __init__(self, place, bridge=None):
        super().__init__(place)
        self.bridge = bridge
        own = place / "pki" / "own"
        own.mkdir(parents=True)
        self.certificate, self.key = own / "cert.der", own / "key.der"

    def configure(self):
        made = Server(self.place, None)
        made.write_config()
        self.config = made.config_path

    def start(self):
        self.thing = Server(self.place, self.bridge).start()

    def shown(self):
        import asyncio

        from asyncua import Client

        async def ask():
            return await Client(self.thing.url, timeout=20).connect_and_get_server_endpoints()

        return {bytes(one.ServerCertificate) for one in asyncio.run(ask())}.pop()


class Mqtt(Tool):
    """Its broker wants a certificate of the client, and tells whose it got."""

    program = "drivebridge-mqtt"

    def __init__(self, place):
        super().__init__(place)
        self.authority = make("authority", is_authority=True)
        self.broker = None

    def keys(self):
        (self.place / "ca.pem").write_bytes(self.authority.pem)
        return {"tls": "on", "host": "127.0.0.1", "ca-file": self.place / "ca.pem",
                "certificate-file": self.certificate, "key-file": self.key}

    def configure(self):
        self.config = self.place / "check.conf"
        self.config.write_text(section("broker", self.keys()), encoding="utf-8")

    def start(self):
        keys = self.keys()
        make("broker", issuer=self.authority).write(self.place / "broker.pem", self.place / "broker.key")
        self.broker = Broker(self.place / "broker", f"cafile {self.place}/ca.pem\ncertfile {self.place}/broker.pem\n"
                             f"keyfile {self.place}/broker.key\nrequire_certificate true\nuse_identity_as_username true")
        self.broker.host = "127.0.0.1"
        self.broker.start()
        self.thing = Publisher(self.place, None, self.broker, broker_keys=keys).start()
        self.thing.wait_for_log("connected to the broker")

    def shown(self):
        """Whom the broker knows this client as."""
        log = self.broker.log_path
        offset = log.stat().st_size
        self.broker.stop()
        self.broker.start()

        def named():
            found = [line for line in log.read_text(errors="replace")[offset:].splitlines() if "connected from" in line]
            return found and found[-1].rsplit("u'", 1)[-1].split("'")[0]

        return eventually(named, 20, "the client to come back")

    def stop(self):
        status = self.thing.stop()
        self.broker.stop(signal.SIGKILL)
        return status


TOOLS = {"page": Page, "opcua": Opcua, "mqtt": Mqtt}


@pytest.fixture(params=TOOLS)
def tool(request, tmp_path):
    return TOOLS[request.param](tmp_path)


def issue(tool, name, **options):
    """One that the tool may show: MQTT's broker takes those of its authority alone."""
    return make(name, issuer=tool.authority if isinstance(tool, Mqtt) else None, uri=OPCUA_URI,
                **options)


def test_check_looks_at_certificate_and_key(tool):
    good = issue(tool, "good")
    tool.give(good)
    done = tool.check()
    assert done.returncode == 0 and "certificate" not in done.stderr, done.stderr

    for made, key, what in ((good, make("another"), "the key does not belong to the certificate"),
                            (issue(tool, "old", begin=-30, end=-1), None, "the certificate of CN=old has ended on "),
                            (issue(tool, "early", begin=2), None, "the certificate of CN=early is not valid before ")):
        tool.give(made, key)
        done = tool.check()
        assert done.returncode == 78 and what in done.stderr, (done.returncode, done.stderr)
    tool.give(good)
    tool.certificate.write_bytes(b"junk")
    done = tool.check()
    assert done.returncode == 78 and "no certificate that can be read" in done.stderr
    tool.give(issue(tool, "soon", end=29))
    done = tool.check()
    assert done.returncode == 0 and f"{tool.certificate}: warning: the certificate ends on " in done.stderr
    if not tool.der:
        tool.give(good)
        with open(tool.certificate, "ab") as file:
            file.write(make("stranger").pem)
        done = tool.check()
        assert done.returncode == 78 and "is not signed by the next one, that of CN=stranger" in done.stderr


def test_a_renewed_certificate_needs_no_restart(tool):
    is_rsa = isinstance(tool, Opcua)
    first, second, third = (issue(tool, name, end=end, is_rsa=is_rsa)
                            for name, end in (("first", 90), ("second", 5), ("third", 91)))

    def expect(made, name):
        assert tool.shown() == (name if isinstance(tool, Mqtt) else made.der)

    def read_again(what, times=1):
        tool.renew()
        eventually(lambda: tool.log().count(what) == times, what=f"'{what}' in the log")

    tool.give(first)
    tool.start()
    expect(first, "first")
    # What cannot be used changes nothing.
    tool.give(second, make("another"))
    read_again("the key does not belong to the certificate; the certificate from before stays in use")
    expect(first, "first")
    tool.certificate.unlink()
    read_again("No such file or directory; the certificate from before stays in use")
    expect(first, "first")
    tool.give(issue(tool, "old", begin=-30, end=-1))
    read_again("; the certificate from before stays in use", 3)
    expect(first, "first")

    tool.give(second)
    read_again("the certificate of CN=second, valid until ")
    expect(second, "second")
    eventually(lambda: f"{tool.certificate}: the certificate ends on " in tool.log(), what="the end to be told")
    read_again("the certificate is the same as before")
    tool.give(third)
    read_again("the certificate of CN=third, valid until ")
    expect(third, "third")
    assert tool.log().count(": the certificate ends on ") == 1
    assert tool.stop() == 0


def test_a_page_goes_on_over_a_renewal(tmp_path):
    """A connection keeps what it began with; the metrics tell the end."""
    import http.client

    tool = Page(tmp_path)
    tool.give(make("first"))
    tool.start()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    link = http.client.HTTPSConnection(*tool.thing.address, timeout=20, context=context)

    def ends():
        link.request("GET", "/metrics")
        text = link.getresponse().read().decode()
        line = next(one for one in text.splitlines()
                    if one.startswith("drivebridge_web_certificate_expires_timestamp_seconds "))
        return int(line.split()[1])

    def end_of(made):
        return int(made.made.not_valid_after_utc.timestamp())

    link.connect()
    own = link.sock
    assert ends() > 0
    for number in range(4):
        made = make(f"renewed{number}", end=100 + number)
        tool.give(made)
        tool.renew()
        eventually(lambda name=f"CN=renewed{number}": name in tool.log())
        assert tool.shown() == made.der
        assert ends() == end_of(made)
        assert link.sock is own, "the connection is the same"
    link.close()
    assert tool.stop() == 0


@in_loop
async def test_a_session_of_opcua_goes_on_over_a_renewal(tmp_path, make_bridge):
    tool = Opcua(tmp_path, make_bridge(start_sim=False))
    shown = issue(tool, "first", is_rsa=True, end=20)
    tool.give(shown)
    own = make_certificate(tmp_path, "client")
    Server(tmp_path, None).trust(own)
    tool.start()
    server = tool.thing
    sessions = []
    for name, end in (("second", 40), ("third", 60)):
        sessions.append(await connect(server.client(own)))
        # It is told when it ends, to be noticed before.
        await until(lambda: tells_end(sessions[0], shown), what="the end of the certificate")
        shown = issue(tool, name, is_rsa=True, end=end)
        tool.give(shown)
        tool.renew()
        await until(lambda name=name: f"CN={name}" in tool.log(), what="it to be read")
        for one in sessions:
            assert await one.nodes.server_state.read_value() == 0
            assert await tells_end(one, shown)
    # One that begins anew trusts the newest one.
    sessions.append(await connect(server.client(own)))
    for one in sessions:
        assert await one.nodes.server_state.read_value() == 0
        await one.disconnect()
    assert tool.stop() == 0


async def tells_end(session, made):
    ends = await at(session, "/Gateway.CertificateEnds").read_data_value(raise_on_bad_status=False)
    return ends.Value.Value == made.made.not_valid_after_utc


def test_mqtt_tells_when_its_certificate_ends(tmp_path):
    tool = Mqtt(tmp_path)
    made = issue(tool, "client", end=40)
    tool.give(made)
    tool.start()
    told = queue.Queue()
    client = paho.Client(paho.CallbackAPIVersion.VERSION2)
    client.tls_set(tmp_path / "ca.pem", tool.certificate, tool.key)
    client.on_connect = lambda *unused: client.subscribe("drivebridge/gw/figures")
    client.on_message = lambda client, data, message: told.put(json.loads(message.payload))
    client.connect(tool.broker.host, tool.broker.port)
    client.loop_start()
    assert told.get(timeout=30)["values"]["certificate_ends_s"] == made.made.not_valid_after_utc.timestamp()
    client.disconnect()
    client.loop_stop()
    assert tool.stop() == 0


def test_a_certificate_that_is_made_signs_nothing_for_others(tmp_path):
    tool = Opcua(tmp_path)
    tool.start()
    made = x509.load_der_x509_certificate(tool.certificate.read_bytes())
    usage = made.extensions.get_extension_for_class(x509.KeyUsage).value
    assert usage.digital_signature and usage.key_encipherment and usage.data_encipherment
    assert not usage.key_cert_sign and not usage.crl_sign
    assert not made.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    names = made.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.UniformResourceIdentifier) == [OPCUA_URI]
    assert names.get_values_for_type(x509.DNSName) == ["gw"]
    assert (made.not_valid_after_utc - made.not_valid_before_utc).days <= 5 * 365 + 1
    assert tool.check().returncode == 0
    assert tool.stop() == 0
