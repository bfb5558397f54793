"""The site in a real browser: no script error, nothing fetched, nothing wider than a phone, every control works."""

import json
import re
import shutil
import subprocess
from html import unescape
from pathlib import Path

import pytest
from PIL import Image

from polhode.harness import site

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --host-resolver-rules=MAP%*%~NOTFOUND --virtual-time-budget=20000"
)
WIDTHS = (390, 1100)
PAGES = ("index", "cost", "hard-cases", "own", "motion")

# Put at the head of each page: keeps what goes wrong.
WATCH = """
window.wrong = [];
addEventListener("error", (e) => wrong.push(String(e.message || e.target.src)), true);
addEventListener("unhandledrejection", (e) => wrong.push(String(e.reason)));
addEventListener("securitypolicyviolation", (e) => wrong.push("blocked: " + e.blockedURI));
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
  for (const head of document.querySelectorAll("table.sort th")) { head.click(); head.click(); }
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
  const words = document.querySelector(".tools input");
  if (words) {
    const filter = (text) => { words.value = text; words.dispatchEvent(new Event("input")); };
    filter("7.0e-9");
    const shown = words.closest(".tools").nextElementSibling.querySelectorAll("tbody tr:not([hidden])");
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
  }
  seen.finding = document.getElementById("finding")?.textContent;
  seen.failures = document.getElementById("failures")?.textContent;
  seen.fetched = performance.getEntriesByType("resource").map((e) => e.name);
  seen.wrong = wrong;
  parent.postMessage(JSON.stringify(seen), "*");
});
"""
HOST = """<!doctype html><body><script>
const found = [];
addEventListener("message", (e) => {
  found.push(JSON.parse(e.data));
  document.body.dataset.found = JSON.stringify(found);
});
</script>%s</body>"""

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt-get install chromium")


@pytest.fixture(scope="module")
def seen(
    tmp_path_factory: pytest.TempPathFactory, site_pages: dict[str, str]
) -> dict[tuple[str, int], dict]:
    """What every page tells at every width, all in one start of the browser."""
    folder = tmp_path_factory.mktemp("browser")
    (folder / "site" / "figures").mkdir(parents=True)
    Image.new("RGB", (4, 4)).save(folder / "site" / "figures" / "own-drawn.webp")
    for file in Path(site.__file__).parent.glob("*.[cj]s*"):
        shutil.copy(file, folder / "site")
    for name, script in (("watch", WATCH), ("work", WORK)):
        (folder / "site" / f"{name}.js").write_text(script, encoding="utf-8")
    for name, page in site_pages.items():
        watched = page.replace("<head>", '<head><script src="watch.js"></script>')
        watched = watched.replace("</body>", '<script src="work.js"></script></body>')
        (folder / "site" / f"{name}.html").write_text(watched, encoding="utf-8")
    frames = "".join(
        f'<iframe src="site/{name}.html" style="width:{width}px;height:900px"></iframe>'
        for name in PAGES
        for width in WIDTHS
    )
    (folder / "host.html").write_text(HOST % frames, encoding="utf-8")
    flags = [flag.replace("%", " ") for flag in FLAGS.split()]
    command = [
        str(CHROMIUM),
        *flags,
        f"--user-data-dir={folder / 'profile'}",
        "--dump-dom",
        f"file://{folder}/host.html",
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    found = re.search(r'data-found="([^"]*)"', done.stdout)
    assert found, done.stderr[-2000:]
    return {
        (Path(each["name"]).stem, each["width"]): each for each in json.loads(unescape(found[1]))
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


def test_a_table_of_many_rows_is_filtered_and_the_address_keeps_it(
    seen: dict[tuple[str, int], dict],
):
    page = seen["own", 1100]
    assert sorted(page["filtered"]) == ["g", "h"]
    assert page["kept"] == "#rows0=7.0e-9"


def test_the_page_of_costs_names_the_cheapest(seen: dict[tuple[str, int], dict]):
    assert re.search(
        r"Cheapest, by error reached\. .*: [\w-]+ by [\w-]+, \S+ \S*s",
        seen["cost", 1100]["finding"],
    )


def test_the_sphere_turns(seen: dict[tuple[str, int], dict]):
    assert seen["motion", 390]["turned"]
