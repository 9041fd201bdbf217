'use strict';
// Trajectories from above and in 3D, with the loops.

const AXES = ['x', 'y', 'z'];

function extents(path) {
  return AXES.map((a) => {
    let low = Infinity, high = -Infinity;
    for (const v of path[a]) if (isNumber(v)) { low = Math.min(low, v); high = Math.max(high, v); }
    return high > low ? high - low : 0;
  });
}

// Of several paths together.
const boxOf = (all) => extents(Object.fromEntries(AXES.map((a) => [a, all.flatMap((path) => path[a])])));

// The path that the axes are chosen by.
const mainPath = () => {
  const runs = runsHere();
  return (runs.find((run) => run.reference) ?? {}).reference ?? chosen().slam;
};

// The two axes of largest extent, in their order, and the third.
function planeOf(path) {
  const size = extents(path);
  const up = size.indexOf(Math.min(...size));
  const plane = [0, 1, 2].filter((k) => k !== up);
  return { plane, up };
}

// Name and path of every line of the map.
function paths() {
  const runs = runsHere();
  const lines = [];
  const reference = runs.find((run) => run.reference);
  if (reference) lines.push({ name: 'reference', path: reference.reference, width: 3 });
  const alone = runs.find((run) => run.variant === 'odometry');
  const odometry = alone ?? chosen();
  if (odometry.odometry.x.length) lines.push({ name: 'odometry', path: odometry.odometry, width: 2 });
  // Keyframes of the recordings that the map held before.
  (chosen().earlier ?? []).forEach((path, k) => {
    if (path.x.length) lines.push({ name: `session ${k + 1}`, path, width: 1.5 });
  });
  for (const run of runs) {
    if (run.variant !== 'odometry' && run.slam.x.length) lines.push({ name: run.variant, path: run.slam, width: 2.5 });
  }
  return merged(lines, (line) => AXES.map((a) => line.path[a]));
}

const edgesOf = (run, outcome) => run.loops.filter((loop) => loop.outcome === outcome && loop.a);

const edgeText = (loop) => label(`frame ${loop.query} to ${loop.candidate}, H = ${fixed(loop.h, 3)}, probability ${fixed(loop.p, 3)}, ` +
  `${loop.inliers} inliers${loop.reason ? `; ${loop.reason}` : ''}`);

// Lines, broken between edges, and a mark at the newer end of each.
function edgeTraces(run, make) {
  const traces = [];
  for (const [outcome, style] of Object.entries(OUTCOMES)) {
    const edges = edgesOf(run, outcome);
    if (!edges.length) continue;
    const hidden = outcome === 'rejected' || outcome === 'missed' ? 'legendonly' : true;
    const name = `${style.name} (${edges.length})`;
    const lines = [[], [], []], marks = [[], [], []];
    for (const edge of edges) {
      for (let k = 0; k < 3; ++k) {
        lines[k].push(edge.a[k], edge.b[k], null);
        marks[k].push(edge.b[k]);
      }
    }
    traces.push(
      { ...make(lines), mode: 'lines', name, legendgroup: outcome, showlegend: false, visible: hidden,
        hoverinfo: 'skip', line: { color: style.color, dash: style.dash, width: 2 } },
      { ...make(marks), mode: 'markers', name, legendgroup: outcome, visible: hidden,
        text: edges.map(edgeText), hoverinfo: 'text+name',
        marker: { color: style.color, symbol: style.symbol, size: make.size, line: { width: 0 } } });
  }
  return traces;
}

// Rings where a lost frame, or a new recording, was found in the map.
function foundTraces(run, make) {
  const found = run.found ?? [];
  if (!found.length) return [];
  const text = ({ frame, by_loop: loop }) => `frame ${frame}: ${loop ? 'a loop joined the recording with the map' : 'the loop detector knew the place'}`;
  return [{ ...make(AXES.map((_, k) => found.map(({ p }) => p[k]))), mode: 'markers', name: `found in the map (${found.length})`, text: found.map(text),
    hoverinfo: 'text', marker: { color: css('--ink'), symbol: 'circle-open', size: make.size + 5, line: { width: 2, color: css('--ink') } } }];
}

const missingMap = () => (runsHere().some((run) => run.slam.x.length) && chosen().slam.x.length ? ''
  : 'No map: there is no trajectory. Without a calibration there are loops alone.');

async function drawTop(panel) {
  await drawTopChart(panel, 'tall');
  panel.append(note(mapNote(chosen())));
}

async function drawTopChart(panel, size) {
  const run = chosen();
  const { plane: [right, ahead], up } = planeOf(mainPath());
  const make = (points) => ({ type: 'scatter', x: points[right], y: points[ahead] });
  make.size = 8;
  const traces = toldApart(paths().map((line) => ({ ...make(AXES.map((a) => line.path[a])), mode: 'lines', name: label(line.names.join(', ')),
    line: lineOf(line.names.at(-1), line.width), hovertemplate: '%{x:.2f}, %{y:.2f}' })));
  traces.push(...edgeTraces(run, make), ...foundTraces(run, make));
  // Cameras look along z with y down: from above, x is right and z ahead.
  const layout = layoutOf(`Top view, along ${AXES[up]}`, {
    xaxis: axis(`${AXES[right]} [${run.unit}]`),
    yaxis: axis(`${AXES[ahead]} [${run.unit}]`, { scaleanchor: 'x', scaleratio: 1 }),
    dragmode: 'pan',
  });
  await chart(panel, size, traces, layout);
}

function mapNote(run) {
  const loops = run.loops.filter((loop) => loop.outcome !== 'missed');
  const drawn = loops.filter((loop) => loop.a).length;
  const aligned = run.reference ? 'Estimates are aligned to the reference.' : 'No reference: estimates in the frame of the first camera.';
  const shown = data.runs.length > 1 ? ` Loops of ${run.variant}.` : '';
  const rest = drawn < loops.length ? ` ${loops.length - drawn} loops end at frames without a pose in this submap.` : '';
  return `${aligned}${shown} Rejected and missed loops: tap their name in the legend.${rest}`;
}

// The dense surface of `tutti dense`: places are 16 bit steps from a corner of its box.
function surfaceOf(run) {
  if (!run.surface) return null;
  const bytes = (name) => Uint8Array.from(atob(run.surface[name]), (c) => c.charCodeAt(0));
  const numbers = (name) => new Uint16Array(bytes(name).buffer);
  const every = (values, k, make = (v) => v) => Array.from({ length: values.length / 3 }, (_, i) => make(values[3 * i + k]));
  const places = numbers('places'), corners = numbers('corners'), colours = bytes('colours');
  const [x, y, z] = AXES.map((_, k) => every(places, k, (v) => run.surface.low[k] + run.surface.step * v));
  const [i, j, k] = AXES.map((_, n) => every(corners, n));
  const vertexcolor = Array.from({ length: colours.length / 3 }, (_, n) => `rgb(${colours.subarray(3 * n, 3 * n + 3).join()})`);
  return { type: 'mesh3d', name: 'surface', showlegend: true, hoverinfo: 'skip', x, y, z, i, j, k, vertexcolor,
    flatshading: true, lighting: { ambient: 0.85, diffuse: 0.35, specular: 0, fresnel: 0 } };
}

// From where a surface is looked at: from the side of the cameras that saw it; without one from a corner.
function towards(surface, path, up) {
  const corner = [0.7, 0.7, 0.7];
  if (!surface) return corner;
  const middle = (values) => values.reduce((sum, v) => sum + v, 0) / values.length;
  const side = AXES.map((a, k) => (k === up ? 0 : middle(path[a].filter(isNumber)) - middle(surface[a]))), length = Math.hypot(...side);
  return length > 0.1 * Math.hypot(...extents(surface)) ? side.map((v) => v / length) : corner;
}

async function draw3d(panel) {
  const run = chosen();
  const { up } = planeOf(mainPath());
  const make = (points) => ({ type: 'scatter3d', x: points[0], y: points[1], z: points[2] });
  make.size = 4;
  const traces = toldApart(paths().map((line) => ({ ...make(AXES.map((a) => line.path[a])), mode: 'lines', name: label(line.names.join(', ')),
    line: lineOf(line.names.at(-1), line.width + 2), hovertemplate: '%{x:.2f}, %{y:.2f}, %{z:.2f}' })));
  const landmarks = run.landmarks ?? { x: [], y: [], z: [] }, surface = surfaceOf(run);
  if (landmarks.x.length) {
    traces.unshift({ ...make(AXES.map((a) => landmarks[a])), mode: 'markers', name: 'landmarks', hoverinfo: 'skip',
      visible: surface ? 'legendonly' : true,
      marker: { size: 1.6, color: css('--faint'), opacity: 0.7 } });
  }
  if (surface) traces.unshift(surface);
  traces.push(...edgeTraces(run, make), ...foundTraces(run, make));
  const sign = up === 1 ? -1 : 1;  // a camera's y points down
  // All of it at first sight: a box whose longest side is 1, seen from as far as its diagonal needs.
  const size = boxOf([...paths().map((line) => line.path), surface ?? landmarks]), longest = Math.max(...size, 1e-9);
  const box = size.map((side) => Math.max(side / longest, 0.05));
  const away = (narrow() ? 1.6 : 1.1) * Math.hypot(...box);
  const eye = towards(surface, run.slam, up).map((share) => away * share);
  eye[up] = away * (surface ? 0.6 : 1) * sign;
  const vector = (v) => ({ x: v[0], y: v[1], z: v[2] });
  const scene = { aspectmode: 'manual', aspectratio: vector(box), camera: { up: vector([0, 1, 2].map((k) => (k === up ? sign : 0))), eye: vector(eye) } };
  for (const a of AXES) {
    scene[`${a}axis`] = { title: { text: `${a} [${run.unit}]` }, gridcolor: css('--line'), color: css('--ink'),
      backgroundcolor: css('--raised'), showbackground: true, zerolinecolor: css('--line') };
  }
  await chart(panel, 'tall', traces, layoutOf('', { scene, margin: { l: 0, r: 0, t: 10, b: 10 },
    legend: { orientation: 'h', y: 1, yanchor: 'top', x: 0, bgcolor: 'rgba(0,0,0,0)' } }));
  panel.append(note('Drag to turn, wheel or pinch to zoom, right button or two fingers to move. ' + mapNote(run)));
}
