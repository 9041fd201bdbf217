'use strict';
// The live view: newest state over server-sent events, drawn on canvases.

const COLORS = { surf: '#e69f00', sift: '#56b4e9', orb: '#cc79a7', ensemble: '#0072b2', accepted: '#009e73', waiting: '#e69f00', path: '#0072b2', beyond: '#e69f00', here: '#d55e00', old: '#56b4e9', young: '#f0e442' };
const SESSIONS = ['#cc79a7', '#56b4e9', '#8f7d2f', '#999999', '#7a5195', '#5a9a8f'];  // recordings that the map held before; then again
const DASHES = { surf: [8, 3, 2, 3], sift: [10, 5], orb: [2, 3], ensemble: [] };
const MOST_ANSWERS = 1500, MOST_LINES = 300, MOST_SPOTS = 5000, MOST_FITTED = 2000;
const TRACK_OLD = 5;  // frames before this one that show it (of the last 10)
const WIDE = 2;  // times as wide as high: an image gets a row of its own
const TURN = 0.008;  // of the map in 3D [rad per pixel]
const SPEED_S = 5;  // that frames a second are counted over
const by = (id) => document.getElementById(id);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const token = new URLSearchParams(location.search).get('token');
const address = (path, query = {}) => `${path}?${new URLSearchParams(token ? { ...query, token } : query)}`;

const state = { news: null, picture: null, answers: [], spots: [], points: new Map(), surfaces: new Map(), showSurfaces: true, view: null, turn: null, received: 0, speed: [] };

function sharp(canvas, ratio) {
  const width = Math.round(canvas.clientWidth * devicePixelRatio), height = Math.round(width * ratio);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  const context = canvas.getContext('2d');
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, width, height);
  return context;
}

function drawImage() {
  const picture = state.picture;
  if (!picture) return;
  by('image-panel').classList.toggle('wide', picture.width > WIDE * picture.height);
  const canvas = by('image'), context = sharp(canvas, picture.height / picture.width);
  context.scale(canvas.width / picture.width, canvas.width / picture.width);
  context.drawImage(picture, 0, 0);
  drawTracks(context, state.news.frame.tracks ?? []);
}

// Tails of the places in the last frames, and above them a disc (followed for long) or a square (new) where each is now. The
// dark edge keeps the light colours legible on a white wall.
function drawTracks(context, tracks) {
  const edge = 'rgba(0, 0, 0, 0.75)';
  const old = (track) => track.length / 2 > TRACK_OLD, colorOf = (track) => (old(track) ? COLORS.old : COLORS.young);
  const stroke = (path, width, style) => { context.lineWidth = width; context.strokeStyle = style; context.stroke(path); };
  context.lineJoin = 'round';
  for (const track of tracks) {
    const tail = new Path2D();
    for (let i = 0; i < track.length; i += 2) tail.lineTo(track[i], track[i + 1]);
    stroke(tail, 3, edge);
    stroke(tail, 1.4, colorOf(track));
  }
  for (const track of tracks) {
    const head = new Path2D(), [x, y] = track;
    if (old(track)) head.arc(x, y, 2.2, 0, 7); else head.rect(x - 2, y - 2, 4, 4);
    stroke(head, 2, edge);
    context.fillStyle = colorOf(track);
    context.fill(head);
  }
}

// Rotates by a unit quaternion (x, y, z, w) and moves.
function transform([tx, ty, tz, x, y, z, w], [a, b, c]) {
  const u = 2 * (y * c - z * b), v = 2 * (z * a - x * c), t = 2 * (x * b - y * a);
  return [a + w * u + y * t - z * v + tx, b + w * v + z * u - x * t + ty, c + w * t + x * v - y * u + tz];
}

// To the right and up on the screen, in metres, of a place: from above, x to the right and z ahead (cameras have y down);
// turned by `turn` = { yaw, pitch } [rad], a pitch of pi/2 looking straight down.
function onScreen([x, y, z], turn) {
  if (!turn) return [x, z];
  const ahead = Math.cos(turn.yaw) * z - Math.sin(turn.yaw) * x;
  return [Math.cos(turn.yaw) * x + Math.sin(turn.yaw) * z, Math.sin(turn.pitch) * ahead - Math.cos(turn.pitch) * y];
}

// How far away from a viewer who looks at the turned map, in metres.
const away = ([x, y, z], turn) => Math.cos(turn.pitch) * (Math.cos(turn.yaw) * z - Math.sin(turn.yaw) * x) + Math.sin(turn.pitch) * y;

// Depth images of keyframes, thinned, where the keyframes are now; the nearest point of each pixel is seen.
function drawSurfaces(context, canvas, at, poses) {
  const { width, height } = canvas, picture = context.createImageData(width, height), pixels = new Uint32Array(picture.data.buffer);
  const nearest = new Float32Array(width * height).fill(Infinity), side = Math.max(2, Math.round(1.5 * devicePixelRatio));
  for (const [id, { places, greys }] of state.surfaces) {
    if (!poses.has(id)) continue;
    for (let i = 0; i < greys.length; ++i) {
      const p = transform(poses.get(id), places.subarray(3 * i, 3 * i + 3)), [u, v] = at(p).map(Math.round), far = away(p, state.turn);
      if (!(u >= 0 && v >= 0 && u + side < width && v + side < height)) continue;
      for (let k = 0; k < side * side; ++k) {
        const pixel = u + k % side + width * (v + Math.floor(k / side));
        if (far >= nearest[pixel]) continue;
        nearest[pixel] = far;
        pixels[pixel] = 0xff000000 | greys[i] * 0x010101;
      }
    }
  }
  const layer = new OffscreenCanvas(width, height);
  layer.getContext('2d').putImageData(picture, 0, 0);
  context.drawImage(layer, 0, 0);
}

function unpack(text) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0)), count = bytes.length / 13;  // 3 floats and a grey each
  return { places: new Float32Array(bytes.buffer, 0, 3 * count), greys: bytes.subarray(12 * count) };
}

// Where most landmarks are seen: the middle 90 % of them along either axis, of a sample.
function landmarkBox(places) {
  const poses = places.filter(([id]) => state.points.has(id)), xs = [], ys = [];
  const all = poses.reduce((sum, [id]) => sum + state.points.get(id).length, 0), step = Math.max(1, Math.ceil(all / MOST_FITTED));
  let k = 0;
  for (const [id, , , pose] of poses) {
    for (const point of state.points.get(id)) {
      if (k++ % step) continue;
      const [x, y] = onScreen(transform(pose, point), state.turn);
      xs.push(x); ys.push(y);
    }
  }
  const ends = (values) => { values.sort((a, b) => a - b); return [values[Math.floor(0.05 * values.length)], values[Math.ceil(0.95 * values.length) - 1]]; };
  return xs.length ? [ends(xs), ends(ys)] : null;
}

function fit(canvas, places) {
  const seen = places.map(([, , , p]) => onScreen(p, state.turn)), box = landmarkBox(places);
  if (!seen.length) return { x: 0, y: 0, scale: 50 };
  const [[left, right], [low, high]] = [0, 1].map((k) => {
    const values = [...seen.map((p) => p[k]), ...(box ? box[k] : [])];
    return [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];
  });
  const scale = 0.85 * Math.min(canvas.width / Math.max(right - left, 1e-3), canvas.height / Math.max(high - low, 1e-3), canvas.width / 0.5);
  return { x: (left + right) / 2, y: (low + high) / 2, scale };
}

// The newest recording is the run's own, unless its frames are only located.
const ownSession = () => (state.news.only_located ? state.news.sessions : state.news.sessions - 1);
const sessionColor = (session) => (session === ownSession() ? COLORS.path : SESSIONS[session % SESSIONS.length]);
const ringed = (kind) => kind === 'recognised' || kind === 'joined';

// Frames that are only located, each a dot; a ring where one was found again.
function drawSpots(context, at) {
  const size = 2 * devicePixelRatio;
  for (const [kind, , keyframe, position] of state.spots) {
    const place = at(keyframe, position);
    if (!place) continue;
    const [x, y] = place;
    if (ringed(kind)) {
      context.strokeStyle = css('--ink');
      context.beginPath();
      context.arc(x, y, 4 * size, 0, 7);
      context.stroke();
    }
    if (!state.news.only_located) continue;
    context.fillStyle = kind === 'beyond' ? COLORS.beyond : COLORS.path;
    context.fillRect(x - size / 2, y - size / 2, size, size);
  }
}

// What the lines and marks of the map mean, once there is more than one kind.
function showLegend() {
  const { sessions, only_located: located } = state.news, entries = [];
  const entry = (kind, color, words) => {
    const mark = Object.assign(document.createElement('i'), { className: kind });
    if (kind === 'dot') mark.style.background = color; else if (color) mark.style.borderColor = color;
    const line = document.createElement('span');
    line.append(mark, words);
    entries.push(line);
  };
  for (let session = 0; session < sessions; ++session) {
    if (session !== ownSession()) entry('line', sessionColor(session), located && sessions === 1 ? 'map' : `session ${session + 1}`);
  }
  if (located) entry('dot', COLORS.path, 'localized');
  else if (sessions > 1) entry('line', COLORS.path, `session ${sessions}, this run`);
  if (state.spots.some(([kind]) => kind === 'beyond')) entry('dot', COLORS.beyond, 'beyond the map');
  const found = state.spots.filter(([kind]) => ringed(kind)).length;
  if (found) entry('ring', '', `found in the map (${found})`);
  by('map-legend').replaceChildren(...entries);
  by('posterior-panel').hidden = located;  // no loops are searched for
  by('log').parentElement.classList.toggle('wide', located);
}

function drawMap() {
  const canvas = by('map'), context = sharp(canvas, 0.75), places = state.news.places;
  const view = state.view ?? fit(canvas, places);
  const at = (p) => {
    const [x, y] = onScreen(p, state.turn);
    return [canvas.width / 2 + view.scale * (x - view.x), canvas.height / 2 - view.scale * (y - view.y)];
  };
  const poses = new Map(places.map(([id, , , pose]) => [id, pose])), frames = new Map(places.map(([, frame, , pose]) => [frame, pose]));
  context.fillStyle = css('--faint');
  context.globalAlpha = 0.5;
  for (const [id, points] of state.points) {
    if (!poses.has(id)) continue;
    for (const point of points) {
      const [x, y] = at(transform(poses.get(id), point));
      context.fillRect(x, y, 1.5, 1.5);
    }
  }
  context.globalAlpha = 1;
  if (state.turn && state.showSurfaces && state.surfaces.size) drawSurfaces(context, canvas, at, poses);
  context.lineWidth = 2 * devicePixelRatio;
  for (let session = 0; session < state.news.sessions; ++session) {  // this run's above those of before
    context.strokeStyle = sessionColor(session);
    context.beginPath();
    let piece = null;
    for (const [, , now, pose, of] of places) {
      const [x, y] = at(pose);
      const here = of === session ? now : null;
      if (here !== null && here === piece) context.lineTo(x, y); else context.moveTo(x, y);
      piece = here;
    }
    context.stroke();
  }
  for (const [query, candidate, accepted] of state.news.loops) {
    const a = frames.get(query), b = frames.get(candidate);
    if (!a || !b) continue;
    context.strokeStyle = accepted ? COLORS.accepted : COLORS.waiting;
    context.setLineDash(accepted ? [] : [6, 5]);
    context.beginPath();
    context.moveTo(...at(a));
    context.lineTo(...at(b));
    context.stroke();
  }
  context.setLineDash([]);
  drawSpots(context, (keyframe, p) => (keyframe < 0 ? at(p) : poses.has(keyframe) ? at(transform(poses.get(keyframe), p)) : null));
  const here = state.news.frame.position;
  if (!here) return;
  const [x, y] = at(here);
  context.fillStyle = COLORS.here;
  context.beginPath();
  context.arc(x, y, 5 * devicePixelRatio, 0, 7);
  context.fill();
}

function drawPosterior() {
  const canvas = by('posterior'), context = sharp(canvas, 0.42), answers = state.answers;
  const size = 11 * devicePixelRatio, left = 4 * size, bottom = canvas.height - 2 * size, top = 2.2 * size;
  const names = [...new Set(answers.flatMap((answer) => Object.keys(answer.h)))];
  const most = Math.max(0.1, ...answers.flatMap((answer) => Object.values(answer.h).filter((h) => h !== null)));
  context.font = `${size}px system-ui, sans-serif`;
  context.lineWidth = 1;
  for (const share of [0, 0.5, 1]) {
    const y = bottom - share * (bottom - top);
    context.strokeStyle = css('--line');
    context.beginPath();
    context.moveTo(left, y);
    context.lineTo(canvas.width, y);
    context.stroke();
    context.fillStyle = css('--faint');
    context.fillText((share * most).toFixed(2), 4, y + size / 3);
  }
  if (answers.length < 2) return;
  const first = answers[0].query, last = answers.at(-1).query;
  context.fillText(`frame ${first}`, left, canvas.height - size / 2);
  context.fillText(`${last}`, canvas.width - 3 * size, canvas.height - size / 2);
  let legend = left;
  for (const name of names) {
    context.strokeStyle = context.fillStyle = COLORS[name] ?? css('--ink');
    context.lineWidth = (name === 'ensemble' ? 2.5 : 1.5) * devicePixelRatio;
    context.setLineDash(DASHES[name] ?? [4, 4]);
    context.beginPath();
    let open = false;
    for (const { query, h } of answers) {
      if (h[name] === null || h[name] === undefined) { open = false; continue; }
      const x = left + (canvas.width - left) * (query - first) / Math.max(1, last - first), y = bottom - (bottom - top) * h[name] / most;
      if (open) context.lineTo(x, y); else context.moveTo(x, y);
      open = true;
    }
    context.moveTo(legend, size);
    context.lineTo(legend + 2 * size, size);
    context.stroke();
    context.setLineDash([]);
    context.fillText(name, legend + 2.4 * size, 1.3 * size);
    legend += context.measureText(name).width + 4 * size;
  }
}

function addLines(events) {
  const log = by('log');
  for (const event of events) if (event.text) log.append(Object.assign(document.createElement('div'), { textContent: event.text }));
  while (log.childElementCount > MOST_LINES) log.firstElementChild.remove();
  log.scrollTop = log.scrollHeight;
}

// Frames a second over the last seconds that the run was not paused, and the time that is left [s]; null: not known yet.
function speed() {
  const { frame, total, paused, finished } = state.news, now = performance.now() / 1000, seen = state.speed;
  if (paused || finished) seen.length = 0;
  seen.push([now, frame.number]);
  while (seen.length > 2 && now - seen[0][0] > SPEED_S) seen.shift();
  const [[since, first]] = seen;
  if (now - since < 0.5 || frame.number === first) return { rate: null, left: null };
  const rate = (frame.number - first) / (now - since);
  return { rate, left: total > frame.number ? (total - frame.number) / rate : null };
}

const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(Math.round(seconds) % 60).padStart(2, '0')}`;

function showStatus() {
  const { frame, total, paused, standing, finished } = state.news, { rate, left } = speed();
  by('state').dataset.state = paused ? 'paused' : frame.state;
  by('state').textContent = finished ? `done, ${total ? `${frame.number} of ${total}` : `${frame.number} frames`}` : paused ? `${standing ? 'paused' : 'pausing'}, ${frame.state}` : frame.state;
  by('pause').textContent = paused ? 'Resume' : 'Pause';
  by('pause').disabled = finished;
  by('step').disabled = !paused || finished;
  const accepted = state.news.loops.filter((loop) => loop[2]).length;
  // Numbers of frames start at --start, in a map of several recordings far above.
  const count = finished ? `, ${frame.state}` : total ? `, ${frame.number} of ${total}` : '';
  by('status').textContent = `frame ${frame.index}${count}${frame.reason ? ` (${frame.reason})` : ''}, ` +
    `${rate ? `${rate.toFixed(1)} frames/s, ` : ''}${left !== null && !paused ? `${clock(left)} left, ` : ''}${frame.features} features, ${frame.inliers} inliers, ` +
    `${state.news.places.length} keyframes${state.news.only_located ? ' in the map' : `, ${accepted} loops`}`;
  document.body.dataset.frame = frame.number;
  document.body.dataset.paused = paused ? '1' : '0';
  document.body.dataset.standing = standing ? '1' : '0';
  document.body.dataset.finished = finished ? '1' : '0';
}

let drawing = false;
function draw() {
  if (drawing || !state.news) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    drawImage();
    drawMap();
    drawPosterior();
  });
}

function take(news) {
  state.news = news;
  for (const [id, points, surface] of news.points) {
    state.points.set(id, points);
    if (surface) state.surfaces.set(id, unpack(surface));
  }
  document.body.dataset.surfaces = state.surfaces.size;
  state.spots.push(...news.spots);
  state.spots.splice(0, state.spots.length - MOST_SPOTS);
  for (const event of news.events) if ('query' in event) state.answers.push(event);
  state.answers.splice(0, state.answers.length - MOST_ANSWERS);
  addLines(news.events);
  by('surfaces').hidden = !state.turn || !state.surfaces.size;
  showLegend();
  showStatus();
  document.body.dataset.received = ++state.received;
  if (news.frame.image) {
    const picture = new Image();
    picture.onload = () => { state.picture = picture; draw(); };
    picture.src = news.frame.image;
  }
  draw();
}

async function command(what) {
  const answer = await fetch(address('control', { do: what }), { method: 'POST', headers: { 'X-Tutti': '1' } });
  if (!answer.ok) by('status').textContent = `refused: ${await answer.text()}`;
}

function moveMap() {
  const canvas = by('map'), fingers = new Map();
  const hold = () => { state.view ??= fit(canvas, state.news?.places ?? []); };
  const zoom = (factor) => { hold(); state.view.scale *= factor; draw(); };
  canvas.addEventListener('wheel', (event) => { event.preventDefault(); zoom(Math.exp(-event.deltaY / 400)); }, { passive: false });
  canvas.addEventListener('dblclick', () => { state.view = null; draw(); });
  canvas.addEventListener('pointerdown', (event) => { canvas.setPointerCapture(event.pointerId); fingers.set(event.pointerId, event); });
  for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
  canvas.addEventListener('pointermove', (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    hold();
    const others = [...fingers.values()].filter((f) => f.pointerId !== event.pointerId);
    if (others.length) {
      const apart = (f) => Math.hypot(f.clientX - others[0].clientX, f.clientY - others[0].clientY);
      zoom(apart(event) / Math.max(1, apart(before)));
    } else if (state.turn && !event.shiftKey) {
      state.turn.yaw += (event.clientX - before.clientX) * TURN;
      state.turn.pitch = Math.min(Math.PI / 2, Math.max(0, state.turn.pitch + (event.clientY - before.clientY) * TURN));
    } else {
      state.view.x -= (event.clientX - before.clientX) * devicePixelRatio / state.view.scale;
      state.view.y += (event.clientY - before.clientY) * devicePixelRatio / state.view.scale;
    }
    fingers.set(event.pointerId, event);
    draw();
  });
}

function turnMap(on) {
  state.turn = on ? { yaw: 0.6, pitch: 0.6 } : null;
  state.view = null;
  by('space').setAttribute('aria-pressed', String(on));
  by('space').textContent = on ? 'From above' : '3D';
  by('surfaces').hidden = !on || !state.surfaces.size;
  by('map-words').textContent = on ? 'Map in 3D. Drag turns, with Shift it moves.' : 'Map, top view. Drag moves.';
  draw();
}

function showSurfaces(on) {
  state.showSurfaces = on;
  by('surfaces').setAttribute('aria-pressed', String(on));
  draw();
}

by('surfaces').addEventListener('click', () => showSurfaces(!state.showSurfaces));
by('space').addEventListener('click', () => turnMap(!state.turn));
by('pause').addEventListener('click', () => command(state.news?.paused ? 'resume' : 'pause'));
by('step').addEventListener('click', () => command('step'));
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
window.addEventListener('resize', draw);
moveMap();
turnMap(false);
const source = new EventSource(address('events'));
source.onmessage = (message) => {
  const news = JSON.parse(message.data);
  take(news);
  if (news.finished) source.close();
};
source.onerror = () => { if (!state.news?.finished) by('status').textContent = 'the run has ended, or can\'t be reached'; source.close(); };
