#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The page in headless Chromium, as a person uses it: waits, looks, clicks, types, on a
desk and on a phone, live and with a bag.

    test_view_browser.py ANLOS SOURCE_DIR [FOLDER]

FOLDER gets the pictures of the page: view-desktop.png, view-phone.png, view-bag.png,
view-drive.png (those of the README are in launch/images).  With DRIVE=no in the
environment the live drive is left out, whose processes have to keep the true pace.  Exit
code 77: there is no Chromium."""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile

sys.dont_write_bytecode = True
import chromium  # beside this file

PIXEL = """(([side, u, v]) => {
    const canvas = document.querySelector('#view-' + side + ' canvas');
    const x = (u - spans[side][0]) / (spans[side][1] - spans[side][0]);
    const y = 1 - (v - spans[side][2]) / (spans[side][3] - spans[side][2]);
    const p = canvas.getContext('2d').getImageData(
        Math.round(x * canvas.width), Math.round(y * canvas.height), 1, 1).data;
    return p[0] + p[1] + p[2];
})"""


def truth(scene):
    """Of launch/scenes/corner.yaml: what is imaged where, and what really stands where in
    the vehicle, by the geometry that its comments state: the wall is x + z = 1.6, the
    array's x is the vehicle's y, its y the z, its z the x, from (3.6, -0.54, 0.3)."""
    text = open(scene).read()
    found = re.findall(r"position_m: \[([-\d.]+), ([-\d.]+), ([-\d.]+)\]", text)
    if len(found) != 3 or "wall: {normal: [1, 0, 1], distance_m: 1.13137085}" not in text:
        raise chromium.Failed("another scene than the one that this test knows")
    places = [tuple(map(float, p)) for p in found]
    return [{"image": (1.6 - z, y, 1.6 - x), "vehicle": (3.6 + z, -0.54 + x, 0.3 + y)}
            for x, y, z in places]


def near(a, b, most):
    return all(abs(p - q) <= most for p, q in zip(a, b))


def check(what, text):
    if not what:
        raise chromium.Failed(text)


class View:
    """`anlos view` as a process."""

    def __init__(self, anlos, *arguments):
        self.process = subprocess.Popen([anlos, "view", *arguments],
                                        stdout=subprocess.PIPE, text=True)
        self.url = self.process.stdout.readline().strip()
        check(self.url.startswith("http://127.0.0.1:"), "it prints where the page is")
        self.port = self.url.rstrip("/").rsplit(":", 1)[1]

    def end(self):
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(60)
        self.process.stdout.close()


@contextlib.contextmanager
def told(browser):
    """A failure with how the page is then, not when its server has been ended for it."""
    try:
        yield
    except chromium.Failed as wrong:
        print("FAILED: %s" % wrong)
        print("the page: %s" % browser.ask("document.body.innerText")[:3000])
        print("errors of the page: %s" % browser.said)
        print("its connection:\n%s" % browser.ask("document.querySelector('#link').title"))
        picture = os.path.join(tempfile.gettempdir(), "anlos-view-failed.png")
        browser.picture(picture)
        print("how it looks: " + picture)
        raise


def text(browser, selector):
    return browser.ask("document.querySelector('%s').textContent" % selector)


def table(browser, selector):
    return browser.ask("[...document.querySelectorAll('%s tbody tr')].map("
                       "r => [...r.cells].map(c => c.textContent))" % selector)


def number(cell):
    return float(cell.replace("−", "-").split()[0])


# From a page's first moment on.
LINK_STATES = """
    window.linkStates = [];
    new MutationObserver(() => {
        const link = document.querySelector('#link');
        if (link) linkStates.push(link.dataset.state);
    }).observe(document, { attributes: true, attributeFilter: ['data-state'], subtree: true });
"""


def it_says_what_it_waits_for(browser):
    browser.wait("document.querySelector('#link').textContent === 'Waits for the system'")
    check(browser.ask("linkStates[0]") == "wait", "no connection is lost before there is one")
    for place in "#image-empty", "#objects-empty", "#array-empty", "#nodes-empty":
        check(len(text(browser, place)) > 20, place + " says what is waited for")
    check("anlos launch" in text(browser, "#nodes-empty"), "and what to do")


def it_shows_where_the_objects_are(browser, objects):
    rows = table(browser, "#objects")
    check(len(rows) == 3, "three objects are listed: %s" % rows)
    for o in objects:
        at = [r for r in rows if near([number(c) for c in r[1:4]], o["vehicle"], 0.03)]
        check(len(at) == 1, "%s is where it is: %s" % (o, rows))
        place = browser.ask(
            "(() => { const g = document.querySelector('.plan-object[data-id=\"%s\"]"
            " circle').getBBox(); return [g.x + g.width / 2, g.y + g.height / 2]; })()"
            % at[0][0])
        o["plan"], o["id"] = place, at[0][0]
    # The plan keeps directions and proportions: ahead is up, the vehicle's left is left.
    a, b = objects[0], objects[1]
    ahead = b["vehicle"][0] - a["vehicle"][0]
    left = b["vehicle"][1] - a["vehicle"][1]
    scale = (a["plan"][1] - b["plan"][1]) / ahead
    check(scale > 10 and abs((a["plan"][0] - b["plan"][0]) / left - scale) < 0.05 * scale,
          "the plan has one scale: %s" % objects)


def the_scan_and_the_nodes_are_told(browser):
    check("1024 of 1024 pings" in text(browser, "#scan-text"), "pings of the scan")
    bar = browser.ask("[document.querySelector('#scan-bar').value,"
                      " document.querySelector('#scan-bar').max]")
    check(bar == [1024, 1024], "the bar is full: %s" % bar)
    check(text(browser, "#source") == "simulation", "a simulation says so")
    names = [r[0] for r in table(browser, "#node-list")]
    for node in "array", "dsp", "recon", "track", "can":
        check(node in names, "%s is listed: %s" % (node, names))
    meters = browser.ask("[...document.querySelectorAll('#microphones .meter')].map("
                         "m => [m.getAttribute('aria-label'),"
                         " Number(m.getAttribute('aria-valuenow'))])")
    check(len(meters) == 16 and all(-80 < m[1] < 0 for m in meters), "levels: %s" % meters)
    check("All 16 microphones ok" in text(browser, "#array-text"), "and in words")


def spans(browser):
    """From the ticks of the axes: the metres at the edges of each side."""
    browser.ask("""window.spans = Object.fromEntries(['xy', 'yz', 'xz'].map(side => {
        const svg = document.querySelector('#view-' + side + ' svg');
        const box = svg.querySelector('rect').getBBox();
        const ticks = (anchor, pick) => [...svg.querySelectorAll('text[text-anchor=' + anchor + ']')]
            .filter(t => /^\\u2212?[0-9.]+$/.test(t.textContent))
            .map(t => [pick(t), Number(t.textContent.replace('\\u2212', '-'))]);
        const line = (all, p) => { const [a, b] = [all[0], all.at(-1)];
            return a[1] + (p - a[0]) / (b[0] - a[0]) * (b[1] - a[1]); };
        const across = ticks('middle', t => Number(t.getAttribute('x')));
        const up = ticks('end', t => Number(t.getAttribute('y')) - 4);
        return [side, [line(across, box.x), line(across, box.x + box.width),
                       line(up, box.y + box.height), line(up, box.y)]];
    })); 0""")


def pixel(browser, side, u, v):
    return browser.ask("%s(['%s', %g, %g])" % (PIXEL, side, u, v))


def the_image_is_bright_where_they_are(browser, objects):
    spans(browser)
    for o in objects[:2]:  # compact ones
        x, y, z = o["image"]
        for side, u, v in ("xy", x, y), ("xz", x, z), ("yz", z, y):
            here, beside = pixel(browser, side, u, v), pixel(browser, side, u, v + 0.12)
            check(here > 150 and here > beside + 100,
                  "%s is seen from %s: %s, beside it %s" % (o, side, here, beside))


def the_scale_is_absolute(browser):
    """What is brightest stands far above the noise, and however wide the range: noise is
    black."""
    said = text(browser, "#legend-text")
    above = re.fullmatch(r"0 dB: the brightest, (\d+) dB above the noise\.", said)
    check(above and 40 < int(above[1]) < 90, "the scale: " + said)
    browser.ask("(() => { const r = document.querySelector('#range'); r.value = '25';"
                " r.onchange(); return 1; })()")


def the_plots_over_time_are_drawn(browser, objects):
    browser.wait("document.querySelectorAll('#trends-plots path.trend').length === 3")
    browser.wait("document.querySelector('.trend-now[data-name=objects]').textContent === '%s'" % objects)
    snr = text(browser, ".trend-now[data-name=snr_db]")
    check(re.fullmatch(r"\d\d dB", snr) and number(snr) > 15, "signal to noise: " + snr)
    ms = text(browser, ".trend-now[data-name=latency_ms]")
    check(re.fullmatch(r"\d+ ms", ms), "latency: " + ms)
    over = labels_that_overlap(browser, "#trends-plots")
    check(not over, "labels hide each other in the plots: %s" % over)


def the_slider_slices(browser, objects):
    x, y, z = objects[0]["image"]
    check(browser.ask("document.querySelector('#view-xy').dataset.shows") == "maximum",
          "the maximum comes first")
    browser.click("#depth")
    browser.wait("document.querySelector('#view-xy').dataset.shows === 'slice'")
    browser.press("Home")
    browser.wait("/z = 1.80 m/.test(document.querySelector('#caption-xy').textContent)")
    spans(browser)
    browser.wait("%s(['xy', %g, %g]) < 60" % (PIXEL, x, y))  # not at this depth
    for _ in range(round((z - 1.8) / 0.01)):
        browser.press("ArrowRight")
    browser.wait("document.querySelector('#depth-text').value === 'z = %.2f m'" % z)
    browser.wait("%s(['xy', %g, %g]) > 400" % (PIXEL, x, y))
    browser.ask("document.querySelectorAll('#view-xz .depth').length === 1 || fail()")
    browser.click("#front-all")
    browser.wait("document.querySelector('#view-xy').dataset.shows === 'maximum'")


def the_keyboard_reaches_everything(browser, wanted):
    browser.ask("document.activeElement.blur(); scrollTo(0, 0)")
    seen, marked = [], []
    for _ in range(4 * len(wanted) + 16):
        browser.press("Tab")
        name, style = browser.ask(
            "(() => { const e = document.activeElement, s = getComputedStyle(e);"
            " return [e.id || e.className, s.outlineStyle + s.outlineWidth]; })()")
        seen.append(name)
        marked.append((name, style))
    start = seen.index("skip")  # the first thing of the page
    places = [seen.index(w, start) if w in seen[start:] else -1 for w in wanted]
    check(-1 not in places and places == sorted(places),
          "Tab goes to %s in this order: %s" % (wanted, seen))
    check(all(s != "none0px" and not s.startswith("none") for n, s in marked
              if n in wanted), "what has the focus shows it: %s" % marked)


def it_is_light_or_dark_as_asked(browser):
    shades = []
    for dark in False, True:
        browser.size(1280, 800, dark=dark)
        shades.append(browser.ask(
            "['backgroundColor', 'color'].map(k => getComputedStyle(document.body)[k]"
            ".match(/\\d+/g).slice(0, 3).reduce((a, b) => a + Number(b), 0) / 3)"))
    (paper, ink), (night, chalk) = shades
    check(paper > 200 and ink < 60 and night < 60 and chalk > 200, "shades: %s" % shades)


def it_fits_a_phone(browser):
    browser.size(360, 740, phone=True)
    browser.wait("innerWidth === 360")
    browser.wait("document.documentElement.scrollWidth <= 360")
    chosen = "document.querySelector('figure.chosen').id"
    browser.wait("getComputedStyle(document.querySelector('#tabs')).display === 'flex'")
    browser.wait("document.querySelectorAll('figure.chosen .plot canvas').length === 1")
    check(browser.ask(chosen) == "view-xy", "the front comes first")
    browser.click("#tab-xz")
    browser.wait(chosen + " === 'view-xz'")
    browser.press("ArrowRight")
    browser.wait(chosen + " === 'view-yz' && document.activeElement.id === 'tab-yz'")
    shown = browser.ask("[...document.querySelectorAll('figure')].filter("
                        "f => f.offsetParent).map(f => f.id)")
    check(shown == ["view-yz"], "one side at a time: %s" % shown)
    browser.press("Home")
    browser.wait(chosen + " === 'view-xy'")
    cut = browser.ask("[...document.querySelectorAll('body *')].filter(e => e.offsetParent"
                      " && !e.closest('.scroll') && !e.closest('svg')"
                      " && e.getBoundingClientRect().right > 361).map(e => e.id || e.tagName)")
    check(not cut, "nothing is cut off: %s" % cut)


def a_page_that_stood_still_keeps_its_connection(browser):
    """On a loaded machine: its clock jumps, and what the server said waits behind that."""
    browser.ask("""(() => {
        const clock = performance.now.bind(performance), link = document.querySelector('#link');
        let ahead = 0;
        window.lost = false;
        window.jump = 60000;
        new MutationObserver(() => { lost ||= link.dataset.state === 'lost'; })
            .observe(link, { attributes: true });
        performance.now = () => clock() + (ahead += jump);
        window.ticks = 0;
        setInterval(() => { ticks++; }, 1000);
    })()""")
    browser.wait("ticks >= 4")
    browser.ask("jump = 0")
    check(not browser.ask("lost"), "it does not hang up on a server that speaks")


def it_says_when_data_is_stale_and_comes_back(browser, view, anlos, run_dir):
    # The moment is not missed, however slow this machine is.
    browser.ask("""(() => {
        const link = document.querySelector('#link');
        window.stale = false;
        new MutationObserver(() => { stale ||= link.textContent.startsWith('Stale: no answer'); })
            .observe(link, { childList: true, characterData: true, subtree: true });
    })()""")
    state = "document.querySelector('#link').dataset.state"
    view.process.send_signal(signal.SIGSTOP)
    browser.wait("stale")
    view.process.send_signal(signal.SIGCONT)
    browser.wait(state + " !== 'lost' && !document.querySelector('#link')"
                 ".textContent.startsWith('Stale: no answer')")
    view.end()
    browser.wait(state + " === 'lost'")
    view = View(anlos, "--port", view.port, "--run-dir", run_dir)
    browser.wait(state + " !== 'lost'")
    return view


def take_picture(browser, path):
    browser.ask("document.activeElement.blur(); scrollTo(0, 0)")
    browser.picture(path)


def a_click_that_the_page_moves_away_from_is_made_again(browser):
    """Of this test: pressed here, released beside it, is no click for a browser."""
    browser.open("data:text/html,<button id=b onpointerdown='n++ || (style.marginTop = \"300px\")'"
                 " onclick='clicks++'>x</button><script>n = clicks = 0</script>")
    browser.click("#b")
    check(browser.ask("[n, clicks]") == [2, 1], "it is clicked once")


def live(browser, anlos, source, work, pictures):
    objects = truth(source + "/launch/scenes/corner.yaml")
    run_dir, bag = work + "/run", work + "/demo.mcap"
    view = View(anlos, "--port", "0", "--run-dir", run_dir)
    launch = None
    try:
        browser.size(1280, 800)
        browser.call("Page.addScriptToEvaluateOnNewDocument", source=LINK_STATES)
        browser.open(view.url)
        it_says_what_it_waits_for(browser)
        # Its launcher's log would be in the way of ctest's.
        with open(work + "/launch.log", "w") as log:
            launch = subprocess.Popen([anlos, "launch", source + "/launch/demo.yaml",
                                       "--out", work + "/out", "--run-dir", run_dir,
                                       "--record", bag], stdout=log, stderr=log)
        with told(browser):
            browser.wait("document.querySelector('#scan-state').textContent === 'Scan 1 done'"
                         " && document.querySelector('#image-about').textContent.startsWith("
                         "'final') && document.querySelectorAll('#objects tbody tr').length === 3"
                         " && !/Preliminary/.test(document.querySelector('#plan-note').textContent)",
                         300)
            it_shows_where_the_objects_are(browser, objects)
            the_scan_and_the_nodes_are_told(browser)
            the_image_is_bright_where_they_are(browser, objects)
            the_scale_is_absolute(browser)
            the_plots_over_time_are_drawn(browser, "3")
            take_picture(browser, pictures + "/view-desktop.png")
            the_slider_slices(browser, objects)
            the_keyboard_reaches_everything(
                browser, ["front-all", "depth", "range", "lines"])
            it_is_light_or_dark_as_asked(browser)
            it_fits_a_phone(browser)
            the_plots_over_time_are_drawn(browser, "3")
            take_picture(browser, pictures + "/view-phone.png")
            browser.size(1280, 800)
            code = launch.wait(300)
            said = open(work + "/launch.log").read()
            # On a loaded machine a recording at full pace may lose some, and says so.
            check(code == 0 or (code == 1 and re.search(r" [1-9]\d* messages? lost", said)),
                  "the launch ends by itself, with %d: %s" % (code, said[-2000:]))
            a_page_that_stood_still_keeps_its_connection(browser)
            view = it_says_when_data_is_stale_and_comes_back(browser, view, anlos, run_dir)
    finally:
        if launch:
            launch.kill()
            launch.wait()
        view.end()
    return bag


def bytes_read(view):
    with open("/proc/%d/io" % view.process.pid) as counts:
        return int(re.search(r"rchar: (\d+)", counts.read())[1])


def the_timeline_scrubs(browser, view, bag):
    at = "document.querySelector('#at')"
    browser.wait(at + ".max > 1 && document.querySelector('#objects tbody tr')")
    check(text(browser, "#source") == "recording, simulation", "it never looks live")
    # It starts with the results.
    browser.wait("/final/.test(document.querySelector('#image-about').textContent)")
    browser.click("#at")
    browser.press("Home")
    browser.wait("/Nothing of it before/.test(document.querySelector('#image-empty').textContent)")
    check(browser.ask("document.querySelector('#views').hidden"), "and no image")
    read = []
    images = browser.ask("document.querySelectorAll('#marks line').length")
    check(images >= 1, "images are marked")
    for i in range(images):
        browser.ask("document.body.dataset.seekMs = ''")
        before = bytes_read(view)
        browser.click("#later")
        browser.wait("/of 512 pings/.test(document.querySelector('#image-about').textContent)"
                     " && document.body.dataset.seekMs")
        read.append(bytes_read(view) - before)
    browser.wait("/final/.test(document.querySelector('#image-about').textContent)")
    browser.ask(at + ".focus()")
    browser.press("Home")
    browser.wait(at + ".value == 0")
    browser.press("ArrowRight")
    browser.wait(at + ".value > 0.4")
    browser.click("#play")
    browser.wait(at + ".value > 1")
    check(text(browser, "#play") == "Pause", "it plays")
    browser.click("#play")
    browser.ask(at + ".focus()")
    browser.press("End")
    browser.wait("/final/.test(document.querySelector('#image-about').textContent)")
    whole = os.path.getsize(bag)
    print("seeks read %s of %d bytes" % (", ".join(map(str, read)), whole))
    # On the average: what one place has still to read may come with the next one's.
    check(0 < sum(read) < 0.25 * whole * len(read),
          "a place is shown without reading all that is before it")


def a_place_that_was_asked_for_as_the_connection_broke_is_shown(browser, view, anlos, bag):
    about = "document.querySelector('#image-about').textContent"
    browser.ask("document.querySelector('#at').focus()")
    browser.press("Home")
    browser.wait("document.querySelector('#at').value == 0 && document.querySelector('#views').hidden")
    view.process.send_signal(signal.SIGSTOP)  # it gets the request, and never answers
    try:
        browser.click("#later")
        browser.wait("document.querySelector('#at').value > 0")
    finally:
        view.process.kill()
    view.end()
    view = View(anlos, "--port", view.port, "--bag", bag)
    browser.wait("/of 512 pings/.test(%s)" % about)
    story = browser.ask("document.querySelector('#link').title")
    check(re.search(r"disconnected, code 1006|heard nothing for", story) and
          story.split("\n")[-1].endswith(" connected"), "it tells what happened: " + story)
    browser.ask("document.querySelector('#at').focus()")
    browser.press("End")
    browser.wait("/final/.test(%s)" % about)
    return view


def a_click_into_a_plot_goes_to_that_time(browser):
    at = "document.querySelector('#at')"
    the_plots_over_time_are_drawn(browser, "3")
    browser.click("#trends-plots svg")  # into its middle
    browser.wait("%s.value > 0.35 * %s.max && %s.value < 0.65 * %s.max" % (at, at, at, at))
    browser.wait("(() => { const a = document.querySelector('.trend-at'), s = a.ownerSVGElement;"
                 " const x = a.getAttribute('x1') / s.getAttribute('width');"
                 " return x > 0.4 && x < 0.65; })()")  # a line stands there


def bookmarks_are_kept_beside_the_bag(browser, bag):
    at = "document.querySelector('#at')"
    listed = "[...document.querySelectorAll('#bookmarks option')].slice(1).map(o => o.textContent)"
    path = bag + ".bookmarks"
    check(browser.ask(listed) == [] and not os.path.exists(path), "at first there are none")
    place = number(text(browser, "#at-text"))
    browser.click("#mark")
    browser.wait("document.activeElement.id === 'name'")
    browser.ask("document.querySelector('#name').value = ' half <b>way</b> '; 1")
    browser.press("Enter")
    browser.wait(listed + ".length === 1")
    entry = browser.ask(listed)[0]
    check(re.fullmatch(r"\d+\.\d s  half <b>way</b>", entry) and
          abs(number(entry) - place) < 0.11, "it is listed: " + entry)
    check(browser.ask("document.querySelectorAll('#marks .bookmark').length") == 1, "and marked")
    with open(path) as f:
        kept = f.read()
    check(re.fullmatch(r"\d+\.\d{3} half <b>way</b>\n", kept) and
          abs(number(kept) - place) < 0.06, "the file: " + kept)
    browser.click("#mark")
    browser.click("#unnamed")  # it is not kept
    browser.ask(at + ".focus()")
    browser.press("Home")
    browser.wait(at + ".value == 0 && document.querySelector('#unmark').hidden")
    browser.ask("(() => { const b = document.querySelector('#bookmarks'); b.selectedIndex = 1;"
                " b.onchange(); return 1; })()")
    browser.wait("Math.abs(%s.value - %g) < 0.02" % (at, number(kept)))
    browser.click("#unmark")
    browser.wait(listed + ".length === 0")
    check(os.path.getsize(path) == 0, "and gone from the file")


def recorded(browser, anlos, bag, pictures):
    view = View(anlos, "--port", "0", "--bag", bag, "--save")
    try:
        with told(browser):
            browser.size(1280, 800)
            browser.open(view.url)
            the_timeline_scrubs(browser, view, bag)
            a_click_into_a_plot_goes_to_that_time(browser)
            bookmarks_are_kept_beside_the_bag(browser, bag)
            browser.ask("document.querySelector('#at').focus()")
            browser.press("End")
            browser.wait("/final/.test(document.querySelector('#image-about').textContent)")
            view = a_place_that_was_asked_for_as_the_connection_broke_is_shown(
                browser, view, anlos, bag)
            the_keyboard_reaches_everything(
                browser, ["play", "earlier", "at", "front-all", "depth", "range"])
            check(browser.ask("document.querySelector('#mark').disabled") and
                  "--save" in browser.ask("document.querySelector('#mark').title"),
                  "who only reads marks nothing, and knows why")
            take_picture(browser, pictures + "/view-bag.png")
            browser.size(360, 740, phone=True)
            browser.wait("document.documentElement.scrollWidth <= 360")
    finally:
        view.end()


def labels_that_overlap(browser, place):
    """Pairs of texts in a drawing that hide each other by more than a hair."""
    return browser.ask("""(() => {
        const all = [...document.querySelectorAll('%s svg text')].map(t => [t.textContent, t.getBoundingClientRect()]);
        const deep = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left) > 2 &&
            Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 4;
        return all.flatMap(([s, a], i) => all.slice(i + 1).filter(([, b]) => deep(a, b)).map(([t]) => [s, t]));
    })()""" % place)


# Of the first track with an arrow, what the table says and, in metres by the ticks of the
# plan's axes, where its dot is and how far its arrow goes; null: there is none now.
TRACK = """(() => {
    const svg = document.querySelector('#plan-plot svg');
    const g = [...document.querySelectorAll('.plan-object')].find(g => g.querySelector('.plan-arrow'));
    if (!g) return null;
    const ticks = (anchor, pick) => [...svg.querySelectorAll('text[text-anchor=' + anchor + ']')]
        .filter(t => /^\\u2212?[0-9.]+$/.test(t.textContent))
        .map(t => [pick(t), Number(t.textContent.replace('\\u2212', '-'))]);
    const scale = (all) => { const [a, b] = [all[0], all.at(-1)];
        return (p) => a[1] + (p - a[0]) / (b[0] - a[0]) * (b[1] - a[1]); };
    const across = scale(ticks('middle', t => Number(t.getAttribute('x'))));
    const up = scale(ticks('end', t => Number(t.getAttribute('y')) - 4));
    const dot = g.querySelector('circle'), [x, y] = ['cx', 'cy'].map(k => Number(dot.getAttribute(k)));
    const [, u, v] = /L([-.0-9]+) ([-.0-9]+)M/.exec(g.querySelector('.plan-arrow').getAttribute('d')).map(Number);
    const row = [...document.querySelectorAll('#objects tbody tr')].find(r => r.cells[0].textContent === g.dataset.id);
    const name = [...document.querySelectorAll('.object-name')].find(t => t.textContent.startsWith(g.dataset.id + ' '));
    return { row: [...row.cells].map(c => c.textContent), name: name.textContent,
        at: [up(y), across(x)], way: Math.hypot(up(v) - up(y), across(u) - across(x)) };
})()"""


def a_track_is_shown_as_it_moves(browser):
    browser.wait("document.querySelector('.plan-trail') && %s" % TRACK, 240)
    browser.wait("document.querySelector('.wall-name').textContent.startsWith('wall · heard')")
    track = browser.wait(TRACK, 120)
    row = [number(c) for c in track["row"][1:3] + track["row"][4:5]]
    check(near(track["at"] + [track["way"]], row, 0.06), "the plan agrees with the table: %s" % track)
    check(re.search(r"^\d+ · .*\d+ %[\d.]+ m/s", track["name"]), "its name: %s" % track)
    told = text(browser, "#sensor")
    check(told.startswith("The vehicle is told: sensor "), "what the vehicle is told: " + told)


def a_plane_is_seen_from_above_alone(browser):
    shown = browser.ask("[...document.querySelectorAll('#image figure')].filter("
                        "f => f.offsetParent).map(f => f.id)")
    check(shown == ["view-xz"], "one plane has one side: %s" % shown)
    check(browser.ask("document.querySelectorAll('#plan-plot canvas').length") == 1,
          "the image lies under the plan")
    widths = browser.ask("['plan', 'image'].map(i => document.getElementById(i).clientWidth)")
    check(widths[0] > 1.2 * widths[1], "the plan is the large one: %s" % widths)


def drive(browser, anlos, source, work, pictures):
    run_dir, bag = work + "/run-drive", work + "/drive.mcap"
    view = View(anlos, "--port", "0", "--run-dir", run_dir)
    browser.size(1280, 800)
    browser.open(view.url)
    launch = subprocess.Popen([anlos, "launch", source + "/launch/drive.yaml", "--out",
                               work + "/drive", "--run-dir", run_dir, "--record", bag],
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        with told(browser):
            a_track_is_shown_as_it_moves(browser)
            a_plane_is_seen_from_above_alone(browser)
            browser.wait("document.querySelectorAll('#trends-plots path.trend').length === 3")
            for width, phone in (1280, False), (360, True):
                browser.size(width, 800, phone=phone)
                browser.wait("innerWidth === %d" % width)
                browser.wait("document.documentElement.scrollWidth <= %d" % width)
                for place in "#plan-plot", "#view-xz":
                    over = labels_that_overlap(browser, place)
                    check(not over, "labels hide each other in %s: %s" % (place, over))
            browser.size(1280, 800)
            launch.send_signal(signal.SIGINT)
            launch.wait(120)
    finally:
        launch.kill()
        launch.wait()
        view.end()
    view = View(anlos, "--port", "0", "--bag", bag)
    try:
        with told(browser):
            browser.open(view.url)
            browser.wait("document.querySelector('#at').max > 1")
            place = number(browser.ask("document.querySelector('#at').max"))
            # As finely as lists come: a machine that is quick shows the track live, and
            # ends the recording, before it has stood for long.
            while not browser.ask("document.querySelector('.plan-object .plan-trail')"
                                  " && document.querySelector('.plan-arrow') ? 1 : 0"):
                check(place > 0, "somewhere in the bag is the track with its trail")
                browser.ask("document.body.dataset.seekMs = ''")
                browser.ask("(() => { const at = document.querySelector('#at');"
                            " at.value = %.3f; at.oninput(); return 1; })()" % place)
                browser.wait("document.body.dataset.seekMs")
                browser.ask("new Promise(f => requestAnimationFrame(() => requestAnimationFrame(f)))")
                place -= 0.1
            take_picture(browser, pictures + "/view-drive.png")
    finally:
        view.end()


def main():
    program = chromium.find()
    if not program:
        return 77
    anlos, source = sys.argv[1:3]
    work = tempfile.mkdtemp(prefix="anlos-view-")
    pictures = sys.argv[3] if len(sys.argv) > 3 else work
    browser = chromium.Browser(program)
    try:
        a_click_that_the_page_moves_away_from_is_made_again(browser)
        bag = live(browser, anlos, source, work, pictures)
        recorded(browser, anlos, bag, pictures)
        if os.environ.get("DRIVE") != "no":
            drive(browser, anlos, source, work, pictures)
        # A page that is cut off while the server restarts says so itself.
        said = [s for s in browser.said if "ERR_CONNECTION" not in s and "WebSocket" not in s]
        check(not said, "the page has errors: %s" % said)
    except chromium.Failed as wrong:
        print("FAILED: %s" % wrong)
        return 1
    finally:
        browser.close()
        shutil.rmtree(work, ignore_errors=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
