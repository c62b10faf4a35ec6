# SPDX-License-Identifier: Apache-2.0
"""The configuration in a browser: a drive is added, shown what that does, and taken out by a button."""

import gzip
import io
import re
import tarfile

from bridgelib import CONTINUOUS, eventually
from browserlib import expect, findings, picture
from test_audit import find, state  # noqa: F401 (a fixture)
from test_browser import chromium, make_site, visit  # noqa: F401 (fixtures)
from test_web import refused
from weblib import OPERATOR, READER, Page

ADDED = ("drive feeder {\n\tbus = line\n\taddress = 2\n\tunit = 2\n\tcounts-per-unit = 320\n"
         "\tunit-name = mm\n\twatchdog-ms = 0\n}\n")


def answer(page, words=None):
    """The question, once it says these words, with yes."""
    question = page.locator("dialog.question")
    expect(question).to_contain_text(words)
    question.locator(".primary").click()


def test_a_drive_is_added_without_a_terminal(make_site, visit):  # noqa: F811
    site = make_site(drives=1, sim_drives=2, control={"edit": "on"})
    visitor = visit(site)
    page = visitor.page
    view = visitor.go("config")
    text, state, save = view.get_by_label("Buses and drives"), view.locator("#config-state"), view.locator("#config-save")
    expect(state).to_have_text("It is right, and saved")
    expect(view.locator("#config-back")).to_be_disabled()
    # A mistake is shown at its line, to which a button leads.
    text.fill(ADDED.replace("unit = 2", "unti = 2"))
    messages = view.locator("#config-messages li")
    expect(messages.filter(has_text="unknown key 'unti'")).to_be_visible()
    expect(save).to_be_disabled()
    expect(view.locator('.line-numbers [data-kind="error"]').last).to_have_text("4\n")
    view.locator('#config-messages [data-line="4"]').focus()
    page.keyboard.press("Enter")
    expect(text).to_be_focused()
    # The numbers stand next to their lines.
    at, beside = (view.locator(one).bounding_box() for one in (".line-numbers span >> nth=0", "#config-text"))
    assert at["x"] < beside["x"] and beside["y"] < at["y"] < beside["y"] + 20
    assert text.evaluate("node => node.value.slice(node.selectionStart, node.selectionEnd)") == "\tunti = 2"
    # In the guide's picture the file is where the package has it.
    view.locator("code").evaluate("node => { node.textContent = '/etc/drivebridge/edited/edited.conf' }")
    picture(page, "web-configuration")
    found = findings(page)
    assert not found, "\n".join(found)
    # The text stays while another view is looked at; nothing is written.
    visitor.go("events")
    visitor.go("config")
    expect(text).to_have_value(ADDED.replace("unit = 2", "unti = 2"))
    assert not (site.bridge.place / "edited").exists()
    text.fill(ADDED)
    expect(view.locator("#config-effects")).to_contain_text("feeder: it is added")
    save.click()
    answer(page, "feeder: it is added")
    expect(state).to_have_text("It is right, and saved")
    feeder = site.bridge.drive(2)
    eventually(feeder.online, what="the drive that was added")
    # What moves is said before it is stopped.
    feeder.settle("move_velocity", target_velocity=3200.0)
    eventually(lambda: feeder.read("axis_state") == CONTINUOUS)
    view.locator("#config-back").click()
    question = page.locator("dialog.question")
    expect(question).to_contain_text("feeder MOVES NOW: it is removed: its on-exit is carried out")
    question.get_by_role("button", name="Cancel").click()
    assert feeder.read("axis_state") == CONTINUOUS
    view.locator("#config-back").click()
    answer(page, "MOVES NOW")
    expect(text).to_have_value("")
    eventually(lambda: site.bridge.sim.get("drive2")["velocity"] == 0)
    expect(view.locator("#config-former option")).to_have_count(2)


def test_what_somebody_else_changed_is_not_overwritten(make_site, visit):  # noqa: F811
    site = make_site(drives=1, sim_drives=2, control={"edit": "on"})
    visitor = visit(site)
    view = visitor.go("config")
    state = view.locator("#config-state")
    expect(state).to_have_text("It is right, and saved")
    view.get_by_label("Buses and drives").fill("# mine\n")
    expect(state).to_have_text("It is right, and not saved")
    folder = site.bridge.place / "edited"
    folder.mkdir()
    (folder / "edited.conf").write_text("# somebody else's\n", encoding="utf-8")
    view.locator("#config-save").click()
    answer(visitor.page, "No drive changes")
    expect(visitor.page.locator("#notices")).to_contain_text("changed meanwhile")
    view.locator("#config-read").click()
    answer(visitor.page, "is lost")
    expect(view.get_by_label("Buses and drives")).to_have_value("# somebody else's\n")


def test_who_may_not_is_not_offered_it(make_site, visit):  # noqa: F811
    site = make_site()
    visitor = visit(site, READER)
    expect(visitor.page.locator('[data-view="config"]').first).to_be_hidden()
    expect(visitor.go("config")).to_contain_text("needs the role engineer")
    visitor = visit(site)
    view = visitor.go("config")
    expect(view.locator("#config-state")).to_contain_text("not changed")
    expect(view.locator("#config-save")).to_be_disabled()


# --- the whole gateway as one file --------------------------------------------------------------------------------

ADA = ("ada", "makes the users")
OLAF = ("olaf", "the word of olaf")
OLD, NEW = "/dev/serial/by-id/usb-old", "/dev/serial/by-id/usb-new"
ELSEWHERE = ADDED + (f'bus press {{\n\tprotocol = vsmd-serial\n\tdevice = "{OLD}"\n\tbaud = 115200\n}}\n'
                     "drive ram {\n\tbus = press\n\taddress = 1\n\tunit = 9\n}\n")


def texts(path):
    """Of a file of a gateway, by name: as any tar reads it."""
    with tarfile.open(path) as archive:
        return {member.name: archive.extractfile(member).read().decode() for member in archive if member.isfile()}


def write_texts(path, files):
    with tarfile.open(path, "w:gz") as archive:
        for name, text in files.items():
            member = tarfile.TarInfo(f"./{name}")
            member.size = len(text.encode())
            archive.addfile(member, io.BytesIO(text.encode()))
    return path


def test_the_gateway_is_one_file_and_comes_back(state, make_site, visit, tmp_path):  # noqa: F811
    site = make_site(drives=1, sim_drives=2, control={"edit": "on"})
    site.add_user(*ADA, "administrator")
    edited = site.bridge.place / "edited" / "edited.conf"
    visitor = visit(site)
    page = visitor.page
    visitor.go("config").get_by_role("link", name="Back up or restore").click()
    expect(page.locator("#gateway-save")).to_be_visible()
    assert findings(page) == []
    with page.expect_download() as download:
        page.locator("#gateway-save").click()
    saved = tmp_path / "saved.tar.gz"
    download.value.save_as(saved)
    expect(page.locator("#gateway-said")).to_contain_text("the parameters of 1 drives")
    files = texts(saved)
    assert files["gateway"].startswith("drivebridge-backup of the page 1\n")
    assert files["configuration/edited/edited.conf"] == "" and "drive drive1 {" in files["running.conf"]
    # Users are an administrator's, and no password leaves the gateway.
    assert "configuration/access/users" not in files and "$y$" not in "".join(files.values())
    (record,) = eventually(lambda: find(site.bridge, kind="users", what="backup"), what="the record of it")
    assert record["user"] == OPERATOR[0]

    # Onto another gateway, with a drive more, another port, another speed and a user more.
    files["configuration/edited/edited.conf"] = ELSEWHERE
    params = files["parameters/drive1.params"]
    files["parameters/drive1.params"] = re.sub(r"(?m)^(\s*spd\s*=\s*)\S+", r"\g<1>1234", params)
    assert files["parameters/drive1.params"] != params
    files["configuration/access/users"] = f"{OLAF[0]}:operator:*:$y$hash\n{ADA[0]}:administrator:*:x\n"
    files["configuration/web.conf"] = "root's"
    other = write_texts(tmp_path / "other.tar.gz", files)
    page.locator("#gateway-file").set_input_files(other)
    box = page.locator("#gateway-configuration")
    expect(box).to_contain_text("feeder: it is added")
    expect(page.locator("#gateway-users")).to_contain_text("needs the role administrator")
    expect(page.locator("#gateway-roots")).to_contain_text("sudo drivebridgectl restore other.tar.gz")
    assert not edited.exists()
    assert findings(page) == []
    port = box.get_by_label(OLD)
    port.fill(NEW)
    port.press("Tab")
    expect(box.locator("#gateway-apply")).to_be_enabled()
    box.locator("#gateway-apply").click()
    answer(page, "ram: it is added")
    expect(box).to_contain_text("This is what the gateway has.")
    assert edited.read_text(encoding="utf-8") == ELSEWHERE.replace(OLD, NEW)
    page.locator('#gateway-parameters [data-drive="drive1"]').click()
    expect(page.locator("#parameters-difference")).to_contain_text("1 parameter of drive1 differs from")
    expect(page.locator("#parameters-take")).to_contain_text("Take 1 from")

    # An administrator makes the users; what is no such file says so, and nobody else gets one.
    boss = visit(site, user=ADA)
    boss.go("users").get_by_role("link", name="Back up or restore").click()
    boss.page.locator("#gateway-file").set_input_files(other)
    expect(boss.page.locator("#gateway-configuration")).to_contain_text("needs the role engineer")
    users = boss.page.locator("#gateway-users")
    expect(users).to_contain_text("ada: administrator, drives all. Here: administrator")
    users.locator('[data-user="olaf"]').fill(OLAF[1])
    users.get_by_role("button", name="Make olaf").click()
    expect(users).to_contain_text("made")
    Page(site, OLAF).close()
    for damaged in saved.read_bytes()[:200], gzip.compress(b"x" * 4000):
        (tmp_path / "bad.tar.gz").write_bytes(damaged)
        boss.page.locator("#gateway-file").set_input_files(tmp_path / "bad.tar.gz")
        expect(boss.page.locator("#gateway-problem")).to_contain_text("bad.tar.gz: it is damaged, or no file of a gateway")
        boss.page.locator("#gateway-file").set_input_files([])
    refused(403, Page(site, OLAF).ask, "POST", "/api/gateway", {})
    assert [user["user"] for user in Page(site, ADA).ask("POST", "/api/gateway", {})["users"]].count("olaf") == 1
