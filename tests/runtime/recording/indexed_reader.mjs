// Reads an MCAP file with npm's indexed reader, as Foxglove and Lichtblick do, and prints what it found as JSON.
// Arguments: the folder of npm's packages, the file, and a topic whose messages of the later half are counted apart.
import { createRequire } from "node:module";
import { open } from "node:fs/promises";

const [packages, path, topic] = process.argv.slice(2);
const require = createRequire(`${packages}/`);
const { McapIndexedReader } = require("@mcap/core");
const { decompress } = require("fzstd");

const file = await open(path);
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (offset, size) => {
    const bytes = new Uint8Array(Number(size));
    await file.read(bytes, 0, bytes.length, Number(offset));
    return bytes;
  },
};
const decompressHandlers = { zstd: (data, size) => decompress(data, new Uint8Array(Number(size))) };
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });

const counts = {};
let last = 0n;
let ordered = true;
for await (const message of reader.readMessages()) {
  const name = reader.channelsById.get(message.channelId).topic;
  counts[name] = (counts[name] ?? 0) + 1;
  ordered &&= message.logTime >= last;
  last = message.logTime;
}
const { messageStartTime, messageEndTime } = reader.statistics;
let later = 0;
for await (const _ of reader.readMessages({ topics: [topic], startTime: (messageStartTime + messageEndTime) / 2n })) {
  later += 1;
}
await file.close();
console.log(JSON.stringify({ counts, ordered, later, chunks: reader.chunkIndexes.length }));
