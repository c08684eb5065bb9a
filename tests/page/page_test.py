"""The review page in a real browser: `cargo xtask page-test`.

What the page shows is held against what `tilefold export` says of the same store, and what it
decides against the file of decisions and the exports made with it. Nothing is mocked: a city is
simulated, run twice, served, and opened in Chromium; then written as a folder and opened from there.
"""

import argparse
import contextlib
import http.client
import json
import shutil
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path

from playwright.sync_api import sync_playwright

HOSTILE = "<img src=x onerror=document.title='hacked'>"
BROWSER = (
    "--no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --disable-quic"
    " --no-first-run --disable-background-networking --disable-component-update --disable-sync"
).split()


class Bench:
    """The store, the program and the browser that the tests share."""

    def __init__(self, tilefold, browser, folder):
        self.tilefold, self.browser, self.folder = tilefold, browser, folder
        self.store = folder / "store"
        self.page = None
        self.asked, self.complaints = [], []

    def run(self, *words):
        done = subprocess.run([self.tilefold, *map(str, words)], capture_output=True, text=True)
        assert done.returncode in (0, 3), f"{words}: {done.stderr}"
        return done.stdout

    def make_store(self):
        """Two nights of logs; one log has a name that would be markup if anybody let it."""
        city = self.folder / "city"
        self.run("simulate", city, "--km", 2.5, "--vehicles", 14, "--drives", 28, "--changes", 0.1, "--seed", 5)
        logs = sorted((city / "logs").glob("*.mcap"))
        for log in logs[::2]:
            log.rename(log.with_name(f"{HOSTILE} {log.name}"))
        logs = sorted((city / "logs").glob("*.mcap"))
        self.run("init", self.store, "--map", city / "before.osm")
        self.run("run", self.store, *logs[: len(logs) // 2])
        self.run("run", self.store, *logs)

    def records(self, version=None, *more):
        words = ["export", self.store, "--format", "geojson", *more]
        if version is not None:
            words += ["--version", version]
        return [feature["properties"] for feature in json.loads(self.run(*words))["features"]]

    def open(self, url, **how):
        how.setdefault("viewport", {"width": 1280, "height": 860})
        if self.page:
            self.page.context.close()
        self.asked.clear()
        self.complaints.clear()
        self.page = self.browser.new_context(accept_downloads=True, **how).new_page()
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", lambda said: said.type == "error" and self.complaints.append(said.text))
        self.page.goto(url)
        self.page.wait_for_selector("html[data-ready]", state="attached", timeout=60_000)
        assert self.page.get_attribute("html", "data-ready") == "yes", self.page.inner_text("body")
        self.settle()

    def settle(self):
        self.page.evaluate("() => new Promise((done) => tilefold.map.loaded() && tilefold.map.areTilesLoaded() ? done() : tilefold.map.once('idle', done))")

    def shown(self):
        """Ids in the list, in its order."""
        return self.page.evaluate("tilefold.state.shown.map((at) => tilefold.state.layer.change[at])")

    def drawn(self):
        """Ids that the map draws, as lines, areas or dots."""
        self.settle()
        return set(self.page.evaluate(
            """() => tilefold.map.queryRenderedFeatures({layers: ['changes', 'changes-gone', 'changes-fill', 'dots']})
            .map((feature) => tilefold.state.layer.change[feature.id])"""))

    def chip(self, name):
        self.page.evaluate("document.getElementById('filters').open = true")
        self.page.click(f"#filters .chip[data-name={name}]")
        self.frame()

    def slide(self, id, value):
        self.page.evaluate("([id, value]) => { const s = document.getElementById(id); s.value = value; s.dispatchEvent(new Event('input')); }", [id, value])
        self.frame()

    def frame(self):
        """The page filters once a frame."""
        self.page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def claims(records, least=0.5):
    said = {"added", "removed", "modified"}
    return {r["change"]: r for r in records if r["change_type"] in said and round(r[f"p_{r['change_type']}"], 3) >= least}


@contextlib.contextmanager
def served(bench, *more):
    process = subprocess.Popen([bench.tilefold, "serve", bench.store, "--port", "0", *more], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        yield process.stdout.readline().strip()
    finally:
        process.kill()
        process.wait()


def ask(url, path, method="GET", body=None, **headers):
    host = url.split("/")[2]
    connection = http.client.HTTPConnection(host, timeout=10)
    headers = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.putrequest(method, path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    if body is not None:
        connection.putheader("Content-Length", str(len(body)))
    connection.endheaders(body)
    answer = connection.getresponse()
    return answer.status, answer.read(), dict(answer.getheaders())


# Served


def test_the_list_and_the_map_show_what_the_export_says(bench, url):
    bench.open(url)
    wanted = set(claims(bench.records(None, "--all")))
    assert len(wanted) >= 5, "the city has too few changes for this test"
    assert set(bench.shown()) == wanted
    assert bench.drawn() == wanted
    rows = bench.page.locator("#list .item").count()
    assert 0 < rows <= len(wanted) + 8
    tiles = [asked for asked in bench.asked if "/data/map/" in asked]
    assert tiles, "no tile of the map was asked for"
    drawn = bench.page.evaluate("tilefold.map.queryRenderedFeatures({layers: ['lines', 'dashed-lines']}).length")
    assert drawn > 10, f"only {drawn} lines of the map are drawn"


def test_filters_choose_in_the_list_and_on_the_map(bench, url):
    bench.open(url)
    everything = bench.records(None, "--all")
    for name in ("added", "modified"):
        bench.chip(name)
    wanted = {id for id, r in claims(everything).items() if r["change_type"] == "removed"}
    assert wanted and set(bench.shown()) == wanted and bench.drawn() == wanted
    bench.slide("posterior", 95)
    wanted = {id for id, r in claims(everything, 0.95).items() if r["change_type"] == "removed"}
    assert set(bench.shown()) == wanted and bench.drawn() == wanted
    bench.page.click("#filter-reset")
    bench.frame()
    bench.chip("lane_marking")
    wanted = {id for id, r in claims(everything).items() if r["kind"] != "lane_marking"}
    assert set(bench.shown()) == wanted and bench.drawn() == wanted
    bench.page.click("#filter-reset")
    bench.frame()
    bench.slide("vehicles", 6)
    wanted = {id for id, r in claims(everything).items() if r["vehicles"] >= 6}
    assert set(bench.shown()) == wanted and bench.drawn() == wanted


def test_unknown_is_shown_and_is_never_no_change(bench, url):
    bench.open(url)
    everything = bench.records(None, "--all")
    unknown = {r["change"] for r in everything if r["change_type"] == "unknown"}
    for name in ("added", "removed", "modified"):
        bench.chip(name)
    bench.chip("unknown")
    assert set(bench.shown()) == unknown
    count = bench.page.inner_text("#verdicts .chip[data-name=unknown] .number")
    assert count == str(len(unknown))
    same = {r["change"] for r in everything if r["change_type"] == "no_change"}
    held = set(bench.page.evaluate("tilefold.state.layer.change"))
    assert not held & same and held == {r["change"] for r in everything} - same


def test_a_click_on_the_map_tells_why(bench, url):
    bench.open(url)
    found = claims(bench.records(None, "--all"))
    id, record = next((id, r) for id, r in found.items() if r["change_type"] == "removed" and r["kind"] == "lane_marking")
    at = bench.page.evaluate(
        """(id) => { const { state, map } = tilefold; const at = state.layer.change.indexOf(id);
        const line = state.shownGeometry(state.layer, at).coordinates; map.jumpTo({ center: line[0], zoom: 18 });
        const [a, b] = line; const { x, y } = map.project([(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]);
        const box = map.getCanvas().getBoundingClientRect(); return [box.left + x, box.top + y]; }""", id)
    bench.settle()
    bench.page.mouse.click(*at)
    bench.page.wait_for_selector("#detail table")
    panel = bench.page.inner_text("#detail")
    assert id in panel and f"element {record['element_id']}" in panel, panel
    assert "Lane marking removed" in panel
    told = json.loads(bench.run("explain", bench.store, id, "--format", "json"))[0]
    bench.page.evaluate("document.querySelector('#detail .why .link')?.click()")
    assert bench.page.locator("#detail table tbody tr").count() == len(told["passes"])
    assert bench.page.locator("#detail .chart circle").count() == len(told["passes"])
    assert told["passes"][0]["why"] in bench.page.inner_text("#detail table")
    bar = bench.page.evaluate("document.querySelector('#detail .bar.removed').style.width")
    assert abs(float(bar.rstrip("%")) - 100 * record["p_removed"]) < 0.06, bar
    drawn = bench.page.evaluate("tilefold.map.querySourceFeatures('chosen').map((f) => f.properties.role)")
    assert "old" in drawn


def test_names_from_data_stay_text(bench, url):
    bench.open(url)
    found = claims(bench.records(None, "--all"))
    seen = False
    for id in found:
        told = json.loads(bench.run("explain", bench.store, id, "--format", "json"))[0]
        if not any(HOSTILE in (frame["log"] or "") for frame in told["frames"]):
            continue
        seen = True
        bench.page.evaluate("(id) => tilefold.state.choose(tilefold.state.layer.change.indexOf(id))", id)
        bench.page.wait_for_selector("#detail .frames")
        assert HOSTILE in bench.page.inner_text("#detail .frames")
        break
    assert seen, "no frame is of a log with a hostile name"
    assert bench.page.locator("#detail img").count() == 0
    assert "hacked" not in bench.page.title()


def test_a_decision_is_kept_and_exported(bench, url):
    bench.open(url)
    first, second = bench.shown()[:2]
    bench.page.keyboard.press("j")
    bench.page.wait_for_selector("#detail .decide")
    bench.page.keyboard.press("n")
    bench.page.keyboard.type(f"{HOSTILE} seen on site")
    bench.page.fill("#reviewer", "Ada")
    bench.page.keyboard.press("Escape")
    bench.page.keyboard.press("a")
    bench.page.wait_for_function("(id) => tilefold.state.decisions.has(id)", arg=first)
    chosen = bench.page.evaluate("tilefold.state.layer.change[tilefold.state.chosen]")
    assert chosen == second, "the page did not go on to the next"
    bench.page.keyboard.press("r")
    bench.page.wait_for_function("(id) => tilefold.state.decisions.has(id)", arg=second)
    lines = [json.loads(line) for line in (bench.store / "decisions.jsonl").read_text().splitlines()]
    assert [(d["change"], d["decision"], d["reviewer"]) for d in lines] == [(first, "accept", "Ada"), (second, "reject", "Ada")]
    assert lines[0]["note"] == f"{HOSTILE} seen on site" and lines[0]["version"] == 3
    bench.open(url)
    bench.page.keyboard.press("j")
    bench.page.wait_for_selector("#detail .said.accept")
    assert bench.page.input_value("#note") == f"{HOSTILE} seen on site"
    assert "hacked" not in bench.page.title()
    reviewed = {r["change"]: r.get("review_decision") for r in bench.records()}
    assert reviewed[first] == "accept" and reviewed[second] == "reject"
    assert [r["change"] for r in bench.records(None, "--accepted")] == [first]
    osc = bench.run("export", bench.store, "--format", "osc", "--map", bench.folder / "city/before.osm", "--accepted")
    assert osc.count("<osmChange") == 1 and any(tag in osc for tag in ("<create", "<modify", "<delete"))
    bench.chip("open")
    assert set(bench.shown()) == {first, second}
    bench.page.click("#filter-reset")
    bench.frame()
    bench.page.evaluate("(id) => tilefold.state.choose(tilefold.state.layer.change.indexOf(id))", first)
    bench.page.click("text=Take back")
    bench.page.wait_for_function("(id) => !tilefold.state.decisions.has(id)", arg=first)
    assert bench.records(None, "--accepted") == []


def test_the_slider_goes_back_to_an_older_version(bench, url):
    bench.open(url)
    bench.page.focus("#version")
    bench.page.keyboard.press("ArrowLeft")
    bench.page.wait_for_function("() => tilefold.state.layer.version === 2")
    bench.frame()
    wanted = set(claims(bench.records(2, "--all")))
    assert set(bench.shown()) == wanted and bench.drawn() == wanted
    assert "2 ·" in bench.page.inner_text("#version-said")


def test_coverage_shows_where_nobody_looked(bench, url):
    bench.open(url)
    bench.page.keyboard.press("c")
    bench.page.wait_for_selector("#places:not([hidden])")
    bench.settle()
    cells = bench.page.evaluate("tilefold.map.querySourceFeatures('coverage').length")
    assert cells > 20
    coverage = json.loads(ask(url, "/data/coverage/3")[1])
    assert len(coverage["column"]) == len(coverage["vehicles"]) and coverage["zoom"] == 20
    assert max(coverage["vehicles"]) <= 14
    assert bench.page.locator("#places li").count() == len(coverage["places"])


def test_keys_go_through_the_list_and_find(bench, url):
    bench.open(url)
    shown = bench.shown()
    for key, place in (("j", 0), ("j", 1), ("j", 2), ("k", 1)):
        bench.page.keyboard.press(key)
        assert bench.page.evaluate("tilefold.state.layer.change[tilefold.state.chosen]") == shown[place]
    bench.page.keyboard.press("Escape")
    assert bench.page.is_hidden("#detail")
    bench.page.keyboard.press("/")
    bench.page.keyboard.type(shown[-1][:9])
    bench.page.keyboard.press("Enter")
    assert bench.page.evaluate("tilefold.state.layer.change[tilefold.state.chosen]") == shown[-1]


def test_nothing_is_out_of_place_on_a_small_screen(bench, url):
    for scheme in ("light", "dark"):
        bench.open(url, viewport={"width": 390, "height": 844}, color_scheme=scheme)
        wide = bench.page.evaluate("document.documentElement.scrollWidth")
        assert wide <= 390, f"the page is {wide} pixels wide"
        bench.page.click("#list .item")
        for id in ("say-accept", "say-reject", "say-later"):
            box = bench.page.locator(f"#{id}").bounding_box()
            assert box["y"] + box["height"] <= 844 and box["x"] + box["width"] <= 390 and box["height"] >= 36, box


def test_nothing_is_loaded_from_elsewhere_and_nothing_complains(bench, url):
    bench.open(url)
    bench.page.keyboard.press("j")
    bench.page.wait_for_selector("#detail .why section")
    bench.page.keyboard.press("c")
    bench.page.wait_for_selector("#places:not([hidden])")
    elsewhere = [asked for asked in bench.asked if not asked.startswith((url, "data:", f"blob:{url[:-1]}"))]
    assert not elsewhere, elsewhere
    assert not bench.complaints, bench.complaints


def test_the_policy_stops_scripts_that_are_not_the_pages(bench, url):
    bench.open(url)
    ran = bench.page.evaluate(
        """() => { const script = document.createElement('script'); script.textContent = 'globalThis.ran = true';
        document.head.append(script); const div = document.createElement('div'); div.setAttribute('onclick', 'globalThis.ran = true');
        document.body.append(div); div.click(); return globalThis.ran === true; }""")
    assert not ran
    assert any("Content Security Policy" in said or "script-src" in said for said in bench.complaints), bench.complaints
    policy = ask(url, "/")[2]["content-security-policy"]
    assert "default-src 'none'" in policy and "unsafe" not in policy


def test_other_sites_and_paths_do_not_get_in(bench, url):
    host = url.split("/")[2]
    for name in ("evil.example", f"evil.example:{host.split(':')[1]}", "127.0.0.1.evil.example"):
        assert ask(url, "/data/index", Host=name)[0] == 403, name
    assert ask(url, "/data/index", Host="localhost")[0] == 200
    for path in ("/tilefold.json", "/../tilefold.json", "/data/../tilefold.json", "/data/%2e%2e/tilefold.json",
                 "/maplibre/..%2f..%2ftilefold.json", "/decisions.jsonl", "/data/map/../../14/1/1", "//etc/passwd",
                 "/data/explain/3/..%2f..%2ftilefold.json", "/data/map/%2fetc%2fpasswd/14/1/1"):
        status, body, _ = ask(url, path)
        assert status in (400, 404), f"{path}: {status} {body[:80]}"
    before = (bench.store / "decisions.jsonl").read_text()
    id = next(iter(claims(bench.records(None, "--all"))))
    body = json.dumps({"change": id, "version": 3, "decision": "accept", "note": "", "reviewer": ""}).encode()
    kind = {"Content_Type": "application/json"}
    assert ask(url, "/data/decisions", "POST", body, **kind)[0] == 403
    assert ask(url, "/data/decisions", "POST", body, Origin="http://evil.example", **kind)[0] == 403
    assert ask(url, "/data/decisions", "POST", body, Origin=f"http://{host}", Content_Type="text/plain")[0] == 403
    for wrong in (body.replace(b'"accept"', b'"maybe"'), body.replace(id.encode(), b"0" * 16), b"{", body.replace(b'"note": ""', b'"note": "' + b"x" * 3000 + b'"')):
        assert ask(url, "/data/decisions", "POST", wrong, Origin=f"http://{host}", **kind)[0] == 422
    assert ask(url, "/data/decisions", "POST", b" " * 100_000 + body, Origin=f"http://{host}", **kind)[0] == 413
    assert (bench.store / "decisions.jsonl").read_text() == before


def test_frames_come_from_the_logs_that_were_named_and_from_nowhere_else(bench, url):
    id = next(iter(claims(bench.records(None, "--all"))))
    path = f"/data/frame/3/{id}/0"
    # Without logs there are no pictures, though the store names its logs and they are where they were.
    assert ask(url, path)[0] == 404
    with served(bench, "--frames-from", bench.folder / "city" / "logs") as url:
        status, why, _ = ask(url, path)
        assert status == 422 and b"detections are in metres" in why, (status, why)
        for wrong in (f"/data/frame/3/{id}/999", f"/data/frame/3/{'0' * 16}/0", f"/data/frame/3/{id}/-1", f"/data/frame/3/..%2f..%2fcity/0"):
            assert ask(url, wrong)[0] in (400, 404), wrong
    with served(bench, "--frames-from", bench.folder / "nowhere") as url:
        status, why, _ = ask(url, path)
        assert status == 422 and b"--logs" not in why, (status, why)


# From a file


def test_a_folder_opens_without_a_server_and_saves_decisions(bench, url):
    folder = bench.folder / "page"
    bench.run("export", bench.store, "--format", "html", "--out", folder)
    bench.open((folder / "index.html").as_uri())
    wanted = set(claims(bench.records(None, "--all")))
    assert set(bench.shown()) == wanted and bench.drawn() == wanted
    first = bench.shown()[0]
    bench.page.keyboard.press("j")
    bench.page.wait_for_selector("#detail .chart")
    lines = bench.page.evaluate("tilefold.map.querySourceFeatures('map', {sourceLayer: 'map'}).length")
    assert lines > 10, "the map is not drawn"
    bench.page.keyboard.press("l")
    bench.page.wait_for_function("(id) => tilefold.state.decisions.has(id)", arg=first)
    with bench.page.expect_download() as saved:
        bench.page.click("#save")
    file = bench.folder / "saved.jsonl"
    saved.value.save_as(file)
    bench.run("decide", bench.store, "--from", file)
    assert {r["change"]: r.get("review_decision") for r in bench.records()}[first] == "later"
    elsewhere = [asked for asked in bench.asked if not asked.startswith((folder.as_uri(), "data:", "blob:"))]
    assert not elsewhere, elsewhere
    assert not bench.complaints, bench.complaints


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--tilefold", required=True)
    parser.add_argument("--chromium", required=True)
    parser.add_argument("--keep", help="folder for the stores; they stay there")
    parser.add_argument("only", nargs="?", default="", help="runs the tests with this in their name")
    asked = parser.parse_args()
    folder = Path(asked.keep or tempfile.mkdtemp(prefix="tilefold-page-"))
    folder.mkdir(parents=True, exist_ok=True)
    tests = [(name, test) for name, test in globals().items() if name.startswith("test_") and asked.only in name]
    failed = 0
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=asked.chromium, args=BROWSER)
        bench = Bench(asked.tilefold, browser, folder)
        if not (bench.store / "tilefold.json").exists():
            bench.make_store()
        (bench.store / "decisions.jsonl").unlink(missing_ok=True)
        with served(bench) as url:
            for name, test in tests:
                try:
                    test(bench, url)
                    print(f"ok      {name}", flush=True)
                except Exception:
                    failed += 1
                    print(f"FAILED  {name}\n{traceback.format_exc()}", flush=True)
                    if bench.page and asked.keep:
                        bench.page.screenshot(path=folder / f"{name}.png")
        browser.close()
    if not asked.keep:
        shutil.rmtree(folder)
    print(f"page: {len(tests) - failed} passed, {failed} failed")
    sys.exit(1 if failed else 0)


main()
