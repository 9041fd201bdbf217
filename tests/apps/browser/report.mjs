// Opens a report in Chromium, clicks every tab and choice, and looks whether each chart has drawn.
import { mkdirSync } from 'node:fs';
import { basename, dirname, join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { check, DESKTOP, openPage, PHONE, sleep } from './browser.mjs';

const LOOKS = [['light', DESKTOP, 'light'], ['dark', DESKTOP, 'dark'], ['phone', PHONE, 'light']];

async function openTab(page, id) {
  await page.evaluate((tab) => document.getElementById(`tab-${tab}`).click(), id);
  await page.waitForFunction((tab) => document.getElementById(tab).dataset.state === 'drawn', { timeout: 120000 }, id);
}

// What stands in a tab: its charts (drawn, and with marks in them), its pictures, its width.
const lookAt = (page, id) => page.evaluate((tab) => {
  const panel = document.getElementById(tab);
  const charts = [...panel.querySelectorAll('.chart')].map((div) => ({
    drawn: div.dataset.drawn,
    marks: div.querySelectorAll('.trace, .hm image, .gl-container canvas, .bars path').length,
    width: div.getBoundingClientRect().width,
  }));
  const images = [...panel.querySelectorAll('img')].map((img) => img.src.startsWith('data:image/jpeg'));
  return { charts, images, text: panel.innerText.length, tables: [...panel.querySelectorAll('table')].map((t) => t.textContent).join(' '), overflow: document.documentElement.scrollWidth - window.innerWidth };
}, id);

// The 3D chart is pixels: it has drawn if they are not all of one colour.
const colours3d = (page) => page.evaluate(() => {
  const source = document.querySelector('#space .gl-container canvas');
  if (!source) return 0;
  const plot = document.querySelector('#space .js-plotly-plot')._fullLayout.scene._scene.glplot;
  plot.redraw();
  const copy = document.createElement('canvas');
  copy.width = source.width;
  copy.height = source.height;
  const context = copy.getContext('2d');
  context.drawImage(source, 0, 0);
  return new Set(new Uint32Array(context.getImageData(0, 0, copy.width, copy.height).data.buffer)).size;
});

// The posterior tab shows one image at a time: the slider, a button and a click into a chart choose it.
async function chooseImages(page, where) {
  const shown = () => page.evaluate(() => ({
    name: document.getElementById('image-name').textContent,
    words: document.getElementById('image-words').textContent,
    proposed: /accepted|rejected/.test(document.querySelector('#image-words .verdict b').textContent),
  }));
  const start = await shown();
  for (const word of ['p(new place)', 'weight', 'ln L there', 'ensemble']) check(start.words.includes(word), `${where}: no '${word}' for the image`);
  await page.evaluate(() => {
    const slider = document.getElementById('image');
    slider.value = slider.value === '0' ? '1' : '0';
    slider.dispatchEvent(new Event('input'));
  });
  const moved = await shown();
  check(moved.name !== start.name && moved.words !== start.words, `${where}: the slider chooses no other image`);
  await page.evaluate(() => document.querySelectorAll('.chooser button')[1].click());
  if (start.proposed) check((await shown()).proposed, `${where}: the button does not go to a proposed image`);
  await page.evaluate(() => document.querySelector('#posterior .chart').emit('plotly_click', { points: [{ x: 0 }] }));
  check(/, 0\.0 s/.test((await shown()).name), `${where}: a click into a chart does not choose its image`);
}

// A picture of the gallery opens large, goes on by the arrow keys, and closes.
async function enlarge(page, where) {
  const large = () => page.evaluate(() => {
    const dialog = document.querySelector('dialog.large[open]');
    return dialog && { src: dialog.querySelector('img').src, width: dialog.getBoundingClientRect().width / window.innerWidth };
  });
  await page.evaluate(() => document.querySelector('#gallery figure button').click());
  const opened = await large();
  check(opened?.width > 0.7, `${where}: a picture does not open large (${opened?.width})`);
  await page.keyboard.press('ArrowRight');
  const pictures = await page.evaluate(() => document.querySelectorAll('#gallery figure').length);
  check(pictures < 2 || (await large()).src !== opened.src, `${where}: the arrow key shows no other picture`);
  await page.keyboard.press('Escape');
  check(await large() === null, `${where}: the picture does not close`);
}

// The ensemble's heat map comes first and is the largest.
const beliefMaps = (page) => page.evaluate(() => {
  const area = (div) => { const box = div.getBoundingClientRect(); return box.width * box.height; };
  return { first: area(document.querySelector('#ensemble-map .chart')), rest: [...document.querySelectorAll('#belief-maps .chart')].map(area) };
});

async function lookOnce(browser, file, [look, viewport, scheme], expected, words, shots) {
  const { page, problems } = await openPage(browser, pathToFileURL(resolve(file)).href, { viewport, scheme });
  await page.waitForFunction(() => document.documentElement.dataset.ready === '1', { timeout: 120000 });
  const [tabs, hidden] = await page.evaluate(() => [false, true].map((hidden) =>
    [...document.querySelectorAll('[role=tab]')].filter((tab) => tab.hidden === hidden).map((tab) => tab.id.slice(4))));
  check(tabs.length + hidden.length === 10, `${file}: 10 tabs, not ${tabs.length} and ${hidden.length} without anything to show`);
  for (const tab of expected) check(tabs.includes(tab), `${file}: no tab ${tab}`);
  for (const tab of tabs) {
    await openTab(page, tab);
    const found = await lookAt(page, tab);
    const where = `${basename(dirname(file))}, ${look}, ${tab}`;
    check(found.text > 0, `${where}: is empty`);
    check(found.overflow <= 1, `${where}: ${found.overflow} px wider than the window`);
    for (const chart of found.charts) {
      check(chart.drawn === '1' && chart.marks > 0, `${where}: a chart has not drawn (${JSON.stringify(chart)})`);
      check(chart.width > 200, `${where}: a chart of ${chart.width} px`);
    }
    check(found.images.every((good) => good), `${where}: a picture is missing`);
    if (words[tab]) check(found.tables.includes(words[tab]), `${where}: no table with ${words[tab]}`);
    // Nothing is empty, and the overview says what is left out.
    if (tab !== 'configuration' && tab !== 'overview') check(found.charts.length + found.images.length > 0, `${where}: nothing drawn`);
    if (tab === 'overview') {
      check(found.charts.length === (tabs.includes('map') ? 1 : 0), `${where}: no map`);
      if (hidden.length) check(/\bNo (map|errors|precision|posterior|gallery|IMU)/.test(await page.evaluate(() => document.getElementById('overview').innerText)), `${where}: does not say why there is no ${hidden}`);
    }
    if (tab === 'posterior' && look !== 'phone') {
      const { first, rest } = await beliefMaps(page);
      check(rest.every((area) => area < first), `${where}: the ensemble's map is not the largest`);
    }
    if (tab === 'gallery' && !shots) await enlarge(page, where);
    if (tab === 'space' && found.charts.length) check(await colours3d(page) > 3, `${where}: the 3D view is blank`);
    const chooser = tab === 'posterior' && await page.$('#image');
    if (chooser && !shots) await chooseImages(page, where);
    if (shots) {
      await sleep(300);
      mkdirSync(shots, { recursive: true });
      await page.screenshot({ path: join(shots, `${look}-${tab}.png`) });
    }
  }
  for (const select of await page.$$('#choices select')) {
    const values = await select.evaluate((node) => [...node.options].map((o) => o.value));
    await page.evaluate((id) => document.getElementById(`tab-${id}`).click(), 'map');
    for (const value of values) {
      await select.select(value);
      await page.waitForFunction(() => document.getElementById('map').dataset.state === 'drawn', { timeout: 60000 });
    }
  }
  check(await page.evaluate(() => window.hacked === undefined), `${file}: a text of the report was run as a script`);
  for (const problem of new Set(problems)) check(false, `${file}, ${look}: ${problem}`);
  await page.close();
  console.log(`${look}: ${tabs.length} tabs of ${file}`);
}

// Light, dark and on a phone, or in some of these looks. `expected`: tabs that must hold a chart or a picture; `words`: by
// tab, what a table there must hold; `shots`: folder for a PNG of every tab, or nothing.
export async function lookThrough(browser, file, { expected = [], words = {}, shots, looks = LOOKS.map(([name]) => name) } = {}) {
  for (const look of LOOKS.filter(([name]) => looks.includes(name))) await lookOnce(browser, file, look, expected, words, shots);
}
