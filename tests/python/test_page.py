# SPDX-License-Identifier: BSD-2-Clause
"""The report's page, and the scene in it."""

import dataclasses
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from playwright.sync_api import Page

from browser import difference, open_page, open_scene, settled_picture, wait_for
from dynacom import DynacomError, page_html
from dynacom import scene as page_scene
from dynacom.page import write_page
from dynacom.repair_change import Before
from dynacom.robots import Robot
from dynacom.summary import repair_table
from helpers import WALKS
from report_case import Arrays, Summary, repaired_walk, walk_report

Report = tuple[np.ndarray, Arrays, Summary]

HOSTILE = '</script><script>alert("x")</script><img src=x onerror=alert(1)>&lt;b&gt;%{y}$title'


@pytest.fixture(scope="module")
def hurried(talos: Robot) -> Report:
    """The walk, made so fast that Talos would fall."""
    haste = 1.85
    with np.load(WALKS / "talos_walk.npz") as file:
        faster = {"t": file["t"] / haste, "v": haste * file["v"], "a": haste**2 * file["a"]}
    q, arrays, summary = walk_report(talos, **faster)
    summary["clip"] = "talos_hurries.npz"
    assert summary["verdict"] == "repairable"
    return q, arrays, summary


@pytest.fixture(scope="module")
def hurried_page(talos: Robot, hurried: Report, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    write_page(path, talos, *hurried)
    return path


def reason(summary: Summary, code: str) -> dict[str, Any]:
    return next(reason for reason in summary["reasons"] if reason["code"] == code)


# ---- The page in a browser ----

TIME_PLOTS = ("forces", "friction", "residual_force", "residual_torque", "distance", "schedule")


def cursors(tab: Page) -> list[float]:
    """Where the cursors are in the plots, from the left of the page."""
    return tab.evaluate(
        "Array.from(document.querySelectorAll('.cursor'), (c) => c.getBoundingClientRect().x)"
    )


def clock(tab: Page) -> float:
    return float(tab.locator("#clock").inner_text().split()[0])


def shown_times(tab: Page) -> np.ndarray:
    """The first and the last time that each of the plots shows."""
    script = "(ids) => ids.map((id) => document.getElementById(id).layout.xaxis.range)"
    return np.array(tab.evaluate(script, list(TIME_PLOTS)))


class Axis:
    """The axis of time of the plots, from the left of the page."""

    def __init__(self, tab: Page, time: np.ndarray) -> None:
        tab.locator("#forces").scroll_into_view_if_needed()
        box = tab.locator("#forces").bounding_box()
        margin = tab.evaluate("document.getElementById('forces').layout.margin")
        self.first, self.duration = time[0], time[-1] - time[0]
        self.left = box["x"] + margin["l"]
        self.width = box["width"] - margin["l"] - margin["r"]
        self.middle = box["y"] + box["height"] / 2  # of the plot's height

    def place(self, time: float) -> float:
        return self.left + self.width * (time - self.first) / self.duration


def test_page_in_a_browser(hurried_page, hurried, request, root):
    _, arrays, summary = hurried
    time = arrays["time"]
    with open_page(hurried_page) as tab:
        tab.set_viewport_size(
            {"width": 1280, "height": 1600}
        )  # all of the scene, without scrolling
        player = open_scene(tab).locator("input.mantine-NumberInput-input")
        assert tab.locator(".verdict h2").inner_text() == "Repairable"
        for plot in ("above", *TIME_PLOTS[:-1]):
            lengths = tab.locator(f"#{plot} path.js-line").evaluate_all(
                "(lines) => lines.map((line) => line.getTotalLength())"
            )
            assert max(lengths) > 100.0, plot
        assert tab.locator("#schedule .bars path").count() >= 10
        at_first = settled_picture(tab, "#scene")

        # Windows are bands along the axes of time.
        shapes = tab.evaluate("document.getElementById('forces').layout.shapes")
        bands = [[shape["x0"], shape["x1"]] for shape in shapes if shape["type"] == "rect"]
        assert_allclose(bands, summary["windows"])
        assert at_first.std(axis=(0, 1)).min() > 0.02

        # A reason leads to its time, everywhere.
        holding = reason(summary, "residual_torque")
        assert holding["holds"]
        tab.get_by_role("row", name="residual_torque").get_by_role("button").click()
        wait_for(lambda: abs(clock(tab) - holding["time"]) < 1e-3, "the clock")
        wait_for(lambda: abs(float(player.input_value()) - holding["time"]) < 0.06, "the player")
        assert difference(at_first, settled_picture(tab, "#scene")) > 0.02
        if request.config.getoption("--pictures"):
            tab.set_viewport_size({"width": 1280, "height": 1240})
            tab.evaluate("window.scrollTo(0, 0)")
            settled_picture(tab, "#scene")
            tab.screenshot(path=root / "docs" / "report.png")
        axis = Axis(tab, time)
        assert_allclose(cursors(tab), axis.place(holding["time"]), rtol=0, atol=1.0)

        # So does pointing at a plot, and the scene finds back to what it has shown.
        third = time[0] + axis.duration / 3.0
        tab.mouse.move(axis.place(third) + 50.0, axis.middle)
        tab.mouse.move(axis.place(third), axis.middle)
        wait_for(lambda: abs(clock(tab) - third) < 0.02, "the clock")
        wait_for(lambda: abs(float(player.input_value()) - third) < 0.1, "the player")
        assert_allclose(cursors(tab), axis.place(clock(tab)), rtol=0, atol=1.0)
        tab.locator("#slider").fill("0")
        wait_for(lambda: float(player.input_value()) == 0.0, "the player")
        assert difference(at_first, settled_picture(tab, "#scene")) < 1e-3


def test_contacts_show_their_parts_and_how_sure_they_are(talos, hurried, tmp_path):
    """A bar for each contact, faint where it is unsure, and a thin one below for each part."""
    q, arrays, summary = hurried
    names = list(talos.contacts)
    left, right = (arrays[f"contact.{name}.active"] for name in names)
    more = {}
    sure = left.astype(float)
    (first, *_), (*_, last) = np.flatnonzero(left), np.flatnonzero(left)
    sure[last - 9 : last + 1] = 0.6
    more[f"contact.{names[0]}.confidence"] = sure
    heel, toe = left.copy(), left.copy()
    heel[first + 5 :] = False
    toe[: first + 5] = False
    more |= {
        f"contact.{names[0]}.heel.active": heel,
        f"contact.{names[0]}.toe.active": toe,
        f"contact.{names[1]}.toe.active": right,
    }
    path = tmp_path / "report.html"
    write_page(path, talos, q, arrays | more, summary)
    with open_page(path) as tab:
        tab.wait_for_selector("#schedule .bars path", state="attached")
        bars = tab.evaluate(
            "document.getElementById('schedule').data.map(({base, x, y, marker, customdata}) =>"
            " ({base, x, y, opacity: marker.opacity, names: customdata.map((c) => c[2])}))"
        )
    found = {bar["names"][0]: bar for bar in bars if bar["names"]}
    time = arrays["time"]
    for name, values in (("heel", heel), ("toe", toe)):
        (own,) = [bar for key, bar in found.items() if key == f"{names[0]}.{name}"]
        shown = np.zeros(len(time), dtype=bool)
        for begin, length in zip(own["base"], own["x"], strict=True):
            shown |= (time > begin) & (time < begin + length)
        assert_array_equal(shown, values)
        assert 0.0 < own["y"][0] < 0.5
    faint = [value < 1.0 for value in found[names[0]]["opacity"]]
    assert sum(faint) == 1
    begin, length = (found[names[0]][key][faint.index(True)] for key in ("base", "x"))
    assert_array_equal((time > begin) & (time < begin + length), left & (sure < 1.0))
    assert set(found[names[1]]["opacity"]) == {1}


def test_linked_plots(talos, hurried, tmp_path, monkeypatch):
    """What the page does without a scene."""
    monkeypatch.setitem(sys.modules, "viser", None)
    write_page(tmp_path / "report.html", talos, *hurried)
    time = hurried[1]["time"]
    with open_page(tmp_path / "report.html") as tab:
        tab.locator("#clock", has_text="frame 0").wait_for()
        everything = np.tile(time[[0, -1]], (len(TIME_PLOTS), 1))
        assert_array_equal(shown_times(tab), everything)
        path = "document.getElementById('above').data[2].x.length"
        assert tab.evaluate(path) == len(time)

        # Zooming in one plot zooms all, and the paths seen from above; cursors stay at their time.
        axis = Axis(tab, time)
        tab.locator("#slider").fill(str(len(time) // 2))
        start, end = (time[0] + part * axis.duration for part in (0.4, 0.7))
        tab.mouse.move(axis.place(start), axis.middle)
        tab.mouse.down()
        tab.mouse.move(axis.place(end), axis.middle, steps=5)
        tab.mouse.up()
        wait_for(lambda: (np.abs(shown_times(tab) - [start, end]) < 0.02).all(), "the zoom")
        wait_for(lambda: tab.evaluate(path) < 0.35 * len(time), "the path")
        tab.locator("#slider").fill(str(len(time) // 2))
        where = axis.left + axis.width * (time[len(time) // 2] - start) / (end - start)
        wait_for(lambda: (np.abs(np.array(cursors(tab)) - where) < 5.0).all(), "the cursors")
        tab.mouse.dblclick(axis.place(start), axis.middle)
        wait_for(lambda: (shown_times(tab) == everything).all(), "the plots to zoom out")

        # It plays to the end, and stops there.
        tab.locator("#slider").fill(str(len(time) - 40))
        tab.locator("#play").click()
        wait_for(lambda: clock(tab) == pytest.approx(time[-1], abs=1e-3), "the end")
        assert tab.locator("#play").get_attribute("aria-label") == "Play"
        tab.locator("body").press("ArrowLeft")
        wait_for(lambda: clock(tab) == pytest.approx(time[-2], abs=1e-3), "the frame before")

        # On paper it is as wide as that.
        width = "document.getElementById('forces').querySelector('svg').clientWidth"
        tab.evaluate("window.dispatchEvent(new Event('beforeprint'))")
        wait_for(lambda: tab.evaluate(width) == 680, "the plots to fit")
        tab.evaluate("window.dispatchEvent(new Event('afterprint'))")
        wait_for(lambda: tab.evaluate(width) > 1000, "the plots to fit")


def test_hostile_names(talos, hurried, tmp_path, monkeypatch):
    """Whatever files call things, it is text."""
    monkeypatch.setitem(sys.modules, "viser", None)
    q, arrays, summary = hurried
    names = {name: f"{HOSTILE} {name}" for name in talos.contacts}

    def renamed(value: Any) -> Any:
        if isinstance(value, dict):
            return {names.get(key, key): renamed(item) for key, item in value.items()}
        if isinstance(value, list):
            return [renamed(item) for item in value]
        return HOSTILE if isinstance(value, str) and value != "repairable" else value

    codes = [{**item, "code": f"{item['code']}{HOSTILE}"} for item in summary["reasons"]]
    hostile = renamed({**summary, "reasons": [], "statuses": {HOSTILE: 318}})
    hostile["reasons"] = [{**item, "text": HOSTILE, "unit": HOSTILE} for item in codes]
    hostile["notes"] = [HOSTILE, "\udcff", "\u2028"]
    robot = dataclasses.replace(
        talos, contacts={names[name]: settings for name, settings in talos.contacts.items()}
    )
    for name, new in names.items():
        arrays = {
            key.replace(f"contact.{name}.", f"contact.{new}."): a for key, a in arrays.items()
        }
    arrays["status"] = np.full(len(q), HOSTILE)
    path = tmp_path / "report.html"
    write_page(path, robot, q, arrays, hostile)
    with open_page(path) as tab:
        tab.locator("#clock", has_text="frame 0").wait_for()
        assert HOSTILE in tab.locator("h1").inner_text()
        assert HOSTILE in tab.title()
        assert set(tab.locator("code").all_text_contents()) == {item["code"] for item in codes}
        assert tab.locator(".notes li").all_inner_texts()[:2] == [HOSTILE, "?"]
        assert HOSTILE in tab.locator("#clock").inner_text()
        assert tab.locator("img, main script").count() == 0
        # Plots shorten names.
        legend = tab.locator("#forces .legendtext").all_text_contents()
        assert legend == ["needed"] + 2 * [f"{HOSTILE[:17]}…"]
        labels = tab.locator("#schedule .ytick").all_text_contents()
        assert labels == 3 * [f"{HOSTILE[:17]}…"]
        tab.locator("#schedule .bars path").last.hover(force=True)
        label = tab.locator("#schedule .hoverlayer .hovertext").first
        wait_for(lambda: label.count() and HOSTILE in label.text_content(), "the label")


# ---- Repaired motions ----

# Of another motion than the one beside it: these are texts.
REPAIR = {
    "outcome": "repaired",
    "file": "mended.csv",
    "sha256": "0123456789abcdef",
    "exact": True,
    "verdict_before": "not feasible",
    "codes_before": ["cop_outside", "residual_torque"],
    "verdict": "feasible",
    "codes": ["feasible"],
    "verdict_filtered": "repairable",
    "codes_filtered": ["foot_sliding"],
    "verdict_written": "feasible",
    "codes_written": ["feasible"],
    "missing_before": {"force_rms": 0.0321, "torque_rms": 0.0654, "frames": 263},
    "missing": {"force_rms": 0.00123, "torque_rms": 0.00456, "frames": 7},
    "root": {"rms": 0.0015, "largest": 0.00612, "frame": 30, "time": 1.25},
    "joints": {
        "rms": 0.001,
        "largest": np.pi / 90.0,
        "frame": 36,
        "time": 1.5,
        "joint": "left_knee",
    },
    "com": {"rms": 0.0011, "largest": 0.00527, "frame": 42, "time": 1.75},
    "turn": {"rms": np.pi / 360.0, "largest": np.pi / 120.0, "frame": 48, "time": 2.0},
    "ground_offset": 0.0,
    "ground_tilt": 0.0,
    "stretch": 1.0,
    "limits": {"before": 0.0, "after": 0.0},
    "rungs": [{"name": "balance", "text": "What moves stays."}],
    "stances": {
        **{"count": 12, "held": 10, "largest_speed_before": 0.081, "largest_speed": 0.0123},
        **{"largest_drift_before": 0.0172, "largest_drift": 0.00034},
        **{"largest_sunk_before": 0.0041, "largest_sunk": 0.00021},
        **{"largest_floating_before": 0.0093, "largest_floating": 0.00057},
    },
    "reasons": [],
}
CHANGE_PLOTS = ("change_root", "change_com", "change_joints")


@pytest.fixture(scope="module")
def repaired(talos: Robot) -> tuple[Before, np.ndarray, Arrays, Summary]:
    before, q, arrays, summary = repaired_walk(talos)
    return before, q, arrays, summary | {"repair": REPAIR}


def written(path: Path, talos: Robot, report: Report, before: Before | None) -> str:
    write_page(path, talos, *report, before=before)
    return path.read_text("utf-8")


def section(text: str) -> str:
    """That on repair, without what it looks like."""
    begin = text.index('<section class="repair')
    found = text[begin : text.index("</section>", begin)]
    for tag in ("<b>", "</b>", "<small>", "</small>"):
        found = found.replace(tag, "|" if "small" in tag else "")
    return found.replace("&nbsp;", " ")


def row(text: str, title: str) -> list[str]:
    """The cells of a section's row."""
    cells = text[text.index(f'<th scope="row">{title}</th>') :].split("</tr>")[0]
    return [cell.split("</td>")[0] for cell in cells.split("<td>")[1:]]


def test_the_section_on_repair(talos, repaired, tmp_path, monkeypatch):
    """What there was and is, by how much it was changed, and when the most."""
    monkeypatch.setitem(sys.modules, "viser", None)
    before, *after = repaired
    page = written(tmp_path / "report.html", talos, after, before)
    text = section(page)
    assert page.index('class="repair') < page.index('class="verdict')
    assert 'class="repair good"><h2>Repair: done</h2>' in text
    assert "is the ghost in the scene" in text
    assert "Written to mended.csv, marked as exact" in text
    assert REPAIR["sha256"] in text
    for title, *cells in (
        ("Verdict", "not feasible|cop_outside, residual_torque|", "feasible"),
        ("Verdict, without the mark", "–", "repairable|foot_sliding|"),
        ("Verdict, as it was written", "–", "feasible"),
        ("Residual force (RMS)", "0.0321 m g", "0.00123 m g"),
        ("Residual moment (RMS)", "0.0654 m g·m", "0.00456 m g·m"),
        ("Frames out of reach", "263", "7"),
        ("Contacts slide by up to", "81 mm/s", "12.3 mm/s"),
        ("Contacts drift by up to", "17.2 mm", "0.34 mm"),
        ("Contacts are below the ground by up to", "4.1 mm", "0.21 mm"),
        ("Contacts that carry are above it by up to", "9.3 mm", "0.57 mm"),
    ):
        assert row(text, title) == cells
    for title, rms, largest, time in (
        ("Root displaced", "1.5 mm", "6.12 mm|frame 30|", 1.25),
        ("Centre of mass displaced", "1.1 mm", "5.27 mm|frame 42|", 1.75),
        ("Root turned", "0.5°", "1.5°|frame 48|", 2.0),
        ("Joints turned", "0.0573°", "2°|left_knee, frame 36|", 1.5),
    ):
        *sizes, button = row(text, title)
        assert sizes == [rms, largest]
        assert f'data-time="{time}"' in button
    assert "10 of 12 stances are held still." in text
    assert "<summary>1 step</summary><ol><li>balance What moves stays.</li></ol>" in text
    for nothing in ("limits", "to the ground", "stretched", "besides"):
        assert nothing not in text


def test_what_only_some_repairs_do(talos, repaired, tmp_path, monkeypatch):
    """Joints beyond limits, and what was done to all of the motion; numbers small and large."""
    monkeypatch.setitem(sys.modules, "viser", None)
    before, q, arrays, summary = repaired
    repair = REPAIR | {
        "limits": {"before": np.pi / 60.0, "after": 0.0},
        "ground_offset": -0.0195,
        "ground_tilt": np.pi / 45.0,
        "stretch": 1.25,
        "missing": {"force_rms": 1e-16, "torque_rms": 0.0, "frames": 0},
        "stances": {"largest_speed_before": 1.1172, "largest_speed": 0.0},
    }
    report = (q, arrays, summary | {"repair": repair})
    text = section(written(tmp_path / "report.html", talos, report, before))
    for title, *cells in (
        ("Joints beyond limits by", "3°", "0°"),
        ("Residual force (RMS)", "0.0321 m g", "&lt; 10<sup>−6</sup> m g"),
        ("Residual moment (RMS)", "0.0654 m g·m", "0 m g·m"),
        ("Contacts slide by up to", "1117 mm/s", "0 mm/s"),
    ):
        assert row(text, title) == cells
    moved = "Lifted to the ground by −19.5 mm. Turned to the ground by 4°. "
    stretched = "Time stretched by a factor of 1.25. "
    assert f"{moved}{stretched}The changes above are besides that;" in text
    # Nothing is elsewhere where time is all that was stretched.
    repair |= {"ground_offset": 0.0, "ground_tilt": 0.0}
    report = (q, arrays, summary | {"repair": repair})
    text = section(written(tmp_path / "report.html", talos, report, before))
    assert f'<p class="caption">{stretched}Written' in text


def test_print_and_page_say_the_same(talos, repaired, tmp_path, monkeypatch):
    """Whatever has a title in the printed table has it in the section."""
    monkeypatch.setitem(sys.modules, "viser", None)
    before, q, arrays, summary = repaired
    repair = REPAIR | {
        "limits": {"before": 0.1, "after": 0.0},
        "ground_offset": 0.02,
        "ground_tilt": 0.1,
        "stretch": 1.5,
    }
    summary = summary | {"repair": repair}
    text = section(written(tmp_path / "report.html", talos, (q, arrays, summary), before))
    titles = [title.strip() for title in repair_table(summary).columns[0].cells]
    assert len(titles) > 15
    elsewhere = {
        "Repair": "Repair:",
        "without the mark": "Verdict, without the mark",
        "as it was written": "Verdict, as it was written",
        "Stances held still": "stances are held still",
        "Step: balance": "balance",
    }
    for title in titles:
        assert title == "Note" or elsewhere.get(title, title) in text


def test_what_could_not_be_mended(talos, repaired, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    before, q, arrays, summary = repaired
    reasons = [{"code": "contact_needed", "time": 1.2, "text": "Nothing touches.", "hint": "Luck."}]
    failed = REPAIR | {"outcome": "not repaired", "exact": False, "reasons": reasons}
    report = (q, arrays, summary | {"repair": failed})
    text = section(written(tmp_path / "report.html", talos, report, before))
    assert 'class="repair bad"><h2>Repair: not done</h2>' in text
    assert "Written to mended.csv, without a mark" in text
    (button,) = row(text, "<code>contact_needed</code> Nothing touches.|What may help: Luck.|")
    assert 'data-time="1.2"' in button


def test_nothing_to_repair(talos, repaired, tmp_path, monkeypatch):
    """There is no ghost, although the caller has a motion before; the section says so."""
    monkeypatch.setattr(page_scene, "record", without_before(page_scene.record))
    before, q, arrays, summary = repaired
    report = (q, arrays, summary | {"repair": REPAIR | {"outcome": "feasible"}})
    page = written(tmp_path / "report.html", talos, report, before)
    text = section(page)
    assert 'class="repair good"><h2>Repair: nothing to do</h2>' in text
    assert "Nothing was changed: the motion was feasible as it was. So there is no ghost." in text
    assert "is the ghost" not in text
    assert 'id="ghost"' not in page
    assert 'change_root"' not in page[page.index('id="data"') : page.index('id="numbers"')]
    assert page.count('<figure class="none">') == len(CHANGE_PLOTS)


def without_before(record):
    """A recording that is never asked for a ghost, and is quick."""

    def recorded(robot, q, arrays, summary, rate, *, before):
        assert before is None
        return record(robot, q, arrays, summary, 1.0)

    return recorded


@pytest.mark.parametrize("depth", ["all", "fields"])
def test_of_a_repair_may_be_unknown(talos, repaired, tmp_path, monkeypatch, depth):
    """Anything: dashes, or nothing, stand for it."""
    monkeypatch.setitem(sys.modules, "viser", None)
    before, q, arrays, summary = repaired

    def without(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: without(item) for key, item in value.items()}
        return [without(item) for item in value] if value and isinstance(value, list) else None

    reasons = [{"code": "a", "time": 1.2, "text": "b", "hint": "c"}]
    unknown = without(REPAIR | {"reasons": reasons})
    if depth == "all":
        unknown = dict.fromkeys(REPAIR)
    text = section(
        written(tmp_path / "a.html", talos, (q, arrays, summary | {"repair": unknown}), before)
    )
    assert 'class="repair unknown"><h2>Repair</h2>' in text
    assert "None" not in text
    for nothing in (None, {}):
        report = (q, arrays, summary | {"repair": nothing})
        page = written(tmp_path / "b.html", talos, report, before)
        assert '<section class="repair' not in page
        assert 'id="ghost"' in page


def test_hostile_repairs(talos, repaired, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    before, q, arrays, summary = repaired

    def hostile(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: hostile(item) for key, item in value.items()}
        if isinstance(value, list):
            return [hostile(item) for item in value]
        return HOSTILE if isinstance(value, str) else value

    repair = hostile(REPAIR | {"reasons": [{"code": "a", "time": 1.2, "text": "b", "hint": "c"}]})
    repair |= {key: [f"{HOSTILE}, a code"] for key in repair if key.startswith("codes")}
    path = tmp_path / "report.html"
    write_page(path, talos, q, arrays, summary | {"repair": repair}, before=before)
    with open_page(path) as tab:
        tab.locator("#clock", has_text="frame 0").wait_for()
        assert tab.locator("img, main script").count() == 0
        # The outcome, the file and its sum, four verdicts with their codes, a joint, two texts of a
        # step, and three of a reason.
        assert tab.locator(".repair").text_content().count(HOSTILE) == 17


def test_what_repair_has_changed_is_drawn(talos, repaired, tmp_path, monkeypatch):
    """Over time, and as paths from above; what was missing stands beside what is."""
    monkeypatch.setitem(sys.modules, "viser", None)
    before, q, arrays, summary = repaired
    write_page(tmp_path / "report.html", talos, q, arrays, summary, before=before)
    with open_page(tmp_path / "report.html") as tab:
        tab.locator("#clock", has_text="frame 0").wait_for()

        def traces(plot: str) -> dict[str, np.ndarray]:
            script = (
                "(plot) => document.getElementById(plot).data"
                ".filter(({name, y}) => name && y.length > 1)"
                ".map(({name, y}) => [name, Array.from(y)])"
            )
            return {name: np.array(y, dtype=float) for name, y in tab.evaluate(script, plot)}

        root = 1e3 * np.linalg.norm(q[:, :3] - before.q[:, :3], axis=1)
        assert_allclose(traces("change_root")["root"], root, rtol=1e-3, atol=1e-5)
        com = 1e3 * np.linalg.norm(arrays["com"] - before.arrays["com"], axis=1)
        assert_allclose(traces("change_com")["CoM"], com, rtol=1e-5, atol=1e-5)
        turned = np.degrees(np.abs(q[:, 7:] - before.q[:, 7:]).max(axis=1))
        assert_allclose(traces("change_joints")["joint"], turned, rtol=1e-5, atol=1e-6)
        for name, part in (("force", slice(3)), ("torque", slice(3, 6))):
            drawn = traces(f"residual_{name}")
            assert list(drawn) == ["before", "after"]
            for key, values, weight in (
                ("before", before.arrays, before.summary["weight"]),
                ("after", arrays, summary["weight"]),
            ):
                missing = np.linalg.norm(values["residual"][:, part], axis=1) / weight
                assert_allclose(drawn[key], missing, rtol=1e-5, atol=1e-12)
            assert drawn["before"].max() > 10.0 * drawn["after"].max()
        paths = traces("above")
        for title, values in (("", arrays), (" before", before.arrays)):
            assert_allclose(paths[f"CoM{title}"], values["com"][:, 1], atol=1e-6)
            assert_allclose(paths[f"CoP{title}"], values["cop"][:, 1], rtol=1e-6, atol=1e-6)
        # They can be told apart, in the legend, too.
        lines = tab.evaluate(
            "document.getElementById('above').data.filter(({name}) => /^Co[MP]/.test(name))"
            ".filter(({line}) => line).map(({name, line}) => [name, line.color, line.dash])"
        )
        assert len({color for _, color, _ in lines}) == len(lines) == 4
        assert {name for name, _, dash in lines if dash == "dot"} == {"CoM before", "CoP before"}
        # Times in the section lead there.
        tab.locator(".repair").get_by_role("button").first.click()
        wait_for(lambda: abs(clock(tab) - 1.25) < 0.01, "the clock")


def test_the_ghost_can_be_hidden(talos, repaired, tmp_path):
    """By a box beside the scene; the player goes on from there, with it and without."""
    before, q, arrays, summary = repaired
    moved = before.q.copy()
    moved[:, 1] += 0.3  # so that one sees it
    path = tmp_path / "report.html"
    apart = Before(moved, before.arrays, before.summary)
    write_page(path, talos, q, arrays, summary, before=apart, scene_rate=5.0)
    with open_page(path) as tab:
        tab.set_viewport_size({"width": 1280, "height": 1600})
        open_scene(tab)
        shown = settled_picture(tab, "#scene")
        assert blue_share(shown) > 0.02
        tab.locator("#ghost").uncheck()
        hidden = settled_picture(tab, "#scene")
        assert difference(shown, hidden) > 0.02
        assert blue_share(hidden) < 0.2 * blue_share(shown)
        tab.locator("#slider").fill("150")
        wait_for(lambda: clock(tab) == pytest.approx(arrays["time"][150], abs=1e-3), "the clock")
        assert blue_share(settled_picture(tab, "#scene")) < 0.2 * blue_share(shown)
        tab.locator("#slider").fill("0")
        tab.locator("#ghost").check()
        assert difference(shown, settled_picture(tab, "#scene")) < 1e-3


def blue_share(seen: np.ndarray) -> float:
    """The share of the pixels that have the ghost's hue."""
    red, green, blue = np.moveaxis(seen, 2, 0)
    return float(np.mean((blue - red > 0.08) & (blue - green > 0.04)))


# ---- What is in it ----


def test_size(hurried_page):
    """Plotly and viser, which every page has, leave room for half a minute in 12 MB."""
    assert hurried_page.stat().st_size < 6e6


def test_size_with_a_ghost(talos, repaired, tmp_path):
    """Whose meshes are those of the robot, which are not there twice."""
    before, *after = repaired
    paths = [tmp_path / f"{name}.html" for name in ("alone", "compared")]
    for path, motion in zip(paths, (None, before), strict=True):
        write_page(path, talos, *after, before=motion, scene_rate=5.0)
    alone, compared = (path.stat().st_size for path in paths)
    assert compared < 1.15 * alone


def test_feasible_walk(talos, tmp_path, monkeypatch):
    """No reason stands open, and what there is not is not there."""
    monkeypatch.setitem(sys.modules, "viser", None)
    q, arrays, summary = walk_report(talos)
    tried = {"cutoff": 6.0, "residual_force_rms": 0.1, "residual_torque_rms": 0.02}
    tried |= {"verdict": "feasible", "codes": ["feasible"], "relaxed_share": 0.1}
    filtered = summary | {"cutoff": 6.0, "cutoff_sensitivity": [tried]}
    write_page(tmp_path / "full.html", talos, q, arrays, filtered)
    arrays = {name: array for name, array in arrays.items() if "measured" not in name}
    none = {"notes": [], "cutoff_sensitivity": [], "measured": {}, "ground": {}, "cutoff": None}
    none["distance"] = None
    write_page(tmp_path / "bare.html", talos, q, arrays, summary | none)
    full, bare = ((tmp_path / f"{name}.html").read_text("utf-8") for name in ("full", "bare"))
    for text in (full, bare):
        assert '<section class="verdict good"><h2>Feasible</h2><p class="caption' in text
        assert summary["feasible_share"] == 1.0
        assert "100.0&nbsp;% of the frames" in text
        times = 2 * len(summary["windows"]) + len(summary["reasons"])
        assert text.count('class="time"') == times
        assert text.count("<code>") == len(summary["reasons"])
    for title in (
        *("How it depends on the filter", "Computed against the file's forces"),
        *(
            '<p class="caption distance">Distance: 0 mm: the contacts',
            "feasible CoM",
            '<figure class="">',
        ),
    ):
        assert title in full
        assert title not in bare


@pytest.mark.parametrize(("verdict", "kind"), [("repairable", "fair"), ("not feasible", "bad")])
def test_what_is_not_feasible(talos, hurried, tmp_path, monkeypatch, verdict, kind):
    """What is repairable has a colour of its own; the reasons that hold stand open."""
    monkeypatch.setitem(sys.modules, "viser", None)
    q, arrays, summary = hurried
    held = sum(item["holds"] for item in summary["reasons"])
    assert held > 0
    write_page(tmp_path / "report.html", talos, q, arrays, summary | {"verdict": verdict})
    text = (tmp_path / "report.html").read_text("utf-8")
    assert f'<section class="verdict {kind}"><h2>{verdict.capitalize()}</h2>' in text
    opened = text[text.index(f'class="verdict {kind}"') : text.index("<details>")]
    assert opened.count("<code>") == held
    largest = arrays["distance"].max()
    assert 0.001 < largest < 0.01
    assert f"{1e3 * largest:.1f} mm at most, at <button" in opened
    assert f'data-time="{summary["distance"]["time"]!r}"' in opened
    assert summary["distance"]["time"] == arrays["time"][np.argmax(arrays["distance"])]


def test_the_distance_is_drawn(talos, hurried, tmp_path, monkeypatch):
    """Over time in millimetres, and as a path beside the CoM's, if there is one."""
    monkeypatch.setitem(sys.modules, "viser", None)
    q, arrays, summary = hurried
    script = (
        "Array.from(document.getElementById('above').data.filter((trace) => trace.name === '{}'),"
        " (trace) => Array.from(trace.y))[0]"
    )
    write_page(tmp_path / "report.html", talos, q, arrays, summary)
    with open_page(tmp_path / "report.html") as tab:
        tab.locator("#clock", has_text="frame 0").wait_for()
        drawn = tab.evaluate("Array.from(document.getElementById('distance').data[0].y)")
        assert_allclose(drawn, 1e3 * arrays["distance"], rtol=1e-6)
        for name, title in (("com", "CoM"), ("feasible_com", "feasible CoM")):
            assert_allclose(tab.evaluate(script.format(title)), arrays[name][:, 1], atol=1e-6)
    write_page(tmp_path / "report.html", talos, q, arrays, summary | {"distance": None})
    with open_page(tmp_path / "report.html") as tab:
        tab.locator("#clock", has_text="frame 0").wait_for()
        assert not tab.locator("#distance").is_visible()
        assert tab.evaluate(script.format("feasible CoM")) is None
        assert tab.locator("#residual_torque .js-line").count() == 1


def test_unknown(talos, tmp_path, monkeypatch):
    """What would hold is only shown."""
    monkeypatch.setitem(sys.modules, "viser", None)
    q, arrays, summary = walk_report(talos)
    for item in summary["reasons"]:
        item["holds"] = True
    unknown = {"verdict": "unknown", "distance": None, "windows": [], "feasible_share": 0.0}
    write_page(tmp_path / "report.html", talos, q, arrays, summary | unknown)
    text = (tmp_path / "report.html").read_text("utf-8")
    assert '<section class="verdict unknown"><h2>Unknown</h2><p><code>too_short</code>' in text
    assert text.index("<summary>What was measured") < text.index("<code>residual_force")


def test_without_viser(talos, hurried, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    write_page(tmp_path / "report.html", talos, *hurried)
    assert (
        "<li>There is no 3D scene: the 3D scene needs viser, which is not installed: "
        "pip install dynacom[motion].</li>"
    ) in (tmp_path / "report.html").read_text("utf-8")


def test_without_plotly(talos, hurried, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    with pytest.raises(DynacomError, match=r"plotly, which is not .*: pip install dynacom\[motion"):
        write_page(tmp_path / "report.html", talos, *hurried)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.12345, "0.123 kg"),
        (-2.0, "−2 kg"),
        (0.0, "0 kg"),
        (6.34e-16, "6.34·10<sup>−16</sup> kg"),
        (None, "–"),
        (np.nan, "–"),
    ],
)
def test_numbers(value, text):
    assert page_html.number_text(value, "kg").replace("&nbsp;", " ") == text


@pytest.mark.parametrize(
    ("share", "text"), [(0.0, "0.0 %"), (0.0004, "&lt; 0.1 %"), (0.05, "5.0 %"), (1.0, "100.0 %")]
)
def test_shares(share, text):
    assert page_html.percent_text(share).replace("&nbsp;", " ") == text
