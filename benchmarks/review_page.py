"""Load and pan of the review page, from the browser's own trace.

    cargo xtask setup && cargo build --release --workspace --example review_store
    target/release/examples/review_store big 100000
    PYTHONPATH=target/tools/playwright-1.65.2 python3 benchmarks/review_page.py \
        --tilefold target/release/tilefold --chromium /usr/bin/chromium big

Prints a JSON line for each thing that was done, as it is done: the documents' sizes and times; then,
for loading until the map has drawn, for panning, filtering and scrolling the list, the main
thread's scripting in milliseconds and the frames (their count, and the gaps between two of them:
median, 95 %, longest).
"""

import argparse
import json
import subprocess
import tempfile
import time
import urllib.request
from pathlib import Path

from playwright.sync_api import sync_playwright

BROWSER = (
    "--no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --disable-quic"
    " --no-first-run --disable-background-networking --disable-component-update --disable-sync"
).split()
# Tasks that run the page's code, as they stand in a trace.
SCRIPTING = {"EvaluateScript", "v8.compile", "FunctionCall", "TimerFire", "FireAnimationFrame", "EventDispatch", "RunMicrotasks", "v8.parseOnBackground"}


class Trace:
    """What a browser says it did between begin and end."""

    def __init__(self, browser, page):
        self.path = Path(tempfile.mkdtemp()) / "trace.json"
        browser.start_tracing(page=page, path=self.path, categories=["devtools.timeline", "disabled-by-default-devtools.timeline.frame"])
        self.browser, self.begun = browser, time.monotonic()

    def end(self):
        wall_ms = (time.monotonic() - self.begun) * 1e3
        self.browser.stop_tracing()
        events = json.loads(self.path.read_text())["traceEvents"]
        names = {(e["pid"], e["tid"]): e["args"]["name"] for e in events if e.get("name") == "thread_name"}
        main = {thread for thread, name in names.items() if name == "CrRendererMain"}
        tasks = sorted((e["ts"], e["ts"] + e["dur"]) for e in events
                       if e.get("ph") == "X" and e["name"] in SCRIPTING and (e["pid"], e["tid"]) in main)
        # Nested tasks count once.
        busy, until, longest = 0, 0, 0
        for start, end in tasks:
            busy += max(0, end - max(start, until))
            longest = max(longest, end - start)
            until = max(until, end)
        drawn = sorted(e["ts"] for e in events if e.get("name") == "DrawFrame")
        gaps = sorted(b - a for a, b in zip(drawn, drawn[1:]))
        at = lambda share: round(gaps[min(len(gaps) - 1, int(share * len(gaps)))] / 1e3, 1) if gaps else None
        return {
            "wall_ms": round(wall_ms), "scripting_ms": round(busy / 1e3), "longest_task_ms": round(longest / 1e3),
            "frames": len(drawn), "frame_gap_ms": {"median": at(0.5), "p95": at(0.95), "longest": at(1.0)},
        }


def documents(url):
    version = json.load(urllib.request.urlopen(f"{url}data/index"))["version"]
    said = {}
    for name in (f"versions/{version}", f"coverage/{version}"):
        times = []
        for _ in range(2):
            begun = time.monotonic()
            size = len(urllib.request.urlopen(f"{url}data/{name}").read())
            times.append(round((time.monotonic() - begun) * 1e3))
        said[name] = {"bytes": size, "first_ms": times[0], "again_ms": times[1]}
    return said


def settle(page):
    page.evaluate("() => new Promise((done) => tilefold.map.loaded() && tilefold.map.areTilesLoaded() ? done() : (tilefold.map.once('idle', done), setTimeout(done, 30_000)))")


def drag(page, steps=8):
    page.mouse.move(900, 500)
    page.mouse.down()
    for step in range(steps):
        page.mouse.move(900 - 50 * step, 500 - 25 * step)
    page.mouse.up()
    settle(page)


def told(name, figures):
    print(json.dumps({name: figures}), flush=True)


def measure(browser, url):
    told("documents", documents(url))
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    trace = Trace(browser, page)
    page.goto(url)
    page.wait_for_selector("html[data-ready=yes]", state="attached", timeout=300_000)
    settle(page)
    told("load", trace.end())
    told("records", page.evaluate("tilefold.state.layer.change.length"))
    told("heap_mb", round(page.evaluate("performance.memory.usedJSHeapSize") / 1e6))

    def traced(name, act):
        trace = Trace(browser, page)
        act()
        settle(page)
        told(name, trace.end())

    page.evaluate("tilefold.map.jumpTo({ zoom: 16 })")
    settle(page)
    traced("pan_near", lambda: drag(page))

    def filtered():
        page.evaluate("document.getElementById('filters').open = true")
        for value in range(50, 100, 12):
            page.evaluate("(value) => { const s = document.getElementById('posterior'); s.value = value; s.dispatchEvent(new Event('input')); }", value)
            page.wait_for_timeout(100)

    traced("filter_five_times", filtered)

    def scrolled():
        page.evaluate("document.getElementById('filters').open = false")
        page.mouse.move(150, 500)
        for _ in range(20):
            page.mouse.wheel(0, 900)

    traced("scroll_list", scrolled)
    page.evaluate("tilefold.map.jumpTo({ zoom: 11 })")
    settle(page)
    traced("pan_far", lambda: drag(page))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--tilefold", required=True)
    parser.add_argument("--chromium", required=True)
    parser.add_argument("store")
    asked = parser.parse_args()
    server = subprocess.Popen([asked.tilefold, "serve", asked.store, "--port", "0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        url = server.stdout.readline().strip()
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=asked.chromium, args=BROWSER)
            measure(browser, url)
            browser.close()
    finally:
        server.kill()
        server.wait()


main()
