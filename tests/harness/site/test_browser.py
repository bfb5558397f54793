"""The site in a real browser: no script error, nothing fetched, nothing wider than a phone, every control works."""

import re
import shutil
from pathlib import Path

import pytest
from browsers import CHROMIUM, told

WIDTHS = (390, 1100)
PAGES = (
    "index",
    "cost",
    "reports/hard-cases/README",
    "reports/own/README",
    "motion",
    "search",
)
QUERIES = {"search": "?q=particle"}

# Put at the head of each page: keeps what goes wrong.
WATCH = """
window.wrong = [];
addEventListener("error", (e) => wrong.push(String(e.message || e.target.src)), true);
addEventListener("unhandledrejection", (e) => wrong.push(String(e.reason)));
"""
# Put at its end: works every control, then tells the page around it.
WORK = """
addEventListener("load", () => {
  const seen = { name: location.pathname, width: innerWidth, tips: [], marks: 0 };
  const wide = () => document.documentElement.scrollWidth > innerWidth + 1;
  seen.wide = wide();
  for (const select of document.querySelectorAll("select"))
    for (const option of select.options) {
      option.selected = true;
      select.dispatchEvent(new Event("change"));
    }
  for (const select of document.querySelectorAll("select")) {
    select.selectedIndex = 0;
    select.dispatchEvent(new Event("change"));
  }
  for (const box of document.querySelectorAll("input[type=checkbox]")) { box.click(); box.click(); }
  for (const head of document.querySelectorAll("table.docutils thead th")) { head.click(); head.click(); }
  for (const range of document.querySelectorAll("input[type=range]")) {
    range.value = range.max;
    range.dispatchEvent(new Event("input"));
  }
  const key = (target, name) => target.dispatchEvent(new KeyboardEvent("keydown", { key: name, bubbles: true }));
  for (const svg of document.querySelectorAll(".plot svg")) {
    for (const name of ["ArrowRight", "ArrowRight", "ArrowDown"]) key(svg, name);
    const tip = svg.parentElement.querySelector(".tip");
    if (!tip.hidden) seen.tips.push(tip.textContent);
    seen.marks += svg.querySelectorAll("path[transform]").length;
    key(svg, "Escape");
    if (!tip.hidden) wrong.push("Escape leaves the tooltip");
  }
  for (const canvas of document.querySelectorAll("canvas")) {
    const before = canvas.toDataURL();
    key(canvas, "ArrowLeft");
    seen.turned = canvas.toDataURL() !== before;
  }
  seen.wide ||= wide();
  const [tag, scene] = document.querySelectorAll("#filters select");
  if (tag) {
    tag.value = "hard";
    tag.dispatchEvent(new Event("change"));
    seen.tagged = [...scene.options].map((option) => option.value);
    tag.value = "";
    tag.dispatchEvent(new Event("change"));
    seen.all = [...scene.options].map((option) => option.value);
    // A finger touches a point and is lifted.
    const svg = document.querySelector("#cost-chart svg");
    const { left, top, width, height } = svg.querySelector("path[transform]").getBoundingClientRect();
    const touch = { pointerType: "touch", bubbles: true, clientX: left + width / 2, clientY: top + height / 2 };
    svg.dispatchEvent(new PointerEvent("pointerdown", touch));
    svg.dispatchEvent(new PointerEvent("pointerleave", touch));
    seen.touched = svg.parentElement.querySelector(".tip:not([hidden])")?.textContent;
  }
  const stops = (root) => [...root.querySelectorAll("a, button, th")].filter((item) => item.tabIndex === 0).length;
  const map = document.querySelector("section.region:not([hidden]) table.map");
  if (map) {
    seen.stops = [stops(map)];
    map.querySelector("a").focus();
    for (const name of ["ArrowRight", "ArrowDown", "ArrowLeft"]) key(document.activeElement, name);
    seen.stops.push(stops(map));
    seen.moved = [document.activeElement.closest("tr").rowIndex, document.activeElement.closest("td").cellIndex];
  }
  const words = document.querySelector(".tools input");
  if (words) {
    const filter = (text) => { words.value = text; words.dispatchEvent(new Event("input")); };
    filter("7.0e-9");
    const table = words.closest(".tools").nextElementSibling;
    const shown = table.querySelectorAll("tbody tr:not([hidden])");
    seen.headStops = stops(table);
    seen.filtered = [...shown].map((row) => row.textContent.trim()[0]);
    seen.kept = location.hash;
    filter("");
  }
  if (document.getElementById("ask")) {
    // Questions typed, and one asked by a cell of the map.
    const [stokes, error] = document.querySelectorAll("#ask input");
    const type = (field, text) => { field.value = text; field.dispatchEvent(new Event("input")); };
    type(stokes, "fast");
    seen.refused = document.getElementById("answer").textContent;
    type(stokes, "100");
    type(error, "1 %");
    seen.asked = document.querySelector("#answer .first")?.textContent;
    seen.address = location.hash;
    seen.shown = document.querySelectorAll("section.region:not([hidden])").length;
    // Between two St that were measured, and beyond all of them.
    type(stokes, "70");
    seen.between = [...document.querySelectorAll("#answer .first")].map((line) => line.textContent);
    type(stokes, "1e12");
    seen.beyond = document.getElementById("answer").textContent;
  }
  seen.finding = document.getElementById("finding")?.textContent;
  seen.failures = document.getElementById("failures")?.textContent;
  seen.results = [...document.querySelectorAll("#search-results li a")].map((link) => link.textContent);
  seen.fetched = performance.getEntriesByType("resource").map((e) => e.name);
  seen.wrong = wrong;
  parent.postMessage(JSON.stringify(seen), "*");
});
"""
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt-get install chromium")


@pytest.fixture(scope="module")
def seen(
    tmp_path_factory: pytest.TempPathFactory, site_folder: Path
) -> dict[tuple[str, int], dict]:
    """What every page tells at every width, all in one start of the browser."""
    folder = tmp_path_factory.mktemp("browser") / "site"
    shutil.copytree(site_folder, folder)
    for file in folder.rglob("*.html"):
        page = file.read_text(encoding="utf-8")
        page = page.replace("<head>", f"<head><script>{WATCH}</script>")
        page = page.replace("</body>", f"<script>{WORK}</script></body>")
        file.write_text(page, encoding="utf-8")
    frames = [
        (f"{name}.html{QUERIES.get(name, '')}", width, 900) for name in PAGES for width in WIDTHS
    ]
    return {
        (page["name"].partition("/site/")[2].removesuffix(".html"), page["width"]): page
        for page in told(folder, frames)
    }


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", PAGES)
def test_page_works(seen: dict[tuple[str, int], dict], name: str, width: int):
    page = seen[name, width]
    assert page["wrong"] == []
    assert all(url.startswith(("file:", "data:")) for url in page["fetched"])
    assert not page["wide"]


def test_diagrams_are_read_by_keyboard(seen: dict[tuple[str, int], dict]):
    page = seen["cost", 390]
    assert page["marks"] > 3
    assert page["tips"]
    assert all(re.search(r"\d", tip) for tip in page["tips"])


def test_tooltip_of_a_run_tells_method_error_time_and_calls(seen: dict[tuple[str, int], dict]):
    (tip,) = seen["cost", 1100]["tips"]
    for pattern in (
        r"(quaternion|averaged), [\w-]+ at tolerance",
        r"error of L and E \d",
        r"time [\d.]+ ",
        r"right-hand-side calls \S+.*, steps \d",
    ):
        assert re.search(pattern, tip), tip


def test_a_tag_chooses_scenes(seen: dict[tuple[str, int], dict]):
    page = seen["cost", 1100]
    assert page["tagged"] == ["hard-cases: paper"]
    assert {"bench: paper", "hard-cases: paper"} < set(page["all"])


def test_what_a_finger_chose_stays(seen: dict[tuple[str, int], dict]):
    assert " at tolerance " in seen["cost", 390]["touched"]


def test_failures_are_listed(seen: dict[tuple[str, int], dict]):
    assert "time limit" in seen["cost", 390]["failures"]


def test_a_question_is_answered_and_kept_in_the_address(seen: dict[tuple[str, int], dict]):
    page = seen["index", 390]
    assert "positive numbers" in page["refused"]
    said = r"(At St = \S+: )?Run [\w-]+ by [\w-]+ at tolerance \S+: \S+ \S+\."
    assert re.fullmatch(said, page["asked"])
    assert "St=100" in page["address"]
    assert page["shown"] == 1


def test_both_neighbours_answer_and_pick_is_named_beyond(seen: dict[tuple[str, int], dict]):
    page = seen["index", 390]
    assert [line.split(":")[0] for line in page["between"]] == ["At St = 50", "At St = 100"]
    assert "St = 1e12 lies beyond what was measured." in page["beyond"]
    assert "polhode pick scene.toml --error 0.01 --want slow" in page["beyond"]


def test_a_table_of_many_rows_is_filtered_and_the_address_keeps_it(
    seen: dict[tuple[str, int], dict],
):
    page = seen["reports/own/README", 1100]
    assert sorted(page["filtered"]) == ["g", "h"]
    assert page["kept"] == "#rows0=7.0e-9"


def test_the_page_of_costs_names_the_cheapest(seen: dict[tuple[str, int], dict]):
    assert re.search(
        r"Cheapest, by error reached\. .*: [\w-]+ by [\w-]+, \S+ \S*s",
        seen["cost", 1100]["finding"],
    )


def test_the_sphere_turns(seen: dict[tuple[str, int], dict]):
    assert seen["motion", 390]["turned"]


def test_the_search_finds_without_a_server(seen: dict[tuple[str, int], dict]):
    assert "My own <study>" in seen["search", 390]["results"]


def test_a_map_and_the_headers_of_a_table_are_one_tab_stop_each(seen: dict[tuple[str, int], dict]):
    page = seen["index", 1100]
    assert page["stops"] == [1, 1]
    assert page["moved"] == [2, 1]
    assert seen["reports/own/README", 1100]["headStops"] == 1
