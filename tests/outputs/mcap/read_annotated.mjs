// Reads an MCAP with the packages that Foxglove reads it with; prints what it found as JSON.
import { open } from "node:fs/promises";
import { McapIndexedReader } from "@mcap/core";
import { FileHandleReadable } from "@mcap/nodejs";
import { loadDecompressHandlers } from "@mcap/support";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";

const file = await open(process.argv[2], "r");
const decompressHandlers = await loadDecompressHandlers();
const reader = await McapIndexedReader.Initialize({
  readable: new FileHandleReadable(file),
  decompressHandlers,
});
const found = { profile: reader.header.profile, messages: {}, markers: {}, rooms: [] };
const decoders = new Map();
for await (const message of reader.readMessages({ validateCrcs: true })) {
  const { topic, schemaId } = reader.channelsById.get(message.channelId);
  if (!decoders.has(schemaId)) {
    const text = new TextDecoder().decode(reader.schemasById.get(schemaId).data);
    decoders.set(schemaId, new MessageReader(parse(text, { ros2: true })));
  }
  const content = decoders.get(schemaId).readMessage(message.data);
  found.messages[topic] = (found.messages[topic] ?? 0) + 1;
  for (const marker of content.markers ?? []) {
    const { ns } = marker;
    found.markers[ns] ??= { count: 0, points: 0, x: 0 };
    found.markers[ns].count += 1;
    found.markers[ns].points += marker.points.length;
    found.markers[ns].x += marker.points.reduce((sum, point) => sum + point.x, 0);
  }
  if (topic === "/rose2/rooms") {
    found.rooms.push(content.rooms.map((room) => [room.track, room.area, Array.from(room.neighbors)]));
  }
}
await file.close();
console.log(JSON.stringify(found));
