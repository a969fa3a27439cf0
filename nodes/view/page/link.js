// SPDX-License-Identifier: MIT
// The WebSocket: connects again by itself, unpacks frames, tells how it stands.
const RETRY_MS = [300, 600, 1200, 2500];
const SILENT_MS = 3500; // the server gives a sign of life every second
const LEAVE_MS = 3 * SILENT_MS;
const TICK_MS = 1000;
const STORY = 12; // events that are kept

function unpack(data) {
    if (typeof data === "string") return [JSON.parse(data), null];
    const length = new DataView(data).getUint32(0, true);
    const text = new TextDecoder().decode(new Uint8Array(data, 4, length));
    return [JSON.parse(text), new Uint8Array(data, 4 + length)];
}

// take(message, bytes) is called for each message, changed() when the state may be another.
export function connect(take, changed) {
    const link = { open: false, tries: 0, send: () => false, story: [] };
    let socket; // null: there is none now
    // The silence that this page was awake to hear.  On a loaded machine it may stand still
    // itself for long, with the signs of life behind it in the queue: that is no silence.
    let silentMs = 0;
    let tickedAt = performance.now();
    const sinceTick = () => Math.min(performance.now() - tickedAt, TICK_MS);
    const heard = () => {
        silentMs = 0;
        tickedAt = performance.now();
    };

    const note = (text) => {
        link.story.push(`${new Date().toTimeString().slice(0, 8)} ${text}`);
        if (link.story.length > STORY) link.story.shift();
    };
    const lost = (why) => {
        note(why);
        link.open = false;
        socket = null;
        setTimeout(start, RETRY_MS[Math.min(link.tries++, RETRY_MS.length - 1)]);
        changed();
    };
    // One that does not answer is waited for neither to open nor to close, which a browser
    // does for minutes.
    const leave = (why) => {
        const old = socket;
        old.onopen = old.onmessage = old.onclose = null;
        old.close(4000, why);
        lost(why);
    };

    function start() {
        socket = new WebSocket(`ws://${location.host}/live`);
        socket.binaryType = "arraybuffer";
        heard();
        socket.onopen = () => {
            link.open = true;
            link.tries = 0;
            heard();
            note("connected");
            changed();
        };
        socket.onmessage = (event) => {
            heard();
            take(...unpack(event.data));
        };
        socket.onclose = (event) => {
            const [code, words] = [`code ${event.code}`, event.reason && `: ${event.reason}`];
            lost(`${link.open ? "disconnected" : "not connected"}, ${code}${words}`);
        };
    }
    link.send = (request) => {
        if (!link.open || socket.readyState !== WebSocket.OPEN) return false;
        socket.send(JSON.stringify(request));
        return true;
    };
    link.silentMs = () => silentMs + sinceTick();
    setInterval(() => {
        silentMs += sinceTick();
        tickedAt = performance.now();
        if (socket && silentMs > LEAVE_MS)
            leave(`${link.open ? "heard nothing" : "no answer"} for ${Math.round(silentMs / 1000)} s`);
        changed();
    }, TICK_MS);
    start();
    return link;
}

export { SILENT_MS };
