# SPDX-License-Identifier: Apache-2.0
"""Other languages: what people see is in theirs, what programs read stays English."""

import csv
import io
import json
import os
import subprocess
from pathlib import Path

from bridgelib import build_directory, find_program
from browserlib import PHONE, expect, findings
from test_browser import VIEWS, chromium, give, make_site, motions, open_drive, site, visit  # noqa: F401 (fixtures)

TABLET = {"width": 768, "height": 1024}
SHOWN = {
    "de": {"locale": "de-DE", "tag": "de", "overview": "Übersicht", "stands": "Stillstand", "well": "alles in Ordnung",
           "advice": "Versorgung, Kabel und Adresse prüfen", "stop": "Alle anhalten", "none": "kein Antrieb heißt „x“",
           "file": "/nowhere.conf: diese Datei gibt es nicht", "refused": "spd: „x“ ist keine Zahl"},
    "zh_CN": {"locale": "zh-CN", "tag": "zh-CN", "overview": "总览", "stands": "静止", "well": "一切正常",
              "advice": "检查电源、电缆和从站地址", "stop": "全部停止", "none": "没有名为“x”的驱动器",
              "file": "/nowhere.conf：没有该文件", "refused": "spd: “x”不是数"},
}


def run_ctl(bridge, *words, **environment):
    plain = {name: value for name, value in os.environ.items() if not name.startswith(("LC_", "LANG"))}
    return subprocess.run([find_program("drivebridgectl"), "--socket", bridge.control_path, *words], text=True, check=False,
                          capture_output=True, timeout=30,
                          env={**plain, "TEXTDOMAINDIR": str(build_directory() / "locale"), **environment})


def keep_picture(page, name):
    folder = os.environ.get("DRIVEBRIDGE_PICTURES")
    if folder:
        page.screenshot(path=Path(folder) / name, full_page=True)


def test_the_page_is_in_the_browsers_language(site, visit):  # noqa: F811
    visitors = {language: visit(site, locale=words["locale"], viewport=PHONE) for language, words in SHOWN.items()}
    site.bridge.sim.fault("silence on", "drive2")
    for language, words in SHOWN.items():
        page = visitors[language].page
        assert page.evaluate("document.documentElement.lang") == words["tag"]
        expect(page.locator("h1")).to_have_text(words["overview"])
        expect(page.locator("#stop-all")).to_have_text(words["stop"])
        expect(page.locator("#troubles .troubles-advice")).to_contain_text(words["advice"])
    site.bridge.sim.fault("silence off", "drive2")
    for language, words in SHOWN.items():
        look_at_all(visitors[language], language)
        visitors[language].go("")
        expect(visitors[language].page.locator("#summary")).to_have_text(words["well"])
    # What goes over the wire is said in words, too, whatever the drives do just now.
    for language, kind, words in (("de", "Abfrage", "drive1: Status?"), ("zh_CN", "轮询", "drive1: 状态？")):
        view = visitors[language].go("trace")
        view.locator("#trace-kind").select_option("poll")
        expect(view.get_by_text(words).first).to_be_visible()
        expect(view.locator("#trace-kind")).to_contain_text(kind)
        visitors[language].go("")
    # The choice on the page is kept, whatever the browser asks for.
    page = visitors["de"].page
    with page.expect_navigation():
        page.locator("#language").select_option("en")
    expect(page.locator("#summary")).to_have_text("all is well")
    page.reload()
    expect(page.locator("h1")).to_have_text("Overview")
    assert page.evaluate("document.documentElement.lang") == "en"


def look_at_all(visitor, language):
    """Nothing is cut off or too wide on a phone and on a tablet, and the words are for everybody."""
    page = visitor.page
    for size, views in ((PHONE, VIEWS), (TABLET, ["", "drive/drive1"])):
        page.set_viewport_size(size)
        for view in views:
            expect(visitor.go(view).locator(".panel, .view-head").first).to_be_visible()
            keep_picture(page, f"{language}-{size['width']}-{view.split('/')[0] or 'overview'}.png")
            wide = page.evaluate("""() => [...document.querySelectorAll("body *")].filter((node) =>
                node.getBoundingClientRect().right > innerWidth + 1 && !node.closest(".table-frame, nav, .editor"))
                .map((node) => `${node.tagName} ${node.className} ${node.textContent.slice(0, 60)}`)""")
            assert page.evaluate("document.documentElement.scrollWidth") <= size["width"], (view, size, wide)
        assert findings(page) == [], size


def test_numbers_are_typed_as_they_are_shown(site, visit):  # noqa: F811
    """With a comma or a point; what may be a thousand or one moves nothing, and files keep the point."""
    visitor = visit(site, locale="de-DE")
    view = open_drive(visitor)
    give(view, "move_absolute", target_position="1,25", target_velocity="25")
    expect(view.locator("#position")).to_have_text("1,250")
    give(view, "move_absolute", target_position="2.5", target_velocity="25")
    expect(view.locator("#position")).to_have_text("2,500")
    before = motions(site.bridge)
    give(view, "move_absolute", target_position="1.000", target_velocity="25")
    expect(view.locator("#command-result")).to_contain_text("1,000 oder 1000 schreiben")
    view.locator("#jog-step").fill("1.000")
    view.locator("#jog-step-forward").click()
    expect(view.locator("#jog")).to_contain_text("1,000 oder 1000 schreiben")
    assert motions(site.bridge) == before
    view.locator("#jog-step").fill("0,75")
    view.locator("#jog-step-forward").click()
    expect(view.locator("#position")).to_have_text("3,250")
    view.locator(".plot-pause").click()
    with visitor.page.expect_download() as download:
        view.locator(".plot-csv").click()
    rows = list(csv.reader(io.StringIO(download.value.path().read_text(encoding="utf-8"))))
    assert float(rows[-1][2]) == 3.25
    # The oscilloscope's trigger, which the server reads.
    view = visitor.go("scope/drive1")
    view.locator("#scope-trigger-drive").select_option("drive1")
    view.locator("#scope-trigger-value").select_option("position")
    expect(view.locator("#scope-unit")).to_have_text("mm")
    view.locator("#scope-limit").fill("1.000")
    view.locator("#scope-start").click()
    expect(view).to_contain_text("1,000 oder 1000 schreiben")


def test_people_read_their_language_and_programs_english(bridge):
    english = run_ctl(bridge, "status", LANG="C")
    for language, words in SHOWN.items():
        said = run_ctl(bridge, "status", LANG=f"{language}.UTF-8")
        assert words["well"] in said.stdout and words["stands"] in said.stdout
        assert said.returncode == english.returncode == 0
        assert words["none"] in run_ctl(bridge, "show", "x", LANG=f"{language}.UTF-8").stderr
        assert words["refused"] in run_ctl(bridge, "set", "drive1", "spd=x", LANG=f"{language}.UTF-8").stderr
        wrong = run_ctl(bridge, "check", "/nowhere.conf", LANG=f"{language}.UTF-8")
        assert words["file"] in wrong.stderr and wrong.returncode == 1
        assert "there is no such file" in run_ctl(bridge, "check", "/nowhere.conf", "--json", LANG=f"{language}.UTF-8").stdout
        # What programs read is the same, byte for byte where no value changes.
        told = json.loads(run_ctl(bridge, "status", "--json", LANG=f"{language}.UTF-8").stdout)
        plain = json.loads(run_ctl(bridge, "status", "--json", LANG="C").stdout)
        assert [drive["state"] for drive in told["drives"]] == [drive["state"] for drive in plain["drives"]]
        for command in (["show", "x", "--json"], ["params", "save", "drive1", "-"], ["export", "--for", "notation"]):
            assert run_ctl(bridge, *command, LANG=f"{language}.UTF-8").stdout == run_ctl(bridge, *command, LANG="C").stdout
    for environment in ({"LANG": "C", "LANGUAGE": "de"}, {"LC_ALL": "POSIX", "LANG": "de_DE.UTF-8"},
                        {"LANG": "de_DE.ISO-8859-1"}, {"LANG": "en_GB.UTF-8"}, {}):
        assert run_ctl(bridge, "help", **environment).stdout == run_ctl(bridge, "help", LANG="C").stdout
