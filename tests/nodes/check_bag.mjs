// SPDX-License-Identifier: MIT
// The format's own JavaScript library reads our bags and writes one for us.
//   node check_bag.mjs read BAG LINES   the bag is what `anlos bag export --format json`
//                                       says, its messages decoded by its own schemas
//   node check_bag.mjs count BAG        messages that can be read before the first damage
//   node check_bag.mjs write BAG        10 messages of another program
import { McapIndexedReader, McapStreamReader, McapWriter } from "@mcap/core";
import { loadDecompressHandlers, protobufFromBinaryDescriptor } from "@mcap/support";
import assert from "node:assert/strict";
import { open, readFile, writeFile } from "node:fs/promises";

const decompressHandlers = await loadDecompressHandlers();

async function readable(path) {
  const file = await open(path);
  return {
    size: async () => BigInt((await file.stat()).size),
    read: async (offset, length) => {
      const bytes = new Uint8Array(Number(length));
      const { bytesRead } = await file.read(bytes, 0, bytes.length, Number(offset));
      assert.equal(bytesRead, bytes.length);
      return bytes;
    },
    close: () => file.close(),
  };
}

function types(reader) {
  const found = new Map();
  for (const [id, schema] of reader.schemasById) {
    assert.equal(schema.encoding, "protobuf");
    const root = protobufFromBinaryDescriptor(schema.data);
    found.set(id, root.lookupType(schema.name));
  }
  return found;
}

// A few fields of each kind, as both sides print them.
function compare(decoded, content) {
  for (const [name, value] of Object.entries(content)) {
    const camel = name.replace(/_([a-z])/g, (_, c) => c.toUpperCase());
    const theirs = decoded[name] ?? decoded[camel];
    const off = Math.abs(Number(theirs ?? 0) - value);
    if (typeof value === "boolean") assert.equal(Boolean(theirs), value, name);
    else if (typeof value === "number") assert.ok(off <= 1e-8 * Math.abs(value), name);
    else if (name === "id") assert.equal(String(theirs), value, name);
    else if (name === "samples")
      assert.deepEqual(Array.from(theirs.shape), value.shape, name);
  }
}

async function read(path, linesPath) {
  const file = await readable(path);
  const reader = await McapIndexedReader.Initialize({ readable: file, decompressHandlers });
  const text = await readFile(linesPath, "utf8");
  const lines = text.trim().split("\n").map((line) => JSON.parse(line));
  const typeOf = types(reader);
  let i = 0;
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const channel = reader.channelsById.get(message.channelId);
    const line = lines[i++];
    assert.equal(channel.messageEncoding, "protobuf");
    assert.equal(channel.topic, line.topic);
    assert.equal(channel.metadata.get("node"), line.from);
    assert.equal(Number(message.logTime), line.publish_ns);
    const captured = channel.metadata.get("capture") === "publish_time";
    assert.equal(captured ? Number(message.publishTime) : 0, line.capture_ns);
    assert.equal(message.sequence, line.sequence);
    assert.equal(message.data.byteLength, line.bytes);
    compare(typeOf.get(channel.schemaId).decode(message.data), line.content);
  }
  assert.equal(i, lines.length);
  assert.equal(reader.statistics.messageCount, BigInt(i));
  for await (const attachment of reader.readAttachments({ validateCrcs: true }))
    assert.equal(attachment.name, "survey.yaml");
  await file.close();
  // From the first byte to the last, every checksum looked at.
  const stream = new McapStreamReader({ validateCrcs: true, decompressHandlers });
  stream.append(await readFile(path));
  let n = 0;
  for (let r; (r = stream.nextRecord()); ) n += r.type === "Message";
  assert.equal(n, i);
  assert.ok(stream.done());
  console.log(`${path}: ${n} messages`);
}

async function count(path) {
  const stream = new McapStreamReader({ validateCrcs: true, decompressHandlers });
  stream.append(await readFile(path));
  let n = 0;
  try {
    for (let r; (r = stream.nextRecord()); ) n += r.type === "Message";
  } catch {
    // the damage
  }
  console.log(n);
}

async function write(path) {
  const parts = [];
  let size = 0n;
  const writable = {
    position: () => size,
    write: async (bytes) => {
      parts.push(bytes.slice());
      size += BigInt(bytes.byteLength);
    },
  };
  const writer = new McapWriter({ writable, useChunks: true, chunkSize: 300 });
  const text = (s) => new TextEncoder().encode(s);
  await writer.start({ profile: "", library: "other" });
  const schema = { name: "T", encoding: "jsonschema", data: text("{}") };
  const schemaId = await writer.registerSchema(schema);
  const channelId = await writer.registerChannel({
    topic: "/other",
    schemaId,
    messageEncoding: "json",
    metadata: new Map([["k", "v"]]),
  });
  for (let i = 0; i < 10; i++) {
    const time = BigInt(1000 + 10 * (i ^ 1)); // not in order
    await writer.addMessage({
      channelId,
      sequence: i,
      logTime: time,
      publishTime: time,
      data: text(`{"i": ${i}, "text": "${"x".repeat(60)}"}`),
    });
  }
  await writer.addAttachment({
    name: "a",
    logTime: 1n,
    createTime: 2n,
    mediaType: "text/plain",
    data: text("hello"),
  });
  await writer.addMetadata({ name: "m", metadata: new Map([["a", "b"]]) });
  await writer.end();
  await writeFile(path, Buffer.concat(parts));
}

const [verb, ...paths] = process.argv.slice(2);
await { read, count, write }[verb](...paths);
