// SPDX-License-Identifier: MIT
// The table of objects: of a scan, or of tracks.
const $ = (id) => document.getElementById(id);
const number = (v, digits) => (v === null || v === undefined ? "–" : v.toFixed(digits).replace("-", "−"));
const percent = (v) => (v === null ? "–" : `${Math.round(100 * v)} %`);
const deviation = (o) => (o.sd_m.slice(0, 2).includes(null) ? null : 100 * Math.max(...o.sd_m.slice(0, 2)));
const deviationOfAll = (o) => (o.sd_m.includes(null) ? null : 100 * Math.max(...o.sd_m));

const HOW = { pair: "bounces of", face: "mirror image of", shadow: "echo behind" };

const bounced = (o) => (o.multipath ? `, multipath: ${HOW[o.multipath.by]} ${o.multipath.of.join(" and ")}` : "");

function remarks(o) {
    const all = [];
    if (o.behind_no_wall) all.push("behind no wall");
    if (o.in_free_view) all.push("in free view");
    if (o.at_border) all.push("where the image ends");
    return all.length ? `, ${all.join(", ")}` : "";
}

// Title, text of an object, and whether a narrow page leaves it out.
const OF_A_SCAN = [
    ["#", (o) => o.id],
    ["x m", (o) => number(o.position_m[0], 2)],
    ["y m", (o) => number(o.position_m[1], 2)],
    ["z m", (o) => number(o.position_m[2], 2)],
    ["± cm", (o) => number(deviationOfAll(o), 1)],
    ["exists", (o) => percent(o.existence) + bounced(o)],
    ["above noise", (o) => `${number(o.level_db, 0)} dB`, "wide"],
];
// The height of what a line of microphones hears is none that it has measured.
const OF_TRACKS = [
    ["#", (o) => o.id],
    ["x m", (o) => number(o.position_m[0], 2)],
    ["y m", (o) => number(o.position_m[1], 2)],
    ["± cm", (o) => number(deviation(o), 0), "wide"],
    ["m/s", (o) => number(o.speed_m_s, 1)],
    ["exists", (o) => percent(o.existence)],
    ["class", (o) => o.shape || "–", "wide"],
    ["age", (o) => `${number(o.age_s, 1)} s`, "wide"],
    ["seen", (o) => (o.measurement === "predicted" ? `${number(o.unseen_s, 1)} s ago` : "now") + remarks(o)],
];

function cell(name, text, kind) {
    const e = document.createElement(name);
    e.textContent = text;
    if (kind) e.className = kind;
    if (name === "th") e.scope = "col";
    return e;
}

function row(...cells) {
    const e = document.createElement("tr");
    e.append(...cells);
    return e;
}

export function listObjects(objects) {
    const columns = objects?.tracked ? OF_TRACKS : OF_A_SCAN;
    $("objects").hidden = !objects?.items.length;
    $("objects").tHead.replaceChildren(row(...columns.map(([title, , kind]) => cell("th", title, kind))));
    $("objects").tBodies[0].replaceChildren(...(objects?.items || []).map((o) => {
        const e = row(...columns.map(([, text, kind]) => cell("td", text(o), kind)));
        if (o.measurement === "predicted") e.dataset.level = "dim";
        return e;
    }));
}
