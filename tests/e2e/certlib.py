# SPDX-License-Identifier: Apache-2.0
"""Certificates with their keys, as files in PEM and DER, of which a test says until when they are valid."""

import dataclasses
import datetime
import ipaddress

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from cryptography.x509.oid import NameOID


@dataclasses.dataclass
class Made:
    pem: bytes
    der: bytes
    key_pem: bytes
    key_der: bytes
    made: object
    key: object

    def write(self, certificate, key, der=False):
        """Into these files, the key for its owner alone."""
        certificate.write_bytes(self.der if der else self.pem)
        key.write_bytes(self.key_der if der else self.key_pem)
        key.chmod(0o640)


def make(name, begin=-1, end=90, issuer=None, uri=None, is_rsa=False, is_authority=False):
    """begin and end in days from now; signed by issuer, else by itself. For 127.0.0.1."""
    key = rsa.generate_private_key(65537, 2048) if is_rsa else ec.generate_private_key(ec.SECP256R1())
    now = datetime.datetime.now(datetime.timezone.utc)
    title = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    others = [x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]
    if uri:
        others.append(x509.UniformResourceIdentifier(uri))
    made = (x509.CertificateBuilder().subject_name(title).issuer_name(issuer.made.subject if issuer else title)
            .public_key(key.public_key()).serial_number(x509.random_serial_number())
            .not_valid_before(now + datetime.timedelta(days=begin)).not_valid_after(now + datetime.timedelta(days=end))
            .add_extension(x509.SubjectAlternativeName(others), critical=False)
            .add_extension(x509.BasicConstraints(ca=is_authority, path_length=None), critical=True)
            .sign(issuer.key if issuer else key, hashes.SHA256()))
    secret = (serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    return Made(made.public_bytes(serialization.Encoding.PEM), made.public_bytes(serialization.Encoding.DER),
                key.private_bytes(serialization.Encoding.PEM, *secret),
                key.private_bytes(serialization.Encoding.DER, *secret), made, key)
