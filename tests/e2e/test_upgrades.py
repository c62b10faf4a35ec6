# SPDX-License-Identifier: Apache-2.0
"""Configurations that gateways have from earlier packages are taken as they are. tests/tools/keep-configuration keeps
those of a version in upgrades/."""

import csv
import json
import os
import re
import shutil
import socket
import subprocess
from pathlib import Path

import pytest
from bridgelib import ROOT, eventually, find_program, free_address, section
from cryptography.x509.oid import ExtendedKeyUsageOID
from tlslib import Authority

VERSIONS = sorted((Path(__file__).parent / "upgrades").iterdir(), key=lambda folder: int(folder.name[3:]))
FILES = [path for folder in VERSIONS for path in sorted(folder.glob("*.conf"))]
TABLES = [path for folder in VERSIONS for path in sorted(folder.glob("*-keys.csv"))]
FAMILIES = {
    "vsmd-serial": 'device = "/dev/ttyUSB0"',
    "vsmd-can": 'interface = "can0"',
    "servo-can": 'interface = "can0"',
    "xyza": 'device = "/dev/ttyUSB0"',
}
# A value of the first type is one of the second, too.
WIDER = {("text", "processors")}


def name_of(path):
    return f"{path.parent.name}-{path.stem}"


def rows(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def check(program, path):
    return subprocess.run([find_program(program), "--check", "--config", path], capture_output=True, text=True, timeout=20,
                          check=False)


def test_there_are_old_versions():
    assert len(VERSIONS) > 3 and len(FILES) > 20 and len(TABLES) > 4


def certificates(place):
    """An authority with the gateway's certificate, as the package's tool makes them."""
    folder = place / "tls"
    for words in (["authority"], ["server", "gateway.example"]):
        subprocess.run([find_program("drivebridge-certificate"), *words, "--folder", folder], capture_output=True,
                       timeout=60, check=True)
    return folder


def with_what_it_needs(path, place):
    """A tool's file as somebody completes it: mqtt.conf comes without a broker, tls.conf without certificates, and the page may
    not be installed here."""
    if path.name not in ("mqtt.conf", "web.conf", "tls.conf"):
        return path
    text = path.read_text(encoding="utf-8")
    if path.name == "tls.conf":
        text = re.sub(r'^#(\t[a-z-]+-file +=) "/etc/drivebridge/tls/', rf'\1 "{certificates(place)}/', text, flags=re.M)
    if path.name == "mqtt.conf":
        text = re.sub(r"^broker \{", 'broker {\n\thost = "127.0.0.1"', text, count=1, flags=re.M)
    elif path.name == "web.conf":
        text = re.sub(r"^server \{", f'server {{\n\tpage = "{place}"', text, count=1, flags=re.M)
        (place / "index.html").touch()
    copy = place / path.name
    copy.write_text(text, encoding="utf-8")
    return copy


@pytest.mark.parametrize("path", FILES, ids=name_of)
def test_an_old_file_is_taken(path, tmp_path):
    program = {"mqtt": "drivebridge-mqtt", "opcua": "drivebridge-opcua", "web": "drivebridge-webd", "tls": "drivebridge-tls"}.get(
        path.stem, "drivebridged")
    done = check(program, with_what_it_needs(path, tmp_path))
    assert done.returncode == 0, done.stderr


def belongs_to(row, family):
    # The first tables had no family with axes yet.
    return row["families"] == "all" or family in row["families"].split()


def written(row):
    values = row["default"]
    if row["type"] == "networks":
        return "{" + ", ".join(f'"{value}"' for value in values.split()) + "}"
    return values if row["type"] in ("integer", "number", "word", "drives", "units") else f'"{values}"'


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("table", [path for path in TABLES if path.stem == "config-keys"], ids=name_of)
def test_an_old_file_with_every_default_is_taken(table, family, tmp_path):
    given = {"bus": {"protocol": family}, "drive": {"bus": "line", "address": 1, "unit": 1}}
    lines = {"bus": [f"\tprotocol = {family}", f"\t{FAMILIES[family]}"],
             "drive": ["\tbus = line", "\taddress = 1", "\tunit = 1"]}
    if any(row["section"] == "modbus-rtu" for row in rows(table)):
        lines["modbus-rtu"] = ['\tdevice = "/dev/ttyUSB1"']
    if any(row["section"] == "endpoint" for row in rows(table)):
        lines["endpoint"] = ['\tlisten = "127.0.0.1:503"']
    for row in rows(table):
        section = lines.setdefault(row["section"], [])
        if row["default"] and belongs_to(row, family) and row["name"] not in given.get(row["section"], {}):
            section.append(f"\t{row['name']} = {written(row)}")
    titles = {"bus": "bus line", "drive": "drive feeder", "role": "role Operator", "modbus-rtu": "modbus-rtu plc",
              "endpoint": "endpoint hall2"}
    path = tmp_path / "plant.conf"
    path.write_text("".join(f"{titles.get(section, section)} {{\n" + "\n".join(keys) + "\n}\n"
                            for section, keys in lines.items()), encoding="utf-8")
    done = check("drivebridged", path)
    assert done.returncode == 0, done.stderr + path.read_text(encoding="utf-8")


def is_retired(row, tmp_path):
    """A key that does nothing any more: a file that has it is taken, and a warning says so."""
    path = tmp_path / "plant.conf"
    parts = {"modbus": "modbus {\n", "bus": "bus line {\n\tprotocol = xyza\n\tdevice = \"/dev/ttyUSB0\"\n"}
    if row["section"] not in parts:
        return False
    parts[row["section"]] += f"\t{row['name']} = {written(row)}\n"
    path.write_text("".join(part + "}\n" for part in parts.values()) + "end\n", encoding="utf-8")
    done = check("drivebridged", path)
    return done.returncode == 0 and f"warning: {row['name']} does nothing any more" in done.stderr


def same_key(row, table):
    """What the row's key is today, for the same families."""
    for other in table:
        if (other["section"], other["name"]) == (row["section"], row["name"]) and (
                other["families"] == "all" or set(row["families"].split()) <= set(other["families"].split())):
            return other
    return None


def what_is_narrower(old, new):
    if new is None:
        return "is gone"
    if old["type"] != new["type"]:
        return None if (old["type"], new["type"]) in WIDER else f"is of type {new['type']}"
    if old["required"] == "no" and new["required"] == "yes":
        return "must be given"
    if not set(old["words"].split()) <= set(new["words"].split()):
        return f"has only the words {new['words']}"
    if new["min"] and (not old["min"] or float(new["min"]) > float(old["min"])):
        return f"begins at {new['min']}"
    if new["max"] and (not old["max"] or float(new["max"]) < float(old["max"])):
        return f"ends at {new['max']}"
    return None


@pytest.mark.parametrize("table", TABLES, ids=name_of)
def test_an_old_key_takes_what_it_took_or_is_ignored(table, tmp_path):
    today = rows(ROOT / "docs" / table.name)
    wrong = [f"{row['section']}: {row['name']} {narrower}" for row in rows(table)
             if (narrower := what_is_narrower(row, same_key(row, today)))
             and (table.stem != "config-keys" or same_key(row, today) or not is_retired(row, tmp_path))]
    assert not wrong, "\n".join(wrong)


def test_a_changed_default_is_in_the_changelog():
    """A file that does not give the key means something else after the upgrade: whoever upgrades is told."""
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    told = "\n".join(re.findall(r"^### Defaults\n(.*?)(?=^##)", changelog, re.M | re.S))
    missing = set()
    for table in TABLES:
        today = rows(ROOT / "docs" / table.name)
        for row in rows(table):
            new = same_key(row, today)
            if not new or new["default"] == row["default"]:
                continue
            lines = [line for line in told.splitlines() if f"`{row['name']}`" in line and f"`{row['default']}`" in line]
            if not lines or (new["default"] and not any(f"`{new['default']}`" in line for line in lines)):
                missing.add(f"{table.stem}: {row['section']}: {row['name']}: {row['default']} is {new['default']} now")
    assert not missing, "\n".join(sorted(missing))


def ctl(bridge, *words):
    done = subprocess.run([find_program("drivebridgectl"), "--socket", bridge.control_path, *words], capture_output=True,
                          text=True, timeout=30, check=False)
    assert done.returncode == 0, done
    return done.stdout


def test_an_upgrade_of_what_runs_is_told(make_bridge, tmp_path):
    """dpkg puts a new file in the place of the program: what runs goes on, and says that it is the one of before."""
    program = tmp_path / "drivebridged"
    shutil.copy(find_program("drivebridged"), program)
    bridge = make_bridge(launcher=["sh", "-c", f'shift; exec "{program}" "$@"', "sh"])
    bridge.wait_ready()
    assert "drivebridge_restart_needed 0" in ctl(bridge, "metrics")
    assert "replaced" not in ctl(bridge, "status")
    shutil.copy(program, tmp_path / "new")
    os.replace(tmp_path / "new", program)
    eventually(lambda: f"{program} was replaced since the start" in bridge.log_path.read_text(), timeout=20)
    assert "drivebridge_restart_needed 1" in ctl(bridge, "metrics")
    assert f"an upgrade has replaced {program}" in ctl(bridge, "status")
    assert json.loads(ctl(bridge, "--json", "status"))["restart_needed"] == str(program)


def sections_of(name, place):
    """A configuration with which it runs, without a service and a broker."""
    host, port = free_address()
    if name == "drivebridge-mqtt":
        return {"broker": {"host": host, "port": port}}
    if name == "drivebridge-opcua":
        return {"server": {"address": host, "port": port}, "security": {"pki": place / "pki", "users": place / "users"}}
    if name == "drivebridge-webd":
        return {"server": {"listen": "127.0.0.1:0", "page": place}, "access": {"users-file": place / "users"}}
    authority = Authority(place)
    own = authority.issue("gateway", usage=ExtendedKeyUsageOID.SERVER_AUTH, hosts=["gateway"])
    return {"server": {"address": "127.0.0.1", "port": 0},
            "certificates": {"certificate-file": own.pem, "key-file": own.key_pem, "ca-file": authority.pem,
                             "crl-file": authority.crl}}


@pytest.mark.parametrize("name", ["drivebridge-mqtt", "drivebridge-opcua", "drivebridge-tls", "drivebridge-webd"])
def test_an_upgrade_of_a_tool_that_runs_is_told(tmp_path, name):
    """In its log, and to systemd, which shows it in the unit's state."""
    program, config, log_path = tmp_path / name, tmp_path / "conf", tmp_path / "log"
    shutil.copy(find_program(name), program)
    (tmp_path / "index.html").write_text("<title>page</title>")
    sections = {"service": {"socket": tmp_path / "nowhere"}, **sections_of(name, tmp_path)}
    config.write_text("\n".join(section(title, keys) for title, keys in sections.items()))
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd, open(log_path, "wb") as log:
        systemd.bind(str(tmp_path / "notify"))
        systemd.settimeout(20)
        process = subprocess.Popen([program, "--config", config], stdout=log, stderr=log,
                                   env={**os.environ, "NOTIFY_SOCKET": str(tmp_path / "notify")})
        try:
            while systemd.recv(4096) != b"READY=1":
                assert process.poll() is None, log_path.read_text()
            assert "replaced" not in log_path.read_text()
            shutil.copy(program, tmp_path / "new")
            os.replace(tmp_path / "new", program)
            while (text := systemd.recv(4096).decode()) != "STATUS=an upgrade needs a restart":
                assert not text.startswith("STATUS="), text
            assert log_path.read_text().count(f"{program} was replaced since the start") == 1
        finally:
            process.terminate()
            assert process.wait(20) == 0, log_path.read_text()
