// SPDX-License-Identifier: MIT
// Foxglove's own client library against our server, and its decoding of our schemas.
//   node check_foxglove.mjs serve RIG LAYOUT  RIG is tests/nodes/foxglove_rig.c
//   node check_foxglove.mjs bag FILE X Y Z    what `anlos bag export --format foxglove`
//                                             wrote has its first object there, in m
import upstream from "@foxglove/schemas/internal.js";
import foxglove from "@foxglove/ws-protocol";
import { McapIndexedReader } from "@mcap/core";
import { loadDecompressHandlers, protobufFromBinaryDescriptor } from "@mcap/support";
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { open, readFile } from "node:fs/promises";
import { createInterface } from "node:readline";
import { WebSocket } from "ws";

const { FoxgloveClient } = foxglove;
const publishNs = 1700000001500000000n;

async function startRig(path) {
  const process = spawn(path, { stdio: ["pipe", "pipe", "inherit"] });
  const lines = createInterface({ input: process.stdout })[Symbol.asyncIterator]();
  const next = async () => (await lines.next()).value;
  const port = Number(await next());
  const ask = async (line) => {
    process.stdin.write(`${line}\n`);
    return next();
  };
  const exited = new Promise((resolve) => process.on("exit", resolve));
  return { url: `ws://127.0.0.1:${port}/`, ask, process, exited };
}

// Keeps what a client hears until it is asked for: several may come at once.
class Ears {
  #heard = new Map();
  #waiting = new Map();

  constructor(client, events) {
    for (const event of events) {
      this.#heard.set(event, []);
      client.on(event, (value) => {
        const waiting = this.#waiting.get(event);
        this.#waiting.delete(event);
        if (waiting) waiting(value);
        else this.#heard.get(event).push(value);
      });
    }
  }

  count(event) {
    return this.#heard.get(event).length;
  }

  async next(event) {
    if (this.count(event)) return this.#heard.get(event).shift();
    return new Promise((resolve) => this.#waiting.set(event, resolve));
  }
}

async function connect(url, subprotocol) {
  const socket = new WebSocket(url, [subprotocol]);
  const client = new FoxgloveClient({ ws: socket });
  const events = ["serverInfo", "advertise", "message", "status", "time"];
  const ears = new Ears(client, events);
  const info = await ears.next("serverInfo");
  const channels = await ears.next("advertise");
  assert.equal(socket.protocol, subprotocol);
  const byTopic = new Map(channels.map((c) => [c.topic, c]));
  return { socket, client, ears, info, byTopic };
}

function decode(channel, data) {
  assert.equal(channel.encoding, "protobuf");
  assert.equal(channel.schemaEncoding, "protobuf");
  const root = protobufFromBinaryDescriptor(Buffer.from(channel.schema, "base64"));
  const bytes = new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
  const type = root.lookupType(channel.schemaName);
  return type.toObject(type.decode(bytes), { defaults: true });
}

// Every field and value of our copy of a schema is, by name, number and type, upstream's.
function checkSchema(channel) {
  const root = protobufFromBinaryDescriptor(Buffer.from(channel.schema, "base64"));
  const short = (type) => type.replace(/^\.?(foxglove\.)?(\w+\.(?=[A-Z]))?/, "");
  let n = 0;
  for (const type of root.lookup("foxglove").nestedArray) {
    const schema = upstream.foxgloveMessageSchemas[type.name];
    const enums = Object.values(upstream.foxgloveEnumSchemas).filter(
      (e) => e.parentSchemaName === type.name,
    );
    const text = upstream.generateProto(schema, enums);
    const expected = new Map();
    for (const [, repeated, kind, name, id] of text.matchAll(
      /^ *(repeated )? *([\w.]+) (\w+) = (\d+);/gm,
    ))
      expected.set(name, [Number(id), short(kind), Boolean(repeated)]);
    for (const f of type.fieldsArray) {
      const theirs = expected.get(f.name);
      assert.deepEqual([f.id, short(f.type), f.repeated], theirs, `${type.name}.${f.name}`);
      n++;
    }
    for (const e of type.nestedArray) {
      const values = enums.find((x) => x.protobufEnumName === e.name).values;
      const theirs = Object.fromEntries(values.map((v) => [v.name, v.value]));
      assert.deepEqual({ ...e.values }, theirs, `${type.name}.${e.name}`);
    }
  }
  return n;
}

// Subscribes, and resolves with the first message.
async function receive({ client, ears, byTopic }, topic, cause) {
  const channel = byTopic.get(topic);
  const id = client.subscribe(channel.id);
  await cause?.();
  let message;
  do message = await ears.next("message");
  while (message.subscriptionId !== id);
  client.unsubscribe(id);
  return { ...message, content: decode(channel, message.data) };
}

const near = (a, b, what) => assert.ok(Math.abs(a - b) < 1e-6, `${what}: ${a}, not ${b}`);

function checkCloud(cloud) {
  assert.equal(cloud.frame_id, "array");
  assert.deepEqual(
    cloud.fields.map((f) => [f.name, f.offset]),
    [["x", 0], ["y", 4], ["z", 8], ["intensity", 12]],
  );
  assert.equal(cloud.point_stride, 16);
  const view = new DataView(cloud.data.buffer, cloud.data.byteOffset, cloud.data.length);
  const points = [];
  for (let at = 0; at < view.byteLength; at += 16)
    points.push([0, 4, 8, 12].map((i) => view.getFloat32(at + i, true)));
  assert.equal(points.length, 2);
  // Imaged at z = 1.5 and 1.9, behind the wall at z = 1.
  const expected = [[-0.2, -0.1, 0.5, -10], [0.1, 0, 0.1, 0]];
  points.forEach((p, i) => p.forEach((v, k) => near(v, expected[i][k], `point ${i}`)));
}

// The topics, fields and panels that a layout names are there, and what is plotted is a number.
async function checkLayout(path, byTopic) {
  const { configById, layout } = JSON.parse(await readFile(path, "utf8"));
  const topics = Object.values(configById).flatMap((panel) => [
    ...Object.keys(panel.topics ?? {}),
    panel.imageMode?.imageTopic,
    panel.topicToRender,
  ]);
  for (const topic of topics.filter(Boolean)) assert.ok(byTopic.has(topic), topic);
  const plots = Object.values(configById).flatMap((panel) => panel.paths ?? []);
  assert.equal(plots.length, 3);
  for (const { value } of plots) {
    const [, topic, field] = /^([a-z/]+)\.([a-z_]+)$/.exec(value);
    const channel = byTopic.get(topic);
    const root = protobufFromBinaryDescriptor(Buffer.from(channel.schema, "base64"));
    assert.match(root.lookupType(channel.schemaName).fields[field].type, /^(double|uint32)$/, value);
  }
  const leaves = (part) =>
    typeof part === "string" ? [part] : [...leaves(part.first), ...leaves(part.second)];
  assert.deepEqual(leaves(layout).sort(), Object.keys(configById).sort());
}

async function serve(path, layout) {
  const rig = await startRig(path);
  const early = await connect(rig.url, "foxglove.sdk.v1");
  assert.equal(early.byTopic.size, 0); // nothing has come yet
  for (const topic of ["survey", "stage/state", "volume", "detections", "wall"])
    await rig.ask(`send ${topic}`);
  const later = new Set();
  await rig.ask("send log");
  while (!later.has("view/log"))
    for (const channel of await early.ears.next("advertise")) later.add(channel.topic);
  early.client.close();
  for (const subprotocol of ["foxglove.sdk.v1", "foxglove.websocket.v1"]) {
    const c = await connect(rig.url, subprotocol);
    assert.equal(c.info.name, "anlos");
    assert.deepEqual(c.info.capabilities, ["time"]);
    assert.equal(c.info.sessionId, "42");
    for (const topic of ["volume", "detections", "log", "view/objects", "view/log"])
      assert.ok(c.byTopic.has(topic), topic);
    assert.ok(!c.byTopic.has("ping"));
    assert.equal(c.byTopic.get("volume").schemaName, "anlos.Volume");
    await checkLayout(layout, c.byTopic);
    for (const channel of c.byTopic.values())
      if (channel.schemaName.startsWith("foxglove.")) assert.ok(checkSchema(channel) >= 4);

    // An event is heard by who has subscribed before, which the answer to what comes
    // after it tells.
    const log = await receive(c, "view/log", async () => {
      c.socket.send('{"op": "settle"}');
      assert.match((await c.ears.next("status")).message, /settle/);
      await rig.ask("send log");
    });
    assert.equal(log.content.name, "dsp");
    assert.equal(log.content.level, 3);
    assert.equal(log.timestamp, publishNs);

    // State is kept for who comes late.
    await rig.ask("send survey");
    await rig.ask("send volume");
    await rig.ask("send detections");
    checkCloud((await receive(c, "view/cloud")).content);
    const volume = await receive(c, "volume");
    assert.deepEqual(volume.content.intensity.shape, [6, 4, 5]);
    const objects = (await receive(c, "view/objects")).content;
    assert.deepEqual(objects.entities.map((e) => e.id), ["object 1"]);
    const figures = (await receive(c, "view/figures")).content;
    assert.equal(figures.objects, 1);
    near(figures.snr_db, 31.4, "signal to noise");
    near(figures.latency_ms, 1250, "latency");
    const scene = (await receive(c, "view/scene")).content;
    assert.deepEqual(scene.entities.map((e) => e.id), ["vehicle", "array"]);
    assert.deepEqual(scene.deletions.map((d) => d.id), ["wall"]); // view/walls knows better
    const walls = (await receive(c, "view/walls")).content;
    assert.deepEqual(walls.entities.map((e) => e.id), ["wall 3"]);
    const frames = (await receive(c, "view/frames")).content.transforms;
    assert.deepEqual(
      frames.map((f) => [f.parent_frame_id, f.child_frame_id]),
      [["vehicle", "array"], ["array", "stage"]],
    );
    const front = (await receive(c, "view/front")).content;
    assert.equal(front.format, "png");
    assert.equal(Buffer.from(front.data).toString("latin1", 1, 4), "PNG");
    const voxels = (await receive(c, "view/voxels")).content;
    assert.deepEqual([voxels.column_count, voxels.row_count], [5, 4]);

    // The time is told now and then, however often it changes.
    for (let t = 1; !c.ears.count("time"); t++) await rig.ask(`time ${t}`);
    assert.ok((await c.ears.next("time")).timestamp > 0n);

    // What cannot be done is said, and the connection goes on.
    const complaints = [
      ['{"op": "subscribe", "subscriptions": [{"id": 7, "channelId": 9999}]}', /9999/],
      ['{"op": "getParameters", "parameterNames": []}', /getParameters/],
      ['{"op": "dance"}', /dance/],
      ["not json", /JSON/],
      [Buffer.from([9, 9]), /binary/],
    ];
    for (const [request, expected] of complaints) {
      c.socket.send(request);
      const { level, message } = await c.ears.next("status");
      assert.equal(level, 2);
      assert.match(message, expected);
    }
    await receive(c, "volume");
    const closed = new Promise((resolve) => c.socket.on("close", resolve));
    c.client.close();
    await closed;
  }
  const wrong = new WebSocket(rig.url, ["chat"]);
  await new Promise((resolve) => wrong.on("error", resolve));
  const foreign = new WebSocket(rig.url, ["foxglove.sdk.v1"], { origin: "http://x.com" });
  await new Promise((resolve) => foreign.on("error", resolve));

  const last = await connect(rig.url, "foxglove.sdk.v1");
  const closed = new Promise((resolve) => last.socket.on("close", resolve));
  rig.process.stdin.end();
  assert.equal(await closed, 1001);
  assert.equal(await rig.exited, 0);
  console.log("served");
}

// v turned by the quaternion q, and moved.
function placed(v, q, t) {
  const u = [q.x, q.y, q.z];
  const cross = (a, b) => [0, 1, 2].map((i) => {
    const [j, k] = [(i + 1) % 3, (i + 2) % 3];
    return a[j] * b[k] - a[k] * b[j];
  });
  const c = cross(u, v).map((x, i) => x + q.w * v[i]);
  return cross(u, c).map((x, i) => v[i] + 2 * x + [t.x, t.y, t.z][i]);
}

const distance = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));

function brightestPoint(cloud) {
  const view = new DataView(cloud.data.buffer, cloud.data.byteOffset, cloud.data.length);
  for (let at = 0; at < view.byteLength; at += cloud.point_stride)
    if (view.getFloat32(at + 12, true) > -1e-3)
      return [0, 4, 8].map((i) => view.getFloat32(at + i, true));
  return assert.fail("no point is the brightest");
}

function brightestCell(grid) {
  const view = new DataView(grid.data.buffer, grid.data.byteOffset, grid.data.length);
  for (let at = 0; at < view.byteLength; at += grid.cell_stride) {
    if (view.getFloat32(at, true) < -1e-3) continue;
    const z = Math.floor(at / grid.slice_stride);
    const y = Math.floor((at % grid.slice_stride) / grid.row_stride);
    const x = (at % grid.row_stride) / grid.cell_stride;
    const { cell_size: s, pose } = grid;
    const middle = [(x + 0.5) * s.x, (y + 0.5) * s.y, (z + 0.5) * s.z];
    return placed(middle, pose.orientation, pose.position);
  }
  return assert.fail("no cell is the brightest");
}

// What is drawn at the end of a scan lies in one place, in the frame of the vehicle.
async function bag(path, x, y, z) {
  const file = await open(path);
  const readable = {
    size: async () => BigInt((await file.stat()).size),
    read: async (offset, length) => {
      const bytes = new Uint8Array(Number(length));
      await file.read(bytes, 0, bytes.length, Number(offset));
      return bytes;
    },
  };
  const decompressHandlers = await loadDecompressHandlers();
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const newest = new Map();
  for await (const m of reader.readMessages({ validateCrcs: true })) {
    const { topic, schemaId } = reader.channelsById.get(m.channelId);
    if (!topic.startsWith("view/")) continue;
    const schema = reader.schemasById.get(schemaId);
    const type = protobufFromBinaryDescriptor(schema.data).lookupType(schema.name);
    newest.set(topic, type.toObject(type.decode(m.data), { defaults: true }));
  }
  await file.close();
  const { transforms } = newest.get("view/frames");
  const mount = transforms.find((t) => t.child_frame_id === "array");
  const inVehicle = (p) => placed(p, mount.rotation, mount.translation);
  const truth = [x, y, z].map(Number);
  const object = newest.get("view/objects").entities[0];
  assert.equal(object.frame_id, "vehicle");
  const { position } = object.spheres[0].pose;
  const cloud = newest.get("view/cloud");
  const voxels = newest.get("view/voxels");
  assert.deepEqual([cloud.frame_id, voxels.frame_id], ["array", "array"]);
  const places = {
    object: [position.x, position.y, position.z],
    cloud: inVehicle(brightestPoint(cloud)),
    voxels: inVehicle(brightestCell(voxels)),
  };
  for (const [what, place] of Object.entries(places))
    assert.ok(distance(place, truth) < 0.03, `${what} at ${place}, not at ${truth}`);
  for (const side of ["front", "top", "side"])
    assert.equal(newest.get(`view/${side}`).format, "png");
  console.log(places);
}

const [verb, ...words] = process.argv.slice(2);
await { serve, bag }[verb](...words);
