'use strict';
// Helpers: elements, colours, the chart library. Texts of files enter the page as text nodes, or through label().

const data = JSON.parse(document.getElementById('data').textContent);
const state = { dataset: '', variant: '', tab: '' };

function el(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  for (const child of children.flat()) if (child !== null) node.append(child);
  return node;
}

// A text for Plotly, which reads a few HTML tags in labels.
const label = (text) => String(text).replace(/&/g, '&amp;').replace(/</g, '&lt;').replace(/>/g, '&gt;');

const isNumber = (value) => typeof value === 'number' && Number.isFinite(value);
const fixed = (value, decimals) => (isNumber(value) ? value.toFixed(decimals) : '-');
const lengthText = (value, unit = 'm') => (isNumber(value) ? `${value.toFixed(value < 1 ? 4 : 2)} ${unit}` : '-');

// Okabe and Ito's palette; each line has a dash and each outcome a shape of its own as well.
const LINES = {
  reference: { color: 'ink', dash: 'dot' },
  odometry: { color: '#d55e00', dash: 'dash' },
  ensemble: { color: '#0072b2', dash: 'solid' },
  verified: { color: '#009e73', dash: 'solid' },
  surf: { color: '#e69f00', dash: 'dashdot' },
  sift: { color: '#56b4e9', dash: 'longdash' },
  orb: { color: '#cc79a7', dash: 'dot' },
  naive: { color: '#009e73', dash: 'dash' },
  product: { color: '#cc79a7', dash: 'dash' },
  majority: { color: '#e69f00', dash: 'dot' },
  mean: { color: '#7a5195', dash: 'dash' },
  'log-pool': { color: '#8f7d2f', dash: 'longdash' },
  'standardised-mean': { color: '#7a5195', dash: 'dashdot' },
};
const SPARE = ['#56b4e9', '#009e73', '#e69f00', '#cc79a7', '#0072b2', '#d55e00'];
const SESSIONS = ['#cc79a7', '#56b4e9', '#8f7d2f', '#999999', '#7a5195', '#5a9a8f'];  // recordings that the map held before; then again
const OUTCOMES = {
  accepted: { color: '#009e73', dash: 'solid', symbol: 'circle', sign: '\u25cf', name: 'accepted' },
  false: { color: '#d55e00', dash: 'dash', symbol: 'x', sign: '\u2715', name: 'accepted, but false' },
  rejected: { color: '#e69f00', dash: 'dot', symbol: 'diamond', sign: '\u25c6', name: 'rejected' },
  missed: { color: '#cc79a7', dash: 'dashdot', symbol: 'square', sign: '\u25a0', name: 'missed' },
};

function lineOf(name, width = 2) {
  const known = LINES[name];
  if (known) return { color: known.color === 'ink' ? css('--ink') : known.color, dash: known.dash, width };
  const session = /^session (\d+)$/.exec(name);
  if (session) return { color: SESSIONS[(session[1] - 1) % SESSIONS.length], dash: 'dash', width };
  let sum = 0;
  for (const letter of String(name)) sum += letter.codePointAt(0);
  return { color: SPARE[sum % SPARE.length], dash: sum % 2 ? 'dash' : 'solid', width };
}

// Lines that are the same become one, with all their names.
function merged(lines, dataOf) {
  const groups = new Map();
  for (const line of lines) {
    const key = JSON.stringify(dataOf(line));
    if (groups.has(key)) groups.get(key).names.push(line.name); else groups.set(key, { ...line, names: [line.name] });
  }
  return [...groups.values()];
}

// Lines that cover one another are told apart: dashed ones lie on solid ones, and those below are wider.
function toldApart(traces) {
  const dashed = (trace) => Number((trace.line?.dash ?? 'solid') !== 'solid');
  const lines = traces.filter((trace) => trace.mode === 'lines').sort((a, b) => dashed(a) - dashed(b));
  lines.forEach((trace, k) => { trace.line = { ...trace.line, width: trace.line.width + Math.min(6, 1.6 * (lines.length - 1 - k)) }; });
  return [...lines, ...traces.filter((trace) => trace.mode !== 'lines')];
}

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// The library is packed; browsers unpack gzip since 2023.
async function loadCharts() {
  const packed = document.getElementById('library').textContent;
  const bytes = Uint8Array.from(atob(packed), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  const script = document.createElement('script');
  script.textContent = await new Response(stream).text();
  document.head.append(script);
  if (!window.Plotly) throw new Error('the chart library did not start');
}

function axis(title, more = {}) {
  return {
    title: { text: title, standoff: 8 },
    gridcolor: css('--line'),
    zerolinecolor: css('--line'),
    linecolor: css('--line'),
    automargin: true,
    ...more,
  };
}

const narrow = () => window.innerWidth < 560;

function layoutOf(title, more = {}) {
  return {
    title: { text: label(title), font: { size: 15 }, x: 0.01, xanchor: 'left' },
    paper_bgcolor: 'rgba(0,0,0,0)',
    plot_bgcolor: 'rgba(0,0,0,0)',
    font: { color: css('--ink'), family: 'system-ui, sans-serif', size: narrow() ? 11 : 12 },
    margin: { l: narrow() ? 44 : 60, r: 14, t: 40, b: 46 },
    legend: { orientation: 'h', y: -0.18, yanchor: 'top', x: 0, bgcolor: 'rgba(0,0,0,0)' },
    modebar: { bgcolor: 'rgba(0,0,0,0)', color: css('--faint'), activecolor: css('--accent') },
    hoverlabel: { bgcolor: css('--raised'), bordercolor: css('--line'), font: { color: css('--ink') } },
    ...more,
  };
}

// Draws into a new element of `parent`; data-drawn says when it is there.
async function chart(parent, size, traces, layout) {
  const div = el('div', { class: `chart ${size}` });
  parent.append(div);
  const buttons = layout.scene ? ['toImage', 'orbitRotation', 'pan3d', 'resetCameraDefault3d']
    : ['toImage', 'zoom2d', 'pan2d', 'resetScale2d'];
  const config = { responsive: true, displaylogo: false, scrollZoom: true, displayModeBar: narrow() ? false : 'hover',
    modeBarButtons: [buttons] };
  try {
    await Plotly.newPlot(div, traces, layout, config);
    div.dataset.drawn = '1';
  } catch (error) {
    div.dataset.drawn = 'failed';
    div.replaceChildren(note(`This chart can't be drawn: ${error.message}`));
  }
}

const note = (text) => el('p', { class: 'note' }, text);

function table(header, rows, textColumns = []) {
  // A mean with its interval below, so that a table of many fits the page.
  const parts = (text) => { const [mean, interval] = text.split(' +- '); return interval ? [mean, el('small', {}, `\u00b1 ${interval}`)] : [text]; };
  const cell = (tag, text, column) => el(tag, textColumns.includes(column) ? { class: 'text' } : {}, parts(String(text)));
  return el('div', { class: 'scroll' }, el('table', {},
    el('thead', {}, el('tr', {}, header.map((h, k) => cell('th', h, k)))),
    el('tbody', {}, rows.map((row) => el('tr', {}, row.map((c, k) => cell('td', c, k)))))));
}

// Runs of the chosen data set, and the chosen one among them.
const runsHere = () => data.runs.filter((run) => run.dataset === state.dataset);
const chosen = () => runsHere().find((run) => run.variant === state.variant) ?? runsHere()[0];
