# SPDX-License-Identifier: Apache-2.0
"""drivebridge-tls in front of a bridge, and certificates for it."""

import datetime
import re
import signal
import socket
import ssl
import struct
import subprocess
from dataclasses import dataclass
from pathlib import Path

from bridgelib import Raw, Unit, ahead_of_tests, eventually, find_program
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID
from pymodbus.client import ModbusTlsClient

ROLE_OID = x509.ObjectIdentifier("1.3.6.1.4.1.50316.802.1")
NOW = datetime.datetime.now(datetime.timezone.utc)
DAY = datetime.timedelta(days=1)


def utf8(text):
    """A role as the specification has it: one UTF8String."""
    return bytes([0x0C, len(text)]) + text.encode()


@dataclass
class Holder:
    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey
    pem: Path
    key_pem: Path


class Authority:
    """Certificates in a folder, by a certificate authority of its own."""

    def __init__(self, place, name="plant"):
        self.place = place
        self.name = name
        self.serial = 1000
        self.revoked = []
        self.key = ec.generate_private_key(ec.SECP256R1())
        self.subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"{name} authority")])
        self.certificate = (
            self.builder(self.subject, self.key.public_key(), NOW + 3650 * DAY)
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(self.key.public_key()), critical=False)
            .add_extension(x509.KeyUsage(False, False, False, False, False, True, True, False, False), critical=True)
            .sign(self.key, hashes.SHA256()))
        self.pem = place / f"{name}.pem"
        self.pem.write_bytes(self.certificate.public_bytes(serialization.Encoding.PEM))
        self.crl = place / f"{name}-crl.pem"
        self.write_crl()

    def builder(self, subject, key, until, since=None):
        self.serial += 1
        return (x509.CertificateBuilder().subject_name(subject).issuer_name(self.subject).public_key(key)
                .serial_number(self.serial).not_valid_before(since or NOW - DAY).not_valid_after(until))

    def issue(self, name, *roles, until=None, since=None, usage=ExtendedKeyUsageOID.CLIENT_AUTH, hosts=()):
        """`roles`: values of extensions, one each, under the same number."""
        key = ec.generate_private_key(ec.SECP256R1())
        subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
        builder = self.builder(subject, key.public_key(), until or NOW + 365 * DAY, since)
        builder = builder.add_extension(x509.ExtendedKeyUsage([usage]), critical=False)
        if hosts:
            builder = builder.add_extension(x509.SubjectAlternativeName([x509.DNSName(h) for h in hosts]), False)
        for number, role in enumerate(roles):
            # The library refuses the same number twice: the second gets one as long, replaced below.
            oid = ROLE_OID if number == 0 else x509.ObjectIdentifier("1.3.6.1.4.1.50316.802.2")
            builder = builder.add_extension(x509.UnrecognizedExtension(oid, role), critical=False)
        certificate = builder.sign(self.key, hashes.SHA256())
        if len(roles) > 1:
            certificate = self.sign_anew(certificate)
        pem, key_pem = self.place / f"{name}.pem", self.place / f"{name}-key.pem"
        pem.write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
        key_pem.touch(0o600)
        key_pem.write_bytes(key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8,
                                              serialization.NoEncryption()))
        return Holder(certificate, key, pem, key_pem)

    def sign_anew(self, certificate):
        """With the second role's number made the first one's."""
        first = ROLE_OID.dotted_string.split(".")
        body = certificate.tbs_certificate_bytes
        wrong = bytes.fromhex("2b0601040183890c8622") + b"\x02"
        assert body.count(wrong) == 1 and len(first) == 9, body.hex()
        body = body.replace(wrong, wrong[:-1] + b"\x01")
        signature = self.key.sign(body, ec.ECDSA(hashes.SHA256()))
        algorithm = bytes.fromhex("300a06082a8648ce3d040302")
        bits = b"\x03" + bytes([len(signature) + 1]) + b"\x00" + signature
        inner = body + algorithm + bits
        return x509.load_der_x509_certificate(b"\x30\x82" + struct.pack(">H", len(inner)) + inner)

    def revoke(self, holder):
        self.revoked.append(holder.certificate.serial_number)
        self.write_crl()

    def write_crl(self, due=None, since=None):
        builder = (x509.CertificateRevocationListBuilder().issuer_name(self.subject).last_update(since or NOW - DAY)
                   .next_update(due or NOW + 30 * DAY))
        for serial in self.revoked:
            builder = builder.add_revoked_certificate(
                x509.RevokedCertificateBuilder().serial_number(serial).revocation_date(NOW - DAY).build())
        self.crl.write_bytes(builder.sign(self.key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM))


class Tlsd:
    """drivebridge-tls, listening on the loopback."""

    def __init__(self, place, bridge, authority, own, keys):
        self.place = place
        self.bridge = bridge
        self.authority = authority
        self.log_path = place / "tls.log"
        self.config_path = place / "tls.conf"
        self.process = None
        self.port = None
        self.keys = {
            "service": {"socket": bridge.sections["modbus"]["secure-socket"]},
            "server": {"address": "127.0.0.1", "port": 0},
            "certificates": {"certificate-file": own.pem, "key-file": own.key_pem, "ca-file": authority.pem,
                             "crl-file": authority.crl},
        }
        for section, more in keys.items():
            self.keys[section].update(more)
        self.write_config()

    def write_config(self):
        text = "".join(f"{name} {{\n" + "".join(f'\t{key} = "{value}"\n' for key, value in keys.items()) + "}\n"
                       for name, keys in self.keys.items())
        self.config_path.write_text(text)

    def command(self, *arguments):
        return subprocess.run([find_program("drivebridge-tls"), "--config", self.config_path, *arguments],
                              capture_output=True, text=True, timeout=60)

    def start(self):
        with open(self.log_path, "ab") as log, ahead_of_tests():
            self.process = subprocess.Popen([find_program("drivebridge-tls"), "--config", self.config_path],
                                            stdout=log, stderr=log)

        def listening():
            assert self.process.poll() is None, self.log()
            found = re.search(r"listens on port (\d+)", self.log())
            return found and int(found[1])

        self.port = eventually(listening, what="drivebridge-tls to listen")

    def log(self):
        return self.log_path.read_text(errors="replace") if self.log_path.exists() else ""

    def told(self, text):
        return eventually(lambda: [line for line in self.log().splitlines() if text in line],
                          what=f"a line with {text!r}")

    def hang_up(self, ends=("are read again", "stay in use")):
        before = len(self.log())
        self.process.send_signal(signal.SIGHUP)
        eventually(lambda: any(end in self.log()[before:] for end in ends), what="the files to be read again")
        return self.log()[before:]

    def context(self, holder=None, most=ssl.TLSVersion.TLSv1_3):
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.load_verify_locations(self.authority.pem)
        context.check_hostname = True
        context.maximum_version = most
        if holder:
            context.load_cert_chain(holder.pem, holder.key_pem)
        return context

    def connect(self, holder=None, source=None, **more):
        return Secure(self.port, self.context(holder, **more), source)

    def cpu_s(self):
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / 100

    def stop(self, how=signal.SIGTERM):
        self.process.send_signal(how)
        return self.process.wait(20)

    def finish(self):
        problems = []
        if self.process and self.process.poll() is None and self.stop() != 0:
            problems.append(f"drivebridge-tls ended with {self.process.returncode}")
        if "Sanitizer" in self.log() or "runtime error:" in self.log():
            problems.append("sanitizer output in tls.log")
        return problems


class Secure(Raw):
    """A connection to drivebridge-tls; refused ones raise OSError here, or at the first answer with TLS 1.3."""

    def __init__(self, port, context, source=None):
        bare = socket.create_connection(("127.0.0.1", port), 20, source_address=(source, 0) if source else None)
        bare.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            self.socket = context.wrap_socket(bare, server_hostname="gateway")
        except OSError:
            bare.close()
            raise

    def request(self, pdu, unit=255, transaction=1):
        """Of the gateway, which answers whatever its drives do."""
        return super().request(pdu, unit, transaction)

    def closed(self, timeout=10.0):
        try:
            return super().closed(timeout)
        except ssl.SSLError:
            return True


class SecureUnit(Unit):
    """A Modbus unit spoken to with pymodbus over TLS."""

    def __init__(self, tlsd, holder, number=1, view="drive"):
        self.tls_port = tlsd.port
        self.context = tlsd.context(holder)
        # pymodbus has no name for the server.
        self.context.check_hostname = False
        super().__init__(tlsd.bridge, number, view)

    def make_client(self, port):
        return ModbusTlsClient("127.0.0.1", port=self.tls_port, sslctx=self.context, timeout=10, retries=0)
