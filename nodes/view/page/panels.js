// SPDX-License-Identifier: MIT
// Scan, array levels, nodes and log.
const $ = (id) => document.getElementById(id);
const FLOOR_DB = -90;

function element(name, text, properties = {}) {
    const e = document.createElement(name);
    if (text !== undefined) e.textContent = text;
    return Object.assign(e, properties);
}

export function showScan(scan) {
    $("scan").dataset.state = scan?.state || "";
    $("scan-state").textContent = scan ? `Scan ${scan.scan} ${scan.state}` : "No scan";
    $("scan-bar").hidden = Boolean(scan) && !scan.expected; // it has no end
    $("scan-bar").max = scan?.expected || 1;
    $("scan-bar").value = scan?.expected ? scan.done : 0;
    if (!scan) {
        $("scan-text").textContent = "";
        return;
    }
    const parts = [scan.expected ? `${scan.done} of ${scan.expected} pings` : `${scan.done} pings`];
    if (scan.state === "running") {
        parts.push(scan.expected ? `${scan.pass} at position ${scan.position}` : scan.pass);
        if (scan.left_s > 0) parts.push(`${Math.ceil(scan.left_s)} s left`);
    }
    if (scan.retaken) parts.push(`${scan.retaken} retaken`);
    if (scan.lost) parts.push(`${scan.lost} lost`);
    if (scan.text && scan.text !== scan.state) parts.push(scan.text);
    $("scan-text").textContent = parts.join(" · ");
}

// What the vehicle is told of the sensor's state, in the words of node can.
export function showSensor(nodes) {
    const can = nodes.find((n) => n.node === "can");
    const told = /the sensor is (\w+)(.*)/.exec(can?.text || "");
    const silent = can?.state === "silent";
    $("sensor").hidden = !told;
    if (!told) return;
    const bad = silent || told[1] === "faulty" || told[1] === "blocked";
    $("sensor").dataset.level = bad ? "bad" : told[1] === "active" ? "ok" : "warn";
    $("sensor").textContent = silent ? "The vehicle is told nothing: node can is silent"
        : `The vehicle is told: sensor ${told[1]}${told[2]}`;
}

const LEVEL_OF_CHANNEL = { ok: "ok", clipped: "warn", faint: "warn", dead: "bad", damaged: "bad", "not heard yet": "dim" };

function meter(kind, i, peakDb, rmsDb, state) {
    const percent = (db) => (db === null ? 0 : Math.max(0, Math.min(100, 100 * (1 - db / FLOOR_DB))));
    const loud = peakDb ?? rmsDb;
    const e = element("div", undefined, { className: "meter" });
    e.dataset.level = LEVEL_OF_CHANNEL[state];
    e.setAttribute("role", "meter");
    e.setAttribute("aria-valuemin", FLOOR_DB);
    e.setAttribute("aria-valuemax", 0);
    e.setAttribute("aria-valuenow", loud === null ? FLOOR_DB : Math.round(loud));
    e.setAttribute("aria-label", `${kind} ${i}: ${state}`);
    e.title = `${kind} ${i}: ${state}` + (rmsDb === null ? "" : `, rms ${rmsDb.toFixed(0)} dB`) +
        (peakDb === null ? "" : `, peak ${peakDb.toFixed(0)} dB`);
    const bar = element("div", undefined, { className: "bar" });
    const [rms, peak] = ["rms", "peak"].map((name) => element("div", undefined, { className: name }));
    rms.style.height = `${percent(rmsDb)}%`;
    peak.style.height = `${percent(peakDb)}%`;
    bar.append(peak, rms);
    e.append(bar, element("div", i, { className: "number" }));
    return e;
}

// Numbers of channels, which count from 1 for people, neighbours drawn together: "3, 5-7".
function list(numbers) {
    const runs = [];
    for (const n of numbers) {
        const last = runs.at(-1);
        if (last && last[1] === n - 1) last[1] = n;
        else runs.push([n, n]);
    }
    return runs.map(([a, b]) => (a === b ? `${a}` : `${a}–${b}`)).join(", ");
}

function tell(kind, states) {
    const wrong = ["dead", "damaged", "clipped", "faint"]
        .map((state) => [state, states.flatMap((s, i) => (s === state ? [i + 1] : []))])
        .filter(([, which]) => which.length);
    const unheard = states.filter((s) => s === "not heard yet").length;
    if (wrong.length) return wrong.map(([state, which]) => `${kind} ${list(which)} ${state}`).join(", ");
    if (unheard) return `${states.length - unheard} of ${states.length} ${kind}s heard`;
    return `all ${states.length} ${kind}s ok`;
}

export function showLevels(levels) {
    $("levels").hidden = !levels;
    if (!levels) {
        $("array-text").textContent = "";
        return;
    }
    const { microphones, speakers } = levels;
    const clipped = microphones.reduce((sum, m) => sum + m[3], 0);
    const parts = [tell("microphone", microphones.map((m) => m[2])), tell("speaker", speakers.map((s) => s[1]))];
    if (clipped) parts.push(`${clipped} clipped samples in this scan`);
    if (levels.invalid) parts.push(`${levels.invalid} pings to be taken again`);
    if (levels.temperature_c !== null) parts.push(`air ${levels.temperature_c.toFixed(1)} °C`);
    const text = parts.join("; ");
    $("array-text").textContent = text.charAt(0).toUpperCase() + text.slice(1);
    $("microphones").replaceChildren(...microphones.map(([peak, rms, state], i) => meter("microphone", i + 1, peak, rms, state)));
    $("speakers").replaceChildren(...speakers.map(([rms, state], i) => meter("speaker", i + 1, null, rms, state)));
}

const STATES = { ready: ["●", "ok"], starting: ["◌", "dim"], degraded: ["▲", "warn"], fault: ["✕", "bad"], silent: ["○", "bad"] };

export function showNodes(nodes) {
    const all = nodes?.nodes || [];
    $("node-list").hidden = !all.length;
    $("node-list").tBodies[0].replaceChildren(...all.map((n) => {
        const row = element("tr");
        const [sign, level] = STATES[n.state] || ["?", "dim"];
        const state = element("td", `${sign} ${n.state}`);
        state.dataset.level = level;
        const lost = element("td", n.lost + n.refused);
        if (n.lost + n.refused) lost.dataset.level = "warn";
        const silent = n.state === "silent" ? `last heard ${Math.round(n.age_ms / 1000)} s ago` : "";
        const says = silent || (n.text === n.state ? "" : n.text);
        row.append(element("td", n.node), state, element("td", n.cpu === null ? "–" : `${Math.round(100 * n.cpu)} %`),
            element("td", `${Math.round(n.rss_bytes / 1e6)} MB`, { className: "wide" }), lost, element("td", says));
        return row;
    }));
}

const LEVELS = { info: "dim", debug: "dim", warning: "warn", error: "bad" };

export function showLog(log) {
    const lines = log?.lines || [];
    const box = $("lines");
    const atEnd = box.scrollTop + box.clientHeight > box.scrollHeight - 30;
    box.hidden = !lines.length;
    box.replaceChildren(...lines.map((l) => {
        const line = element("li");
        const level = element("span", l.level, { className: "level" });
        level.dataset.level = LEVELS[l.level] || "dim";
        let text = l.text;
        if (l.repeats) text += ` (${l.repeats} time${l.repeats === 1 ? "" : "s"} more)`;
        if (l.left_out) text += ` (${l.left_out} lines before it were left out)`;
        line.append(element("time", new Date(l.ms).toLocaleTimeString("en-GB")),
            element("span", l.node, { className: "who" }), level, element("span", text));
        return line;
    }));
    if (atEnd) box.scrollTop = box.scrollHeight;
}
