# SPDX-License-Identifier: Apache-2.0
"""The audit trail on the page: who sees what of it, searches from the newest record back, files, whether it is whole."""

import hashlib
import hmac
import json
import time

import pytest
from bridgelib import eventually
from test_audit import ctl, records, state  # noqa: F401 (a fixture)
from test_web import gateway, refused  # noqa: F401
from weblib import OPERATOR

USERS = ((*OPERATOR, "engineer"), ("erna", "sets drive two up", "engineer", "drive2"),
         ("ada", "makes the users", "administrator"), ("oscar", "turns the motors", "operator"))
# Since 1970, in microseconds: of the first record of a long trail.
BEGIN = 1_700_000_000_000_000


def search(page, **filters):
    return page.ask("POST", "/api/audit", filters)


def search_all(page, **filters):
    """All that is wanted, as a page asks for it."""
    found, answer = [], {"over": False}
    while not answer["over"]:
        answer = search(page, **filters, **({"before": answer["before"]} if "before" in answer else {}))
        found += answer["records"]
    return found


def numbers(found):
    return [record["number"] for record in found]


def wait_for(page, **filters):
    return eventually(lambda: search_all(page, **filters), what=f"a record with {filters}")


def download(page, form="jsonl", query="", **headers):
    status, head, data = page.request("GET", f"/api/audit.{form}{query}", **headers)
    if status != 200:
        return status
    assert head["Content-Disposition"].startswith('attachment; filename="audit-')
    return data.decode().splitlines()


def write_trail(folder, counts):
    """Files of the trail as the service would have left them, each with so many logins of a user each second, the key
    included."""
    folder.mkdir()
    key, seal, number = b"k" * 32, "0" * 32, 0
    (folder / "key").write_text(key.hex(), encoding="utf-8")
    (folder / "key").chmod(0o600)
    for segment, count in enumerate(counts, 1):
        lines = []

        def add(record):
            nonlocal seal
            body = json.dumps(record, separators=(",", ":"))[:-1]
            seal = hmac.new(key, (seal + body).encode(), hashlib.sha256).hexdigest()[:32]
            lines.append(f'{body},"seal":"{seal}"}}\n')

        add({"audit": "drivebridge 1", "segment": segment, "first": number + 1, "time_us": BEGIN + number * 1000000,
             "before": seal})
        for _ in range(count):
            number += 1
            add({"number": number, "time_us": BEGIN + number * 1000000, "kind": "login", "what": "in", "port": 1,
                 "who": "control, user root for anna", "from": f"page, 10.0.0.{number % 7}", "user": "anna",
                 "text": f"entry {number:05}", "result": "refused" if number % 100 == 0 else "ok"})
        (folder / f"trail-{segment:08}.jsonl").write_text("".join(lines), encoding="utf-8")
    return number


def test_the_newest_come_first_and_filters_hold(state, gateway):  # noqa: F811
    bridge = gateway.make_bridge(drives=2)
    webd = gateway.webd(bridge, users=USERS)
    page = gateway.page(webd, OPERATOR)
    assert page.run("drive1", "enable") == "ok"
    assert page.run("drive2", "enable") == "ok"
    assert page.call("Write", drive="drive1", values={"acc": 32000.0})["result"] == "ok"
    bridge.drive().command("clear_fault")
    wait_for(page, kind="end", drive="drive1", text="clear_fault")
    wait_for(page, kind="login")
    found = search_all(page)
    assert numbers(found) == sorted(numbers(found), reverse=True) and found[-1]["number"] == 1
    # The same records as drivebridgectl has, with words.
    added = ("line", "through", "failed")
    assert [{key: value for key, value in record.items() if key not in added} for record in found] == records(bridge)[::-1]
    (written,) = search_all(page, kind="write")
    assert written["line"].startswith("write acc") and written["line"].endswith("-> 32000.0")
    assert written["through"] == "page" and f"for {OPERATOR[0]}, page, 127.0.0.1" in written["who"]
    assert {record["through"] for record in search_all(page, text="clear_fault", kind="command")} == {"Modbus"}
    assert {record["drive"] for record in search_all(page, drive="drive2")} == {"drive2"}
    assert {record["kind"] for record in search_all(page, through="service")} == {"service"}
    assert search_all(page, who="nobody of this name") == [] == search_all(page, drive="drive2", kind="write")
    since = found[3]["time_us"]
    assert numbers(search_all(page, since_us=since)) == numbers(record for record in found if record["time_us"] >= since)
    assert numbers(search_all(page, until_us=since)) == numbers(record for record in found if record["time_us"] <= since)
    assert numbers(search_all(page, since_us=since, until_us=since)) == [found[3]["number"]]
    # Files have the same, oldest first; they are what drivebridgectl writes.
    assert [json.loads(line) for line in download(page)] == records(bridge)
    assert download(page, "cef") == ctl(bridge, "audit", "--cef").stdout.splitlines()
    assert [json.loads(line)["number"] for line in download(page, query="?kind=write")] == [written["number"]]
    assert download(page, query=f"?until_us={since}&drive=drive2&through=page&refused=1") == []
    for wrong in ({"who": 7}, {"text": "x" * 64}, {"since_us": -1}, {"before": "1"}):
        refused(400, search, page, **wrong)
    assert download(page, query="?since_us=soon") == 400


def test_who_sees_what(state, gateway):  # noqa: F811
    bridge = gateway.make_bridge(drives=2)
    webd = gateway.webd(bridge, users=USERS)
    engineer, erna, ada, oscar = (gateway.page(webd, user[:2]) for user in USERS)
    for drive in "drive1", "drive2":
        assert engineer.run(drive, "enable") == "ok"
    wait_for(engineer, kind="end", drive="drive2")
    eventually(lambda: len(search_all(engineer, kind="login")) == len(USERS), what="the records of all logins")
    whole = numbers(search_all(engineer))
    for page in engineer, ada:
        assert "audit" in page.load()["may"]
        assert set(whole) <= set(numbers(search_all(page)))
        assert page.ask("POST", "/api/audit/verify", {})["broken"] == []
    # Of an engineer's own drives; not the logins of others, nor what is of the gateway.
    assert {record["drive"] for record in search_all(erna)} == {"drive2"}
    assert search_all(erna, kind="login") == []
    assert {json.loads(line)["drive"] for line in download(erna)} == {"drive2"}
    assert all("cs1=drive2" in line for line in download(erna, "cef"))
    why = "drive1 is not among this user's drives: drive2"
    assert refused(403, search, erna, drive="drive1").text == why and download(erna, query="?drive=drive1") == 403
    assert refused(403, erna.ask, "POST", "/api/audit/verify", {}).text == "this needs all drives; this user has drive2"
    assert refused(403, search, oscar).text == "this needs the role engineer or administrator"
    assert download(oscar) == 403
    refused(403, oscar.ask, "POST", "/api/audit/verify", {})
    refused(401, search, gateway.page(webd))
    assert download(gateway.page(webd)) == 401
    # A link on another site is none of this page.
    assert download(engineer, Sec_Fetch_Site="cross-site") == 403
    assert download(engineer, Sec_Fetch_Site="same-origin")
    engineer.log_out()
    assert download(engineer) == 401


def test_a_long_trail(state, gateway):  # noqa: F811
    """Answers are bounded, and whatever is in three files is found."""
    last = write_trail(state / "audit", [1000, 1000, 1000])
    webd = gateway.webd(gateway.make_bridge(), users=USERS)
    page = gateway.page(webd, OPERATOR)
    answer = search(page, kind="login", text="entry")
    assert numbers(answer["records"]) == list(range(last, last - 100, -1)) and not answer["over"]
    answer = search(page, kind="login", text="entry", before=answer["before"])
    assert numbers(answer["records"]) == list(range(last - 100, last - 200, -1))
    assert numbers(search_all(page, text="ENTRY 00005")) == [5]
    assert numbers(search_all(page, refused=True, who="10.0.0.0", text="entry")) == list(range(2800, 0, -700))
    assert numbers(search_all(page, since_us=BEGIN + 1998 * 1000000, until_us=BEGIN + 2003 * 1000000)) == [
        2003, 2002, 2001, 2000, 1999, 1998]
    assert len(download(page, query="?kind=login&text=entry")) == last
    # Those who read at the same time do not hold each other up.
    other = page.beside()
    reading = page.connect()
    reading.request("GET", "/api/audit.cef", headers=page.headers())
    response = reading.getresponse()
    lines = response.readline()
    assert numbers(search_all(other, text="entry 01500")) == [1500]
    whole = other.ask("POST", "/api/audit/verify", {})
    assert whole["broken"] == [] and whole["checked"] > last
    # A login that ends breaks a file off: it is known to be none.
    page.log_out()
    with pytest.raises(Exception, match="IncompleteRead"):
        lines += response.read()
    reading.close()
    other.close()
    # What somebody has changed is named.
    path = state / "audit" / "trail-00000002.jsonl"
    path.write_text(path.read_text(encoding="utf-8").replace("entry 01500", "entry 01501"), encoding="utf-8")
    page = gateway.page(webd, OPERATOR)
    whole = page.ask("POST", "/api/audit/verify", {})
    assert [(broken["file"], broken["number"]) for broken in whole["broken"]] == [("trail-00000002.jsonl", 1500)]
    assert [record["number"] for record in search_all(page, text="entry 01501") if "broken" in record] == [1500]


def test_without_files_or_service(gateway):  # noqa: F811
    bridge = gateway.make_bridge()
    webd = gateway.webd(bridge, users=USERS)
    page = gateway.page(webd, OPERATOR)
    answer = search(page)
    assert answer["records"] == [] and answer["over"] and not answer["trail"]["kept"]
    assert download(page) == []
    bridge.stop_bridge()
    begun = time.monotonic()
    refused(502, search, page)
    refused(502, page.ask, "POST", "/api/audit/verify", {})
    assert time.monotonic() - begun < 20
