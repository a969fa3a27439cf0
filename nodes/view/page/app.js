// SPDX-License-Identifier: MIT
// What the server says, and where on the page it is shown.
import { createImage } from "./image.js";
import { SILENT_MS, connect } from "./link.js";
import { listObjects } from "./objects.js";
import { showLevels, showLog, showNodes, showScan, showSensor } from "./panels.js";
import { drawPlan, wallsOf } from "./plan.js";
import { createTimeline } from "./timeline.js";
import { createTrends } from "./trends.js";

const $ = (id) => document.getElementById(id);
const known = {}; // the newest message of each type
let image;
let timeline;
let trends;

const isBag = () => known.hello?.mode === "bag";
const nodes = () => (known.nodes?.nodes || []).filter((n) => n.node !== "view");
const isRunning = (name) => nodes().some((n) => n.node === name && n.state !== "silent");

// Why nothing has come yet, from what is farther up the way the data goes.
function whatIsMissing() {
    const scan = known.scan;
    if (isBag()) return "Nothing of it before this time of the recording.";
    if (!known.hello) return "Waits for the server.";
    if (!nodes().length) return `Waits for the system: nobody is heard in ${known.hello.origin}.`;
    if (!nodes().some((n) => n.state !== "silent")) return "Waits for the system: all its nodes are silent.";
    if (!isRunning("array") && !isRunning("play")) return "Waits for the array.";
    if (!known.scene) return "Waits for the array's survey.";
    if (!scan || scan.state === "waiting") return `Waits for the scan to start. ${scan?.text || ""}`;
    if (scan.state === "failed") return `The scan failed. ${scan.text}`;
    if (scan.pass === "background") return "Waits for the scene: the background is being recorded.";
    return "Waits for the first stage position.";
}

const isReplayed = () => known.clock && isRunning("play");

function replayText(clock) {
    const pace = clock.ended ? "ended" : clock.paused ? "paused" : clock.rate === 1 ? "at its pace" : clock.rate ? `${clock.rate} times its pace` : "as fast as it goes";
    return `Replay at ${clock.at_s.toFixed(1)} of ${clock.span_s.toFixed(1)} s, ${pace}`;
}

function showLink(link) {
    const heard = known.time?.heard ? (known.time.now - known.time.heard) / 1000 : null;
    const heardNodes = nodes().filter((n) => n.state !== "silent").length;
    const [state, text] = !link.open && !link.story.length ? ["wait", "connecting"]
        : !link.open ? ["lost", "No connection to the server, trying again"]
        : link.silentMs() > SILENT_MS ? ["stale", `Stale: no answer for ${Math.round(link.silentMs() / 1000)} s`]
        : isBag() ? ["ok", known.hello.origin.split("/").pop()]
        : heard === null ? ["wait", "Waits for the system"]
        : heard > SILENT_MS / 1000 ? ["stale", `Stale: nothing heard for ${Math.round(heard)} s`]
        : isReplayed() ? ["ok", replayText(known.clock)]
        : ["ok", `Hears ${heardNodes === 1 ? "1 node" : `${heardNodes} nodes`}`];
    if ($("link").textContent !== text) $("link").textContent = text;
    $("link").dataset.state = state;
    $("link").title = link.story.join("\n");
    document.title = state === "ok" || state === "wait" ? "anlos" : "▲ anlos";
}

function showSource() {
    const source = known.volume?.source || known.scene?.source;
    const names = { simulation: "simulation", live: "live sound", replay: "replay" };
    $("source").hidden = !source;
    $("source").dataset.source = isBag() ? "bag" : source;
    $("source").textContent = isBag() ? `recording, ${names[source]}` : names[source];
}

function showImage() {
    const v = known.volume;
    $("image-empty").textContent = v ? "" : `No image yet. ${whatIsMissing()}`;
    image.draw();
    if (!v) {
        $("image-about").textContent = "";
        return;
    }
    const parts = [v.preview ? "preview" : "final", `${v.method}`, `${v.pings_used} of ${v.pings_expected} pings`];
    if (v.masked) parts.push(`${v.masked} microphones left out`);
    if (v.clipped) parts.push(`${v.clipped} clipped samples`);
    if (v.imaging_s) parts.push(`${Math.round(1000 * v.imaging_s)} ms to image`);
    $("image-about").textContent = parts.join(" · ");
}

function showPlan() {
    drawPlan(known, image.plane());
}

// What was said last stays, so it has to be told when nobody says it any more.
function isSilent(name) {
    return !isBag() && nodes().some((n) => n.node === name && n.state === "silent");
}

function drawImage() {
    image.draw();
}

function showObjects() {
    const o = known.objects;
    image.objects = o;
    listObjects(o);
    const notes = [];
    if (o && isSilent("track")) notes.push("Node track is silent: these are its last objects.");
    if (known.walls && isSilent("wall")) notes.push("Node wall is silent: these are its last walls.");
    if (known.scene && !wallsOf(known).length) notes.push(`No wall is known: ${o?.tracked ? "where objects really are is not known" : "positions are those of the mirror images"}.`);
    else if (o && !o.mirrored) notes.push("Positions are those of the mirror images.");
    if (known.scene?.frame === "array") notes.push("Array frame: no mount on the vehicle is known.");
    if (o?.preview) notes.push("Preliminary: the scan goes on.");
    if (o?.ego_unknown) notes.push("The vehicle does not say how it moves.");
    $("plan-note").textContent = notes.join(" ");
    $("objects-empty").textContent = !o ? `No list of objects yet. ${whatIsMissing()}`
        : o.items.length ? "" : o.tracked ? "Nothing is tracked now." : "Nothing was found in the image.";
}

function showEmpty() {
    showLevels(known.levels);
    $("array-empty").textContent = known.levels ? "" : `No sound yet. ${whatIsMissing()}`;
    $("nodes-empty").textContent = nodes().length ? ""
        : isBag() ? "Nothing is recorded of them before this time."
            : "No node is heard. Start a system: anlos launch launch/demo.yaml";
    $("log-empty").textContent = known.log?.lines?.length ? "" : "No line yet.";
}

// "Save the last 30 s", of a recorder that keeps them and is heard.
function showRecord() {
    const r = known.record;
    const heard = r && r.state !== "nothing" && known.time && known.time.now - r.at < SILENT_MS;
    $("record").hidden = !r || isBag();
    if ($("record").hidden) return;
    $("save").textContent = `Save the last ${Math.round(r.before_s)} s`;
    $("save").disabled = !heard || !r.may_save || !link.open;
    $("save").title = r.may_save ? "" : "This page only reads: start it with --save, or view: {save: true}";
    const text = !heard ? "The recorder is silent." : r.error ? r.error
        : r.state === "saves" ? `Saves ${r.path.split("/").pop()}`
        : r.saved ? `Saved ${r.path.split("/").pop()}`
        : `Keeps ${r.kept_s.toFixed(0)} s`;
    if ($("save-text").textContent !== text) $("save-text").textContent = text;
}

function showTrends() {
    trends.history = known.history || null;
    trends.isBag = isBag();
    $("trends-empty").textContent = known.history ? "" : `No list of objects yet. ${isBag() ? "The recording is being read." : whatIsMissing()}`;
    trends.draw();
}

function showAbout() {
    const t = known.time;
    const skipped = t?.skipped ? `, ${t.skipped} frames skipped by slow ones` : "";
    $("about").textContent = `anlos ${known.hello?.version || ""} · ${known.hello?.origin || ""} · ` +
        `${t?.pages === 1 ? "this page alone" : `${t?.pages || 0} pages`} open${skipped}`;
}

// What each type of message changes.
const shows = {
    hello: [showAbout],
    scene: [showSource, showObjects, showImage, showPlan, showEmpty],
    scan: [() => showScan(known.scan), showEmptyIfWaiting],
    nodes: [() => showNodes(known.nodes), () => showSensor(nodes()), showObjects, showEmptyIfWaiting],
    walls: [showObjects, showPlan],
    objects: [showObjects, showPlan, drawImage],
    history: [showTrends],
    levels: [showEmpty],
    log: [() => showLog(known.log), showEmpty],
    volume: [showSource, showImage, showPlan],
    record: [showRecord],
    time: [showAbout, showRecord],
};

function showEmptyIfWaiting() {
    if (!known.volume) showImage();
    if (!known.objects) showObjects();
    if (!known.history) showTrends();
    showEmpty();
}

let due = new Set();
function show(functions) {
    if (!due.size) requestAnimationFrame(() => {
        const now = due;
        due = new Set();
        for (const f of now) f();
    });
    for (const f of functions) due.add(f);
}

// Another server, or the same one again: it says all that it knows.
function begin() {
    for (const type of Object.keys(known)) known[type] = null;
    image.take({ none: true });
    show(Object.values(shows).flat());
}

function take(message, bytes) {
    if (message.type === "slice") return image.takeSlice(message, bytes);
    if (message.type === "timeline") {
        if (message.none) return undefined;
        timeline.take(message);
        trends.at_s = message.at_us / 1e6;
        show([showTrends]);
        return undefined;
    }
    if (message.type === "hello") begin();
    known[message.type] = message.none ? null : message;
    if (message.type === "volume") image.take(message, bytes);
    show([...(shows[message.type] || []), () => showLink(link)]);
    return undefined;
}

const link = connect(take, () => {
    if (!link?.open) timeline?.lost();
    if (link) showLink(link);
});
image = createImage(link);
timeline = createTimeline(link);
trends = createTrends((s) => timeline.seek(s));
$("save").addEventListener("click", () => link.send({ save: true }));
new ResizeObserver(showPlan).observe($("plan"));
showScan(null);
showSensor([]);
showEmptyIfWaiting();
showLink(link);
