// The live view of a real run in a real browser: pause, step, resume; who may not look; a browser that is gone.
// usage: node live_test.mjs TUTTI CONFIGS [--shots DIR]
import { spawn, spawnSync } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { request } from 'node:http';
import { connect } from 'node:net';
import { setPriority, tmpdir } from 'node:os';
import { join } from 'node:path';
import { check, DESKTOP, launch, openPage, PHONE, SKIP, sleep, within } from './browser.mjs';

const [tutti, configs, , shots] = process.argv.slice(2);

function sequence(folder) {
  const kitchen = join(process.env.TUTTI_DATA ?? '', 'redkitchen');
  if (process.env.TUTTI_DATA && existsSync(kitchen)) return [join(configs, '7scenes.yaml'), kitchen];
  console.log('no TUTTI_DATA/redkitchen: a synthetic room takes its place');
  const room = join(folder, 'room');
  spawnSync(tutti, ['generate', '--out', room, '--sensor', 'rgbd', '--world', 'room', '--laps', '4', '--width', '320', '--height', '240', '--supersample', '1']);
  return [join(room, 'config.yaml'), room];
}

// A run in the background, and the address that it prints.
const start = (folder, name, [config, dataset], more = []) => startCommand(['run', '--config', config, '--dataset', dataset,
  '--out', join(folder, name), '--view-port', '0', '--no-report', ...more]);
async function startCommand(words) {
  const run = spawn(tutti, words);
  setPriority(run.pid, 10);  // the browser comes first: it must see the run while it goes on
  let text = '';
  const ended = new Promise((done) => run.on('close', done));
  const url = await new Promise((found, failed) => {
    run.stderr.on('data', (data) => {
      text += data;
      const line = /look at (http\S+)\n/.exec(text);
      if (line) found(line[1]);
    });
    run.stdout.resume();
    ended.then(() => failed(new Error(text)));
  });
  return { run, url, ended };
}

const status = (url, { method = 'GET', headers = {} } = {}) => new Promise((done) => {
  const asked = request(url, { method, headers }, (answer) => { done(answer.statusCode); answer.destroy(); });
  asked.on('error', () => done(0));
  asked.end();
});

const frame = (page) => page.evaluate(() => Number(document.body.dataset.frame ?? 0));
// Not by frames that are drawn, which a machine without a graphics card and with much to do may not get to in seconds: by
// time, or at once when the page changes. What the page says is told if it does not come to that.
async function waitFor(page, test, argument, polling = 100) {
  try {
    return await page.waitForFunction(test, { timeout: 60000, polling }, argument);
  } catch (error) {
    const { status, ...body } = await page.evaluate(() => ({ ...document.body.dataset, status: document.getElementById('status').textContent }));
    throw new Error(`${error.message}, waiting for ${test} at ${JSON.stringify(body)}: ${status}`);
  }
}
const waitForNews = (page, test) => waitFor(page, test, undefined, 'mutation');
// Presses Pause in the same turn of the page in which test holds: no run is too fast for it.
async function pauseWhen(page, test) {
  await waitForNews(page, `(${test})() && (document.getElementById('pause').click(), true)`);
  await waitForNews(page, stands);
}
// Not paused alone: a frame that was begun is still computed, which may take a second on a machine with much to do.
const stands = () => document.body.dataset.paused === '1' && document.body.dataset.standing === '1';
// Whether a canvas has something on it.
const inked = (id) => {
  const canvas = document.getElementById(id);
  const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  let count = 0;
  for (let i = 3; i < pixels.length; i += 4) if (pixels[i] > 0) ++count;
  return count > 100;
};

// The tracks that the page got, and whether each is drawn on the image: at its newest place the canvas has its colour.
const tracksOnPage = () => {
  const { tracks } = state.news.frame, canvas = document.getElementById('image'), context = canvas.getContext('2d');
  const scale = canvas.width / state.picture.width, steps = [];
  let drawn = 0;
  for (const track of tracks) {
    const [r, g, b] = context.getImageData(Math.round(track[0] * scale), Math.round(track[1] * scale), 1, 1).data;
    if (Math.max(r, g, b) - Math.min(r, g, b) > 60) ++drawn;  // the image is grey
    for (let i = 2; i < track.length; i += 2) steps.push(Math.hypot(track[i] - track[i - 2], track[i + 1] - track[i - 1]));
  }
  steps.sort((a, b) => a - b);
  return { count: tracks.length, drawn, tails: tracks.filter((track) => track.length > 6).length, step: steps[steps.length >> 1] };
};

async function drive(browser, folder, data) {
  const { url, ended, run } = await start(folder, 'drive', data, ['--view', '--view-wait', '60', '--end', '900']);
  check(/^http:\/\/127\.0\.0\.1:\d+\/$/.test(url), `loopback by default, not ${url}`);
  const allow = (target) => target.startsWith(url);
  const { page, problems } = await openPage(browser, url, { allow });
  await pauseWhen(page, () => Number(document.body.dataset.frame) > 30);
  const at = await frame(page);
  await sleep(1500);
  check(await frame(page) === at, 'a run that is paused stands still');
  await page.click('#step');
  await waitFor(page, (before) => Number(document.body.dataset.frame) > before && document.body.dataset.standing === '1', at);
  check(await frame(page) === at + 1, `a step is one frame, not ${await frame(page) - at}`);
  for (const id of ['image', 'map']) check(await page.evaluate(inked, id), `the canvas ${id} is drawn`);
  // State, speed and what is left; the map in 3D and from above.
  check(await page.evaluate(() => document.getElementById('state').dataset.state === 'paused'), 'the state is shown as paused');
  const map = () => page.evaluate(() => document.getElementById('map').toDataURL());
  const mapChanges = (before) => waitFor(page, `document.getElementById('map').toDataURL() !== '${before}'`);
  const above = await map();
  await page.click('#space');
  await mapChanges(above);
  check(await page.evaluate(inked, 'map'), 'the map in 3D is not empty');
  const turned = await map();
  check(await page.evaluate(() => Number(document.body.dataset.surfaces)) > 0, 'keyframes have surfaces');
  await page.click('#surfaces');
  await mapChanges(turned);
  await page.click('#surfaces');
  await page.click('#space');
  await mapChanges(turned);
  check(await page.evaluate(() => document.getElementById('space').textContent === '3D'), 'from above again');
  const { count, drawn, tails, step } = await page.evaluate(tracksOnPage);
  check(count > 50, `features are tracked (${count})`);
  check(drawn > 0.8 * count, `tracks are on the image, but for a few under others (${drawn} of ${count})`);
  check(tails > 0.2 * count, `tracks have tails (${tails} of ${count}; what a keyframe has just made has none yet)`);
  check(step > 0 && step < 30, `tails go from frame to frame, by some pixels (median ${step})`);
  check(await page.evaluate(() => /tracks/.test(document.querySelector('#image + figcaption').textContent)), 'the legend says what tracks are');
  await page.click('#pause');
  await waitFor(page, (before) => Number(document.body.dataset.frame) > before + 20, at);
  await waitFor(page, () => /frame \d+, \d+ of \d+.*[\d.]+ frames\/s, \d+:\d\d left/.test(document.getElementById('status').textContent) &&
    document.getElementById('state').textContent === 'tracking');
  await pauseWhen(page, () => state.answers.length > 5);
  await waitFor(page, inked, 'posterior');
  const phone = await openPage(browser, url, { allow, viewport: PHONE, scheme: 'dark' });
  await waitFor(phone.page, () => Number(document.body.dataset.received) > 0);
  check(await phone.page.evaluate(() => document.documentElement.scrollWidth <= window.innerWidth + 1), 'the page fits a phone');
  const before = await frame(phone.page);
  await phone.page.click('#step');
  await waitFor(phone.page, (last) => Number(document.body.dataset.frame) === last + 1, before);
  if (shots) await phone.page.screenshot({ path: join(shots, 'live-phone.png') });
  await phone.page.close();
  await page.bringToFront();  // a page in the background draws nothing
  if (shots) {
    await page.setViewport(DESKTOP);
    await page.click('#pause');
    await pauseWhen(page, () => state.news.loops.filter((loop) => loop[2]).length > 3);
    await sleep(500);
    await page.screenshot({ path: join(shots, 'live.png') });
  }
  check(await page.evaluate(() => document.getElementById('log').childElementCount > 0), 'decisions are listed');
  for (const problem of new Set([...problems, ...phone.problems])) check(false, problem);
  // Others: another site's name for this machine, its pages, other paths.
  check(await status(url, { headers: { Host: 'evil.example' } }) === 403, 'a foreign Host is refused');
  check(await status(url, { headers: { Host: '127.evil.example' } }) === 403, 'a foreign Host with a number is refused');
  check(await status(`${url}control?do=pause`, { method: 'POST' }) === 403, 'a POST as other sites can send it is refused');
  check(await status(`${url}etc/passwd`) === 404, 'other paths are not served');
  check(await status(`${url}../../../../etc/passwd`) === 404, 'no files are served');
  // A pause whose browser is gone ends by itself.
  check(await page.evaluate(() => document.body.dataset.paused === '1'), 'still paused');
  await page.close();
  const code = await within(240000, ended);
  check(code === 0, `the run ends although its viewer went while it was paused (${code})`);
  run.kill();
}

// How many pixels of the map have this colour (#rrggbb).
const pixelsOf = (color) => {
  const canvas = document.getElementById('map'), wanted = [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16));
  const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  let count = 0;
  for (let i = 0; i < pixels.length; i += 4) if (wanted.every((value, k) => Math.abs(pixels[i + k] - value) < 3)) ++count;
  return count;
};
const finished = () => document.body.dataset.finished === '1';
const legend = (page) => page.evaluate(() => [...document.querySelectorAll('#map-legend span')].map((entry) => entry.textContent));

// Recordings of a map have a colour each, and it is seen where frames were found in it.
async function sessions(browser, folder, [config, dataset]) {
  const first = join(folder, 'first'), second = join(folder, 'second'), map = join(first, 'map.tutti');
  const view = ['--view', '--view-port', '0', '--view-wait', '60'];
  spawnSync(tutti, ['run', '--config', config, '--dataset', dataset, '--out', first, '--end', '120', '--no-report', '--quiet', '--set', 'loops.members=[orb]']);
  const goesOn = await startCommand(['run', '--map', map, '--dataset', dataset, '--out', second, '--start', '280', '--end', '340', '--no-report', ...view]);
  const run = await openPage(browser, goesOn.url, { allow: (target) => target.startsWith(goesOn.url) });
  await run.page.bringToFront();
  await waitForNews(run.page, finished);
  await waitFor(run.page, inked, 'map');
  check((await legend(run.page)).join('; ') === 'session 1; session 2, this run; found in the map (1)', `the sessions have a legend: ${await legend(run.page)}`);
  for (const color of ['#cc79a7', '#0072b2']) {
    const count = await run.page.evaluate(pixelsOf, color);
    check(count > 20, `a session is drawn in ${color} (${count} pixels)`);
  }
  check(await run.page.evaluate(() => /(recognised|joined the recording with the map), beside keyframe \d+/.test(document.getElementById('log').textContent)), 'the log says where it was found');
  if (shots) await run.page.screenshot({ path: join(shots, 'live-sessions.png') });
  check(await within(120000, goesOn.ended) === 0, 'the second session ends');
  await run.page.close();
  const located = await startCommand(['localize', dataset, '--map', join(second, 'map.tutti'), '--out', join(folder, 'located'), '--start', '60', '--end', '130', ...view]);
  const page = await openPage(browser, located.url, { allow: (target) => target.startsWith(located.url) });
  await page.page.bringToFront();  // a page in the background draws nothing
  await waitForNews(page.page, finished);
  await waitFor(page.page, inked, 'map');
  check((await legend(page.page)).slice(0, 3).join('; ') === 'session 1; session 2; localized', `the map's sessions, and what is located: ${await legend(page.page)}`);
  check((await legend(page.page)).some((text) => /^found in the map \([1-9]/.test(text)), 'rings where frames were recognised');
  check(await page.page.evaluate(() => /^done, (\d+) of \1$/.test(document.getElementById('state').textContent)), 'the state is said');
  check(await page.page.evaluate(() => state.spots.length > 50), 'every frame that is located is on the map');
  check(await page.page.evaluate(pixelsOf, '#0072b2') > 20, 'in the colour of the legend');
  check(await page.page.evaluate(() => document.getElementById('posterior-panel').hidden), 'no empty panel of what is not computed');
  if (shots) await page.page.screenshot({ path: join(shots, 'live-localize.png') });
  check(await within(120000, located.ended) === 0, 'localization ends');
  for (const problem of new Set([...run.problems, ...page.problems])) check(false, problem);
}

// A browser that connects and reads nothing must not hold the run up.
async function sleepers(folder, data) {
  const { url, ended, run } = await start(folder, 'sleepers', data, ['--view', '--end', '80']);
  const { hostname, port } = new URL(url);
  const sockets = [0, 1, 2].map(() => {
    const socket = connect(Number(port), hostname);
    socket.on('error', () => {});
    socket.write(`GET /events HTTP/1.1\r\nHost: ${hostname}\r\n\r\n`);
    socket.pause();
    return socket;
  });
  const code = await within(120000, ended);
  check(code === 0, `a run with viewers that read nothing ends (${code})`);
  for (const socket of sockets) socket.destroy();
  run.kill();
  const alone = spawnSync(tutti, ['run', '--config', data[0], '--dataset', data[1], '--out', join(folder, 'alone'), '--no-report',
    '--end', '80', '--quiet']);
  check(alone.status === 0, 'a run without the view');
  check(readFileSync(join(folder, 'alone', 'trajectory.txt'), 'utf8') === readFileSync(join(folder, 'sleepers', 'trajectory.txt'), 'utf8'),
    'looking changes nothing: the same trajectory, byte for byte');
}

async function strangers(folder, data) {
  const { url, run, ended } = await start(folder, 'token', data, ['--view-address', '0.0.0.0']);
  const token = new URL(url).searchParams.get('token');
  check(/^[0-9a-f]{32}$/.test(token ?? ''), `a token of 128 bits: ${url}`);
  const here = url.replace('0.0.0.0', '127.0.0.1');
  check(await status(here) === 200, 'with the token');
  check(await status(here.replace(/token=.*/, '')) === 403, 'without a token');
  check(await status(here.replace(/token=./, 'token=x')) === 403, 'with a wrong token');
  check(await status(here.replace('/?', '/events?').replace(/token=./, 'token=x')) === 403, 'the data with a wrong token');
  run.kill('SIGINT');
  await ended;
}

const help = spawnSync(tutti, ['run', '--config', join(configs, '7scenes.yaml'), '--dataset', '/nowhere', '--out', '/tmp/nowhere', '--view',
  '--view-port', '0'], { encoding: 'utf8' });
if (/without cpp-httplib/.test(help.stderr)) {
  console.log('skipped: this tutti was built without cpp-httplib (libcpp-httplib-dev)');
  process.exit(SKIP);
}
const browser = await launch();
const folder = mkdtempSync(join(tmpdir(), 'tutti-live-'));
try {
  const data = sequence(folder);
  await drive(browser, folder, data);
  await sleepers(folder, data);
  await strangers(folder, data);
  await sessions(browser, folder, data);
} finally {
  await browser.close();
  rmSync(folder, { recursive: true, force: true });
}
