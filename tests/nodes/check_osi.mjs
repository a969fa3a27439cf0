// SPDX-License-Identifier: MIT
// A trace that `anlos bag export --format osi` wrote, by the MCAP library and OSI's types
// as they are published for viewers:
//   node check_osi.mjs TRACE
import * as osi from "@lichtblick/asam-osi-types";
import { McapIndexedReader } from "@mcap/core";
import { loadDecompressHandlers, protobufFromBinaryDescriptor } from "@mcap/support";
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";

// What upstream's declarations say a message has: name -> type.
async function declared() {
  const types = createRequire(import.meta.url)
    .resolve("@lichtblick/asam-osi-types")
    .replace(/index\.js$/, "index.d.ts");
  const text = await readFile(types, "utf8");
  const messages = new Map();
  for (const [, name, body] of text.matchAll(/^interface (\w+) \{\n([\s\S]*?)^\}/gm)) {
    const code = body.replace(/\/\*[\s\S]*?\*\//g, "");
    const fields = [...code.matchAll(/^ *(\w+)\??: (\w+)(\[\])?/gm)];
    messages.set(name, new Map(fields.map(([, f, type, many]) => [f, [type, !!many]])));
  }
  return messages;
}

const scalars = { double: "number", uint32: "number", uint64: "number", int64: "number" };

// Each field and enumerator of ours is one of theirs.  Returns how many fields there are.
function checkType(type, path, messages) {
  const theirs = messages.get(path);
  assert.ok(theirs, path);
  for (const f of type.fieldsArray) {
    const [kind, many] = theirs.get(f.name) ?? assert.fail(`${path}.${f.name}`);
    assert.equal(f.repeated, many, `${path}.${f.name}`);
    const ours = f.type.split(".").at(-1);
    assert.equal(kind.split("_").at(-1), scalars[f.type] ?? ours, `${path}.${f.name}`);
  }
  let n = type.fieldsArray.length;
  for (const nested of type.nestedArray ?? []) {
    const name = `${path}_${nested.name}`;
    if (nested.fieldsArray) {
      n += checkType(nested, name, messages);
      continue;
    }
    const prefix = `${nested.name.replace(/(?<=.)([A-Z])/g, "_$1").toUpperCase()}_`;
    for (const [label, value] of Object.entries(nested.values))
      assert.equal(osi[name][label.replace(prefix, "")], value, `${name}.${label}`);
  }
  return n;
}

const bytes = await readFile(process.argv[2]);
const reader = await McapIndexedReader.Initialize({
  readable: {
    size: async () => BigInt(bytes.length),
    read: async (at, n) => bytes.subarray(Number(at), Number(at + n)),
  },
  decompressHandlers: await loadDecompressHandlers(),
});
const trace = [];
for await (const m of reader.readMetadata({ name: "net.asam.osi.trace" })) trace.push(m.metadata);
assert.equal(trace.length, 1);
for (const key of ["version", "min_osi_version", "max_osi_version", "min_protobuf_version",
                   "max_protobuf_version"])
  assert.match(trace[0].get(key), /^\d+\.\d+\.\d+$/, key);

const messages = await declared();
const types = new Map();
for (const c of reader.channelsById.values()) {
  const schema = reader.schemasById.get(c.schemaId);
  assert.deepEqual([c.messageEncoding, schema.encoding], ["protobuf", "protobuf"]);
  assert.equal(c.metadata.get("net.asam.osi.trace.channel.osi_version"), "3.7.0");
  const root = protobufFromBinaryDescriptor(schema.data);
  for (const type of root.lookup("osi3").nestedArray)
    if (type.fieldsArray) assert.ok(checkType(type, type.name, messages) > 0);
  types.set(c.id, root.lookupType(schema.name));
}

// Every list has its truth at the same time.
const lists = { SensorData: [], GroundTruth: [] };
for await (const m of reader.readMessages()) {
  const type = types.get(m.channelId);
  lists[type.name].push(type.toObject(type.decode(m.data), { longs: Number }));
}
const { SensorData: told, GroundTruth: truth } = lists;
assert.ok(told.length > 0);
assert.equal(told.length, truth.length);
told.forEach((d, i) => {
  assert.deepEqual(d.last_measurement_time, truth[i].timestamp);
  assert.equal(truth[i].moving_object[0].id.value, truth[i].host_vehicle_id.value);
});
const n = told.reduce((sum, d) => sum + (d.moving_object?.length ?? 0), 0);
console.log(`${told.length} lists, ${n} objects`);
