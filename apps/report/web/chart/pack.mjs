// Packs the chart library for the report: gzip, then base64, so that a page stays below 3 MB.
// usage: node pack.mjs node_modules/plotly.js-dist-min/plotly.min.js OUT
import { readFileSync, writeFileSync } from 'node:fs';
import { gzipSync } from 'node:zlib';

const [source, out] = process.argv.slice(2);
writeFileSync(out, gzipSync(readFileSync(source), { level: 9 }).toString('base64'));
