# SPDX-License-Identifier: Apache-2.0
"""Who may what at the page and over OPC UA: docs/security/who-may-what.md, tried cell by cell; users, passwords, PAM."""

import contextlib
import datetime
import http.client
import json
import socket
import stat
import subprocess
import sys

from asyncua import ua
from bridgelib import ROOT, eventually
from opcualib import (  # noqa: F401
    at,
    connect,
    fixture_certificate,
    fixture_make_server,
    in_loop,
    says,
    typed,
    until,
)
from test_web import gateway, refused  # noqa: F401 (a fixture)
from weblib import Failed

TABLES = (ROOT / "docs" / "security" / "who-may-what.md").read_text(encoding="utf-8")

# Name, password, role, drives: everything is tried on drive1.
USERS = {
    "observer": ("rudi", "looks and looks", "observer", "*"),
    "operator": ("oscar", "turns the motors", "operator", "*"),
    "engineer": ("egon", "sets parameters", "engineer", "*"),
    "administrator": ("ada", "makes the users", "administrator", "*"),
    "operator of other drives": ("lena", "turns drive two", "operator", "drive2"),
    "engineer of other drives": ("erna", "sets drive two up", "engineer", "drive2"),
}


def table(title):
    """{what: {who: whether}} as the page has it."""
    text = TABLES.split(f"\n## {title}\n")[1].split("\n## ")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    assert all(cell in ("yes", "no") for row in rows[2:] for cell in row[1:])
    return {row[0]: {who: cell == "yes" for who, cell in zip(rows[0][1:], row[1:])} for row in rows[2:]}


# --- the page ---------------------------------------------------------------------------------------

def run(command, **arguments):
    return lambda page: page.run("drive1", command, **arguments)


def write(drive="drive1", **values):
    return lambda page: page.call("Write", drive=drive, values=values)


def stream(method, **parameters):
    def begin(page):
        page.stream(method, **parameters).close()

    return begin


def download(path):
    def get(page):
        status, _, data = page.request("GET", path)
        if status != 200:
            raise Failed(status, json.loads(data))

    return get


def hold(page):
    page.beat("drive1", 1, 1, 0.0, token=page.newest_token())


PAGE = {
    "look: values, parameters, traces, events": [
        lambda page: page.call("Read", drive="drive1", names=["position", "spd"]), lambda page: page.call("Traces"),
        stream("Events"), stream("overview"), lambda page: page.ask("POST", "/api/parameters/file", {"drive": "drive1"})],
    "stop, quick_stop": [run("stop"), run("quick_stop")],
    "stop of all drives": [write("", group_stop=1), write("", group_stop=2),
                           write("", group_units1=2, group_stop_units=1)],
    "disable of all drives": [write("", group_stop=3)],
    "enable, disable, clear_fault": [run("enable"), run("disable"), run("clear_fault")],
    "motions, outputs, programs": [run("move_velocity", target_velocity=0.0), run("home_stop"),
                                   run("set_output", output_number=1, output_value=0), write(target_velocity=1.0)],
    "a held button": [hold],
    "control of a drive": [write(control_request=0)],
    "what waits for a group start": [write(staged_command=0), write(command=0)],
    "set_position, save_parameters": [run("set_position", target_position=0), run("save_parameters")],
    "parameters, watchdog_ms": [write(spd=640.0), write(watchdog_ms=500), write(target_velocity=1.0, spd=640.0),
                                stream("parameters", drive="drive1", values={"spd": 640.0})],
    "frames by hand": [run("raw_frame", raw_length=0)],
    "commissioning": [stream("commission", drive="drive1", only=["nothing"])],
    "reload of the configuration": [lambda page: page.call("Reload")],
    "buses and drives of the configuration": [
        lambda page: page.call("Configuration"), lambda page: page.call("CheckConfiguration", text=""),
        lambda page: page.call("SetConfiguration", text="", version="0")],
    "scan of a bus, addresses": [stream("Scan", bus="line", first=1, last=1),
                                 lambda page: page.call("SetUp", bus="line", address=9, what="save"),
                                 stream("setup", bus="line", address=9, what="nothing")],
    "the list of users, making and removing one": [
        lambda page: page.ask("POST", "/api/users", {}),
        lambda page: page.ask("POST", "/api/users/put", {"user": "", "role": "observer", "drives": "*"}),
        lambda page: page.ask("POST", "/api/users/remove", {"user": "nobody.of.this.name"})],
    "the audit trail of the drive": [lambda page: page.ask("POST", "/api/audit", {"drive": "drive1"}),
                                     download("/api/audit.jsonl?drive=drive1")],
    "the whole audit trail, whether it is whole": [lambda page: page.ask("POST", "/api/audit/verify", {})],
    "health of all drives, of which he sees his": [
        lambda page: page.ask("POST", "/api/health/rows", {"for_s": 60, "step_s": 60}),
        lambda page: page.ask("POST", "/api/alarms", {"after": 0})],
    "health of the drive": [
        lambda page: page.ask("POST", "/api/health", {"for_s": 60, "step_s": 60, "drive": "drive1"})],
    "acknowledging an alarm of the drive": [lambda page: page.call("AcknowledgeAlarm", id=1, drive="drive1")],
    "acknowledging one of a bus or the configuration": [
        lambda page: page.call("AcknowledgeAlarm", id=1), lambda page: page.call("AcknowledgeAlarm", id=1, drive="")],
    "the gateway as one file": [lambda page: page.ask("POST", "/api/gateway", {})],
    "the own password": [
        lambda page: page.ask("POST", "/api/password", {"password": "x", "fresh": "short"})],
}


def may(page, attempt):
    """Whether a request is refused for who sends it; what else is wrong with it is another matter."""
    try:
        attempt(page)
    except Failed as error:
        assert error.text
        return error.status not in (401, 403)
    return True


def test_each_role_may_what_the_table_says(gateway):
    bridge = gateway.make_bridge(drives=2)
    webd = gateway.webd(bridge, users=tuple(USERS.values()))
    pages = {who: gateway.page(webd, user[:2]) for who, user in USERS.items()}
    pages["nobody"] = gateway.page(webd)
    expected = table("The page")
    assert expected.keys() == PAGE.keys()
    wrong = [f"{what}, {number + 1}: {who} {'may' if told else 'may not'}, says the table"
             for what, row in expected.items() for who, told in row.items()
             for number, attempt in enumerate(PAGE[what]) if may(pages[who], attempt) != told]
    assert not wrong, "\n".join(wrong)
    # What the page is told is the same.
    session = pages["operator of other drives"].load()
    assert session["may"] == ["look", "stop", "move"] and session["drives"] == ["drive2"]
    assert pages["engineer"].load()["may"] == ["look", "stop", "move", "engineer", "manage", "audit"]
    assert pages["engineer"].load()["drives"] is None
    assert "manage" not in pages["engineer of other drives"].load()["may"]
    assert pages["administrator"].load()["may"] == ["look", "stop", "appoint", "audit"]
    assert pages["operator of other drives"].run("drive2", "enable") == "ok"
    # The reasons can be read.
    why = refused(403, pages["operator of other drives"].run, "drive1", "enable")
    assert why.text == "drive1 is not among this user's drives: drive2"
    assert refused(403, pages["operator"].call, "Reload").text == "this needs the role engineer"


def test_observers_stop_only_where_they_may(gateway):
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge, users=tuple(USERS.values()), access={"readers-may-stop": "no"})
    observer, administrator, operator = (gateway.page(webd, USERS[who][:2])
                                         for who in ("observer", "administrator", "operator"))
    for page in observer, administrator:
        assert page.load()["may"][:2] in (["look"], ["look", "appoint"])
        assert "readers-may-stop" in refused(403, page.run, "drive1", "stop").text
        refused(403, page.call, "Write", drive="", values={"group_stop": 1})
    assert operator.run("drive1", "stop") == "ok"
    # Nobody is logged in: he has no name for the record, and stops nothing.
    open_for_all = gateway.webd(bridge, access={"read": "all"})
    anybody = gateway.page(open_for_all)
    assert anybody.load()["may"] == ["look"]
    refused(401, anybody.run, "drive1", "stop")


# --- OPC UA -----------------------------------------------------------------------------------------

def method(name, *arguments, drive="drive1"):
    async def call(session):
        node = at(session, f"{drive}.{name}")
        request = ua.CallMethodRequest(at(session, drive).nodeid, node.nodeid, await typed(node, arguments))
        return (await session.uaclient.call([request]))[0].StatusCode.name

    return call


def variable(name, value, kind=ua.VariantType.UInt16):
    async def put(session):
        try:
            await at(session, name).write_value(value, kind)
        except ua.uaerrors.UaStatusCodeError as error:
            return ua.StatusCode(error.code).name
        return "Good"

    return put


def value(name):
    async def get(session):
        return (await at(session, name).read_data_value(raise_on_bad_status=False)).StatusCode.name

    return get


def past_events(name):
    """The latest record of the audit trail, of a drive's node or of all."""
    async def get(session):
        details = ua.ReadEventDetails(NumValuesPerNode=1, EndTime=datetime.datetime.now(datetime.timezone.utc))
        one = ua.SimpleAttributeOperand(BrowsePath=[ua.QualifiedName("Time")], AttributeId=ua.AttributeIds.Value)
        details.Filter.SelectClauses = [one]
        node = at(session, name) if name else session.get_node(ua.ObjectIds.Server)
        return (await node.history_read_events(details)).StatusCode.name

    return get


OPCUA = {
    "look: values, parameters, events": [value("drive1.PositionActualValue"), value("drive1.Parameters.spd")],
    "stop, quick_stop": [method("Stop"), method("QuickStop")],
    "stop by the command register": [variable("drive1.CommandBlock.Command", 3, ua.VariantType.Int32)],
    "stop of all drives": [variable("/Gateway.GroupStop", 1), variable("/Gateway.GroupStop", 2)],
    "disable of all drives": [variable("/Gateway.GroupStop", 3)],
    "enable, disable, clear_fault": [method("Enable"), method("Disable"), method("ClearFault")],
    "motions by method and by the command register": [
        method("MoveVelocity", 0.0), variable("drive1.CommandBlock.Command", 5, ua.VariantType.Int32),
        variable("drive1.CommandBlock.StagedCommand", 0, ua.VariantType.Int32), variable("drive1.CommandBlock.TargetPosition", 1, ua.VariantType.Int32)],
    "control of a drive": [variable("drive1.ControlRequest", 0)],
    "set_position, save_parameters": [method("SetPosition", 0), method("SaveParameters")],
    "parameters, watchdog_ms": [variable("drive1.Parameters.spd", 640.0, ua.VariantType.Float),
                                variable("drive1.WatchdogMs", 500, ua.VariantType.UInt32)],
    "the audit trail of the drive": [past_events("drive1")],
    "the whole audit trail": [past_events(""), past_events("/Drives")],
}


@in_loop
async def test_each_role_may_over_opcua_what_the_table_says(make_bridge, make_server, certificate):
    bridge = make_bridge(drives=2)
    server = make_server(bridge, security={"anonymous": "off", "none": "off"})
    server.users_path.write_text(users_text(), encoding="utf-8")
    expected = table("OPC UA")
    assert expected.keys() == OPCUA.keys()
    wrong = []
    for who, user in USERS.items():
        async with server.session(certificate, user[:2]) as session:
            await until(lambda: is_good(session, "drive1.Parameters.spd"), what="the drive to be known")
            for what, row in expected.items():
                for number, attempt in enumerate(OPCUA[what]):
                    said = await attempt(session)
                    if (said not in ("BadUserAccessDenied", "BadNotExecutable", "BadNotWritable")) != row[who]:
                        wrong.append(f"{what}, {number + 1}: {who}: {said}")
            if who == "operator of other drives":
                assert await method("Enable", drive="drive2")(session) == "Good"
                # What may be called is shown.
                for name, may_call in (("Stop", True), ("Enable", False)):
                    shown = await at(session, f"drive1.{name}").read_attribute(ua.AttributeIds.UserExecutable)
                    assert shown.Value.Value is may_call
    assert not wrong, "\n".join(wrong)
    # Nobody has no session.
    assert not any(row["nobody"] for row in expected.values())
    with says("BadIdentityTokenRejected", "BadIdentityTokenInvalid", "BadUserAccessDenied"):
        await connect(server.client(certificate))


async def is_good(session, name):
    return (await at(session, name).read_data_value(raise_on_bad_status=False)).StatusCode.is_good()


def users_text():
    """All of them in one file."""
    return "".join(f"{name}:{role}:{drives}:{hash_of(word)}\n" for name, word, role, drives in USERS.values())


def hash_of(word):
    return subprocess.run(["openssl", "passwd", "-6", word], capture_output=True, text=True, check=True).stdout.strip()


@in_loop
async def test_over_opcua_observers_stop_only_where_they_may(bridge, make_server, certificate):
    server = make_server(bridge, security={"readers-may-stop": "no"})
    server.users_path.write_text(users_text(), encoding="utf-8")
    for who, may_stop in (("observer", False), ("administrator", False), ("operator", True)):
        async with server.session(certificate, USERS[who][:2]) as session:
            said = [await method("Stop")(session), await variable("/Gateway.GroupStop", 1)(session)]
            assert all(one in ("BadUserAccessDenied", "BadNotExecutable", "BadNotWritable") for one in said) != may_stop
    assert "the password of" not in server.log()
    # PAM may take long, and all clients would wait for it.
    server.users_path.write_text("petra:operator:*:pam\n", encoding="utf-8")
    with says("BadIdentityTokenRejected", "BadIdentityTokenInvalid", "BadUserAccessDenied"):
        await connect(server.client(certificate, ("petra", "her word")))
    assert "the password of petra is checked by PAM, which only the page does" in server.log()


# --- requests that take their time ------------------------------------------------------------------

class SlowRequest:
    """A request whose headers have arrived, and whose body comes later."""

    def __init__(self, page, path, body):
        self.body = json.dumps(body).encode()
        self.link = socket.create_connection(page.webd.address, 30)
        host, port = page.webd.address
        headers = page.headers(Host=f"{host}:{port}", Content_Length=str(len(self.body)), Expect="100-continue")
        lines = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
        self.link.sendall(f"POST {path} HTTP/1.1\r\n{lines}\r\n".encode())
        assert self.link.recv(4096).startswith(b"HTTP/1.1 100 ")

    def send(self):
        self.link.sendall(self.body)

    def end(self):
        self.send()
        return self.answer()

    def answer(self):
        """Its status, and what error it is."""
        response = http.client.HTTPResponse(self.link)
        response.begin()
        answer = json.loads(response.read())
        self.link.close()
        return response.status, answer.get("error")


def test_a_request_has_the_rights_of_when_it_is_whole(gateway):
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge, users=tuple(USERS.values()))
    pages = {who: gateway.page(webd, user[:2]) for who, user in USERS.items()}
    run = SlowRequest(pages["engineer"], "/api/call/Run", {"drive": "drive1", "command": "enable"})
    lesser = SlowRequest(pages["operator"], "/api/call/Run", {"drive": "drive1", "command": "enable"})
    put = SlowRequest(pages["administrator"], "/api/users/put", {
        "user": "mallory", "role": "administrator", "drives": "*", "password": "quite a long word"})
    own = SlowRequest(pages["operator of other drives"], "/api/password", {
        "password": USERS["operator of other drives"][1], "fresh": "another word of hers"})
    same = SlowRequest(pages["observer"], "/api/call/Describe", {})
    lines = webd.users_path.read_text().splitlines()
    other = hash_of("given by another one")
    webd.users_path.write_text("".join(
        f"{line}\n".replace("oscar:operator", "oscar:observer") if not line.startswith("lena") else
        f"lena:operator:drive2:{other}\n" for line in lines if not line.startswith(("egon", "ada"))))
    for late in (run, lesser, put):
        assert late.end() == (401, "LoginRequired")
    # Whoever has not even said which password is to be his next one does not stay logged in by that.
    assert refused(401, pages["operator of other drives"].run, "drive2", "enable").error == "LoginRequired"
    assert own.end() == (401, "LoginRequired")
    assert same.end() == (200, None)
    assert "mallory" not in webd.users_path.read_text() and "enable" not in webd.log()


def test_a_request_does_not_take_as_long_as_it_wants(gateway):
    """However busily its body goes on."""
    page = gateway.page(gateway.webd(users=(USERS["engineer"],)), USERS["engineer"][:2])
    slow = SlowRequest(page, "/api/call/Run", {"drive": "drive1", "command": "enable", "more": " " * 10000})
    slow.link.settimeout(0.1)

    def closed():
        try:
            slow.link.sendall(b" ")
            return slow.link.recv(4096) == b""
        except TimeoutError:
            return False
        except OSError:
            return True

    eventually(closed, 30, "the connection to be closed")
    slow.link.close()


# --- users and passwords ----------------------------------------------------------------------------

def test_a_user_changes_his_own_password(gateway):
    webd = gateway.webd(users=tuple(USERS.values()))
    name, word, _, _ = USERS["operator"]
    page, elsewhere = gateway.page(webd, (name, word)), gateway.page(webd, (name, word))
    assert page.load()["password"]["weak"] is None and page.load()["password"]["own"]

    def change(password, fresh):
        return page.ask("POST", "/api/password", {"password": password, "fresh": fresh})

    for fresh in ("short", "oscaroscaroscar", "password1234", "abcabcabcabcabc", word):
        assert refused(400, change, word, fresh).error == "BadPassword"
    assert refused(403, change, "not his word", "another word of his").error == "WrongPassword"
    change(word, "another word of his")
    # Whoever knew the old one is out; he himself goes on.
    eventually(lambda: elsewhere.load()["user"] is None, what="the other session to end")
    assert page.load()["user"] == name and page.load()["role"] == "operator"
    assert refused(401, gateway.page(webd).log_in, name, word).error == "LoginFailed"
    fresh = gateway.page(webd, (name, "another word of his"))
    assert fresh.load()["drives"] is None
    assert webd.users_path.stat().st_mode & 0o777 == 0o640
    log = webd.log()
    assert f"{name} at 127.0.0.1: changed the own password" in log
    assert "the password was not changed: wrong" in log and "another word" not in log


def test_an_administrator_makes_users(gateway):
    webd = gateway.webd(users=(USERS["administrator"],))
    ada = gateway.page(webd, USERS["administrator"][:2])

    def put(**user):
        return ada.ask("POST", "/api/users/put", user)

    put(user="otto", role="operator", drives="drive2,drive1", password="winds up the clocks")
    otto = gateway.page(webd, ("otto", "winds up the clocks"))
    assert otto.load()["role"] == "operator" and otto.load()["drives"] == ["drive2", "drive1"]
    # Another role, the password stays; at once.
    put(user="otto", role="observer", drives="*")
    eventually(lambda: otto.load()["user"] is None, what="the former rights to end")
    otto.log_in("otto", "winds up the clocks")
    assert otto.load()["may"] == ["look", "stop"]
    assert [(one["user"], one["role"]) for one in ada.ask("POST", "/api/users", {})["users"]] == \
        [("ada", "administrator"), ("otto", "observer")]
    for wrong in ({"user": "o:o"}, {"role": "chief"}, {"drives": ""}, {"drives": "a,,b"}, {"drives": "a:b"},
                  {"password": "ottootto"}, {"user": "new"}):
        refused(400, put, **{"user": "otto", "role": "observer", "drives": "*", **wrong})
    # Somebody has to be left who can make users: PAM, say, has no rules for drivebridge here.
    last = "no administrator who can log in would be left"
    assert last in refused(409, put, user="ada", role="engineer", drives="*").text
    assert last in refused(409, put, user="ada", role="administrator", drives="*", pam=True).text
    assert last in refused(409, ada.ask, "POST", "/api/users/remove", {"user": "ada"}).text
    ada.ask("POST", "/api/users/remove", {"user": "otto"})
    eventually(lambda: otto.load()["user"] is None, what="the removed user's session to end")
    listed = webd.command("--users").stdout.split()
    assert listed == ["ada", "administrator", "*"]
    log = webd.log()
    assert "ada at 127.0.0.1: user otto: operator, drives drive2,drive1, a new password" in log
    assert "ada at 127.0.0.1: removed the user otto" in log and "clocks" not in log


def test_changes_of_users_at_the_same_time(gateway):
    """Each is made as its author saw the users, or not at all."""
    bea = ("bea", "makes users, too", "administrator", "*")
    webd = gateway.webd(users=(*USERS.values(), bea))
    pages = {user[0]: gateway.page(webd, user[:2]) for user in (*USERS.values(), bea)}

    def at_once(*requests):
        """Comparing the first one's password takes longer than the others need to come."""
        slow = [SlowRequest(pages[who], path, body) for who, path, body in requests]
        for request in slow:
            request.send()
        return [request.answer() for request in slow]

    def word(name, now, fresh):
        return name, "/api/password", {"password": now, "fresh": fresh}

    # A password that is known to others does not come back with another role.
    own, put = at_once(word("egon", "sets parameters", "a quite other word"),
                       ("ada", "/api/users/put", {"user": "egon", "role": "operator", "drives": "*"}))
    assert own == (200, None) and put in ((409, "NotWritten"), (200, None))
    refused(401, gateway.page(webd).log_in, "egon", "sets parameters")
    role = "engineer" if put[0] == 409 else "operator"
    assert gateway.page(webd, ("egon", "a quite other word")).load()["role"] == role
    # Two who remove each other: one is left.
    answers = at_once(word("rudi", "looks and looks", "a quite other word"),
                      ("ada", "/api/users/remove", {"user": "bea"}), ("bea", "/api/users/remove", {"user": "ada"}))
    assert sorted(answers[1:])[0] == (200, None)
    assert sorted(answers[1:])[1] in ((401, "LoginRequired"), (409, "NotWritten"))
    assert [line.split(":")[1] for line in webd.users_path.read_text().splitlines()].count("administrator") == 1


def test_users_of_before_log_in_and_move(gateway):
    """A file with the two roles of before: nothing that was accepted is refused, and what is weak is told."""
    webd = gateway.webd(users=())
    made = hash_of("only-looks")
    webd.former_path.write_text(f"olga:operator:{made}\nrudi:reader:{made}\n")
    webd.former_path.chmod(0o640)
    page = gateway.page(webd, ("olga", "only-looks"))
    assert page.load()["may"] == ["look", "stop", "move", "engineer", "manage", "audit"]
    assert page.load()["password"]["weak"] == "it is too short"
    assert gateway.page(webd, ("rudi", "only-looks")).load()["role"] == "observer"
    assert "2 users are still in" in webd.command("--check").stderr
    assert "the password is weak: it is too short" in webd.log()
    # The session goes on while users move: they are the same.
    assert webd.command("--move-users").returncode == 0
    assert not webd.former_path.exists() and "olga:engineer:*:$6$" in webd.users_path.read_text()
    page.ask("POST", "/api/password", {"password": "only-looks", "fresh": "only looks, but longer"})
    assert page.load()["user"] == "olga" and page.load()["password"]["weak"] is None
    assert "still in" not in webd.command("--check").stderr


# --- PAM --------------------------------------------------------------------------------------------

CHECK = """#!{python}
import os, sys
word = sys.stdin.buffer.read().rstrip(b"\\0").decode()
sys.exit(0 if (os.environ["PAM_USER"], word) == ("petra", "the company's word") else 1)
"""


def make_pam(place):
    """A folder with the service drivebridge, which asks a script as it would a directory."""
    folder = place / "pam.d"
    folder.mkdir()
    script = place / "check"
    script.write_text(CHECK.format(python=sys.executable))
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    (folder / "drivebridge").write_text(f"auth required pam_exec.so expose_authtok quiet {script}\n"
                                        "account required pam_permit.so\n")
    return folder


def test_pam_checks_whom_it_is_to_check(gateway, tmp_path):
    folder = make_pam(tmp_path)
    webd = gateway.webd(users=(USERS["administrator"],), access={"pam-folder": folder})
    assert webd.command("--add-user", "petra", "--role", "operator", "--pam").returncode == 0
    assert "petra:operator:*:pam\n" in webd.users_path.read_text()
    page = gateway.page(webd)
    assert refused(401, page.log_in, "petra", "not the word").error == "LoginFailed"
    assert page.log_in("petra", "the company's word")["role"] == "operator"
    assert refused(409, page.ask, "POST", "/api/password",
                   {"password": "the company's word", "fresh": "another word of hers"}).error == "NotHere"
    # By PAM nobody gets in who is not in the file.
    assert refused(401, gateway.page(webd).log_in, "paul", "the company's word").error == "LoginFailed"
    (folder / "drivebridge").write_text("auth required pam_permit.so\naccount required pam_deny.so\n")
    assert refused(401, gateway.page(webd).log_in, "petra", "the company's word").error == "LoginFailed"
    # Without a file of this name other rules would hold.
    (folder / "drivebridge").rename(folder / "other")
    assert refused(401, gateway.page(webd).log_in, "petra", "the company's word").error == "LoginFailed"
    webd.wait_for_log("PAM has no service drivebridge")


def test_a_login_that_took_its_time_is_that_of_the_user_of_now(gateway, tmp_path):
    folder = make_pam(tmp_path)
    hangs = tmp_path / "hangs"
    script = tmp_path / "check"
    script.write_text(f"#!/bin/sh\ntouch {hangs}\nwhile [ -e {hangs} ]; do sleep 0.1; done\n")
    webd = gateway.webd(users=(USERS["operator"],), access={"pam-folder": folder})
    assert webd.command("--add-user", "petra", "--role", "operator", "--pam").returncode == 0
    login = SlowRequest(gateway.page(webd), "/api/login", {"user": "petra", "password": "the word"})
    login.send()
    eventually(hangs.exists, what="PAM to be asked")
    assert webd.command("--remove-user", "petra").returncode == 0
    hangs.unlink()
    assert login.answer() == (401, "LoginFailed")
    assert "login as petra failed: the user was changed meanwhile" in webd.log()


def test_a_slow_directory_keeps_nobody_else_waiting(gateway, tmp_path):
    """PAM that does not answer: others log in and stop meanwhile, and the program ends."""
    folder = make_pam(tmp_path)
    hangs = tmp_path / "hangs"
    script = tmp_path / "check"
    script.write_text(f"#!/bin/sh\ntouch {hangs}\nwhile [ -e {hangs} ]; do sleep 0.1; done\n")
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge, users=(USERS["operator"],), access={"pam-folder": folder})
    assert webd.command("--add-user", "petra", "--role", "operator", "--pam").returncode == 0
    page = gateway.page(webd)
    body = '{"user": "petra", "password": "the word"}'
    connection = page.connect()
    connection.request("POST", "/api/login", body, page.headers())
    eventually(hangs.exists, what="PAM to be asked")
    operator = gateway.page(webd, USERS["operator"][:2])
    assert operator.run("drive1", "stop") == "ok"
    with contextlib.suppress(OSError):
        connection.close()
    assert webd.stop() == 0
    hangs.unlink()
