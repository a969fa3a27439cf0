// SPDX-License-Identifier: MIT
// The timeline of a bag: scrub, step from image to image, play, bookmarks.
import { svg } from "./axes.js";

const $ = (id) => document.getElementById(id);
const STEP_MS = 100;
const HERE_S = 0.05;

const seconds = (s) => `${s.toFixed(1)} s`;

export function createTimeline(link) {
    const line = { state: null, seek: (s) => line.state && seek(s) };
    let waiting = false; // for the answer to a seek
    let asked = 0; // what that seek is for
    let wanted = null; // the next seek, when that has come
    let timer = 0;
    let at = 0; // exactly: the slider rounds

    const seek = (s) => {
        const to = Math.min(Math.max(s, 0), line.state.span_s);
        say(to);
        if (waiting) wanted = to;
        else if (link.send({ seek: (asked = to) })) waiting = true;
        else wanted = to; // when the connection is back, which begins with a state
    };
    const say = (s) => {
        at = s;
        $("at").value = s;
        const text = `${seconds(s)} of ${seconds(line.state.span_s)}`;
        $("at-text").value = text;
        $("at").setAttribute("aria-valuetext", text);
        $("unmark").hidden = !line.state.may_mark || !markHere();
        $("earlier").disabled = !line.state.images.some((t) => t < s - 1e-6);
        $("later").disabled = !line.state.images.some((t) => t > s + 1e-6);
    };
    const markHere = () => line.state.bookmarks.find((b) => !b.fixed && Math.abs(b.at_s - at) < HERE_S);
    const naming = (open) => {
        $("naming").hidden = !open;
        $("mark").hidden = open;
        if (open) {
            $("name").value = "";
            $("name").focus();
        } else if (document.activeElement === document.body) {
            $("mark").focus();
        }
    };
    // A list to jump with; its first entry says what it is.
    const listBookmarks = () => {
        const { bookmarks, may_mark: may, unmarked } = line.state;
        const entry = (value, text) => Object.assign(document.createElement("option"), { value, textContent: text });
        $("bookmarks").replaceChildren(entry("", bookmarks.length ? `Bookmarks (${bookmarks.length})` : "No bookmarks"),
            ...bookmarks.map((b) => entry(b.at_s, `${b.at_s.toFixed(1)} s  ${b.name}`)));
        $("bookmarks").disabled = !bookmarks.length;
        $("mark").disabled = !may;
        $("mark").title = may ? "" : unmarked || "This page only reads: start it with --save, or view: {save: true}";
        const wrong = [line.state.wrong && `Damaged: ${line.state.wrong}`, unmarked && `Bookmarks: ${unmarked}`];
        $("wrong").textContent = wrong.filter(Boolean).join(" ");
    };
    const stop = () => {
        clearInterval(timer);
        timer = 0;
        $("play").textContent = "Play";
    };
    const play = () => {
        if (timer) return stop();
        if (at >= line.state.span_s - 0.01) seek(0);
        $("play").textContent = "Pause";
        timer = setInterval(() => {
            const next = at + STEP_MS / 1000;
            seek(next);
            if (next >= line.state.span_s) stop();
        }, STEP_MS);
    };
    const marks = () => {
        const { images, bookmarks, span_s } = line.state;
        $("marks").setAttribute("viewBox", `0 0 1000 8`);
        $("marks").setAttribute("preserveAspectRatio", "none");
        $("marks").replaceChildren(...images.map((t) => {
            const x = (1000 * t) / Math.max(span_s, 1e-9);
            return svg("line", { x1: x, x2: x, y1: 0, y2: 8 });
        }), ...bookmarks.map((b) => {
            const x = (1000 * b.at_s) / Math.max(span_s, 1e-9);
            return svg("line", { class: "bookmark", x1: x, x2: x, y1: -4, y2: 8 });
        }));
    };

    line.take = (message) => {
        const state = { ...message, span_s: message.span_us / 1e6, at_s: message.at_us / 1e6,
            images: message.images.map((us) => us / 1e6) };
        const fresh = !line.state || line.state.images.length !== state.images.length ||
            JSON.stringify(line.state.bookmarks) !== JSON.stringify(state.bookmarks);
        line.state = state;
        waiting = false;
        $("timeline").hidden = false;
        listBookmarks();
        if (fresh) {
            $("at").max = state.span_s;
            marks();
        }
        if (wanted !== null) {
            const next = wanted;
            wanted = null;
            seek(next);
        } else if (!timer || state.at_s >= state.span_s) {
            say(state.at_s);
        }
        document.body.dataset.seekMs = state.took_ms;
    };
    line.lost = () => {
        if (waiting && wanted === null) wanted = asked; // the answer does not come any more
        waiting = false;
        stop();
    };
    $("at").oninput = () => seek(Number($("at").value));
    $("play").onclick = play;
    $("bookmarks").onchange = () => {
        if ($("bookmarks").value !== "") seek(Number($("bookmarks").value));
        $("bookmarks").value = "";
    };
    $("mark").onclick = () => naming(true);
    $("unnamed").onclick = () => naming(false);
    $("naming").onsubmit = (event) => {
        event.preventDefault();
        const name = $("name").value.trim();
        if (name) link.send({ mark: at, name });
        naming(false);
    };
    $("naming").onkeydown = (event) => {
        if (event.key === "Escape") naming(false);
    };
    $("unmark").onclick = () => link.send({ mark: markHere().at_s });
    $("earlier").onclick = () => seek(line.state.images.filter((t) => t < at - 1e-6).at(-1));
    $("later").onclick = () => seek(line.state.images.find((t) => t > at + 1e-6));
    $("at").onkeydown = (event) => {
        const step = { PageUp: 5, PageDown: -5, ArrowRight: 0.5, ArrowUp: 0.5, ArrowLeft: -0.5, ArrowDown: -0.5 }[event.key];
        if (step === undefined) return;
        event.preventDefault();
        seek(at + step);
    };
    return line;
}
