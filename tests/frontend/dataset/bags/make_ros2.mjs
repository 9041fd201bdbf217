// Writes the bags of ROS 2 that are beside this file, with other people's libraries: MCAP and CDR by Foxglove's, LZ4,
// Zstandard and SQLite by their own programs, the tables as rosbag2 makes them.
// usage: npm install @mcap/core @foxglove/rosmsg2-serialization @foxglove/rosmsg @foxglove/rosmsg-msgs-common;
//        node make_ros2.mjs FOLDER (with the programs lz4, zstd and sqlite3)
import { spawnSync } from 'node:child_process';
import { readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';

const require = createRequire(join(process.cwd(), 'x.js'));
const { McapWriter } = require('@mcap/core');
const { parse } = require('@foxglove/rosmsg');
const { MessageWriter } = require('@foxglove/rosmsg2-serialization');
const HEADER = `
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
`;
const TYPES = {
  Image: `std_msgs/Header header
uint32 height
uint32 width
string encoding
uint8 is_bigendian
uint32 step
uint8[] data${HEADER}`,
  CompressedImage: `std_msgs/Header header
string format
uint8[] data${HEADER}`,
  CameraInfo: `std_msgs/Header header
uint32 height
uint32 width
string distortion_model
float64[] d
float64[9] k
float64[9] r
float64[12] p
uint32 binning_x
uint32 binning_y
sensor_msgs/RegionOfInterest roi${HEADER}================================================================================
MSG: sensor_msgs/RegionOfInterest
uint32 x_offset
uint32 y_offset
uint32 height
uint32 width
bool do_rectify
`,
};
const [folder] = process.argv.slice(2);
const WIDTH = 16, HEIGHT = 12;

// testing::Picture of dataset_files.h.
function picture(number) {
  const pixels = new Uint8Array(WIDTH * HEIGHT);
  for (let y = 0; y < HEIGHT; ++y) for (let x = 0; x < WIDTH; ++x) pixels[y * WIDTH + x] = x * 7 + y * y + 31 * number;
  return pixels;
}

function* messages() {
  const png = readFileSync(join(folder, 'picture_1.png'));
  for (let i = 0; i < 3; ++i) {
    const header = { stamp: { sec: 100 + i, nanosec: 500000000 }, frame_id: ['a', 'camera', 'left_optical'][i] };
    yield ['/left/image', 'Image', { header, height: HEIGHT, width: WIDTH, encoding: 'mono8', is_bigendian: 0, step: WIDTH, data: picture(i) }];
    yield ['/right/image/compressed', 'CompressedImage', { header, format: 'png', data: png }];
    yield ['/left/camera_info', 'CameraInfo', { header, height: HEIGHT, width: WIDTH, distortion_model: 'plumb_bob', d: [0.1, 0, 0, 0, 0.5],
      k: [20, 0, 8, 0, 21, 6, 0, 0, 1], r: [1, 0, 0, 0, 1, 0, 0, 0, 1], p: [20, 0, 8, 0, 0, 21, 6, 0, 0, 0, 1, 0], binning_x: 0,
      binning_y: 0, roi: { x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false } }];
  }
}
const encode = (type, message) => new MessageWriter(parse(TYPES[type], { ros2: true })).writeMessage(message);

const pack = { lz4: (bytes) => spawnSync('lz4', ['-c'], { input: bytes }).stdout, zstd: (bytes) => spawnSync('zstd', ['-c'], { input: bytes }).stdout };
async function mcap(packing) {
  const parts = [];
  let position = 0n;
  const writable = { position: () => position, write: async (bytes) => { parts.push(Buffer.from(bytes)); position += BigInt(bytes.byteLength); } };
  const writer = new McapWriter({ writable, chunkSize: 700, useChunks: packing !== 'unchunked',
    compressChunk: pack[packing] && ((bytes) => ({ compression: packing, compressedData: pack[packing](bytes) })) });
  await writer.start({ profile: 'ros2', library: 'make_ros2.mjs' });
  const channels = {};
  let time = 0n;
  for (const [topic, type, message] of messages()) {
    if (!(topic in channels)) {
      const schemaId = await writer.registerSchema({ name: `sensor_msgs/msg/${type}`, encoding: 'ros2msg', data: Buffer.from(TYPES[type]) });
      channels[topic] = await writer.registerChannel({ topic, schemaId, messageEncoding: 'cdr', metadata: new Map([['offered_qos_profiles', '']]) });
    }
    await writer.addMessage({ channelId: channels[topic], sequence: 0, logTime: ++time, publishTime: time, data: encode(type, message) });
  }
  await writer.end();
  writeFileSync(join(folder, `${packing}.mcap`), Buffer.concat(parts));
}

function sqlite() {
  const lines = ['PRAGMA page_size=512;', 'CREATE TABLE schema(schema_version INTEGER PRIMARY KEY,ros_distro TEXT NOT NULL);',
    'CREATE TABLE metadata(id INTEGER PRIMARY KEY,metadata_version INTEGER NOT NULL,metadata TEXT NOT NULL);',
    'CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,serialization_format TEXT NOT NULL,offered_qos_profiles TEXT NOT NULL);',
    'CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT NULL,timestamp INTEGER NOT NULL, data BLOB NOT NULL);',
    'CREATE INDEX timestamp_idx ON messages (timestamp ASC);', 'BEGIN;'];
  const topics = {};
  for (const [topic, type, message] of messages()) {
    if (!(topic in topics)) {
      topics[topic] = Object.keys(topics).length + 1;
      lines.push(`INSERT INTO topics VALUES(${topics[topic]},'${topic}','sensor_msgs/msg/${type}','cdr','');`);
    }
    lines.push(`INSERT INTO messages(topic_id,timestamp,data) VALUES(${topics[topic]},0,X'${Buffer.from(encode(type, message)).toString('hex')}');`);
  }
  const made = spawnSync('sqlite3', [join(folder, 'sqlite.db3')], { input: [...lines, 'COMMIT;'].join('\n'), encoding: 'utf8' });
  if (made.status !== 0) throw new Error(made.stderr);
}

for (const packing of ['plain', 'lz4', 'zstd', 'unchunked']) await mcap(packing);
sqlite();
