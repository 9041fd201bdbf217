'use strict';
// Tabs and choices. A tab is drawn when it is first looked at, and again when the choice or the colours change.

// Each with what is missing of it here: a sentence for the overview, or nothing. Such a tab is left out.
const TABS = [
  ['overview', 'Overview', drawOverview, () => ''],
  ['map', 'Map', drawTop, missingMap],
  ['space', '3D', draw3d, missingMap],
  ['error', 'Error', drawErrors, missingErrors],
  ['recall', 'Precision-recall', drawRecall, missingRecall],
  ['posterior', 'Posterior', drawPosterior, missingPosterior],
  ['gallery', 'Gallery', drawGallery, missingGallery],
  ['imu', 'IMU', drawImu, missingImu],
  ['timing', 'Timing', drawTiming, () => ''],
  ['configuration', 'Configuration', drawConfiguration, () => ''],
];
const shownTabs = () => TABS.filter(([, , , missing]) => !missing());

async function show(id) {
  state.tab = id;
  for (const [other, , draw] of TABS) {
    const panel = document.getElementById(other), button = document.getElementById(`tab-${other}`);
    panel.hidden = other !== id;
    button.setAttribute('aria-selected', String(other === id));
    button.tabIndex = other === id ? 0 : -1;
    if (other === id) {
      button.scrollIntoView({ block: 'nearest', inline: 'nearest' });
      if (panel.dataset.state === '') {
        panel.dataset.state = 'drawing';
        await draw(panel);
        panel.dataset.state = 'drawn';
      }
    }
  }
}

async function redraw() {
  for (const [id] of TABS) {
    const panel = document.getElementById(id);
    for (const old of panel.querySelectorAll('.chart')) Plotly.purge(old);
    panel.replaceChildren();
    panel.dataset.state = '';
  }
  hideEmpty();
  await show(state.tab);
}

function hideEmpty() {
  for (const [id, , , missing] of TABS) document.getElementById(`tab-${id}`).hidden = Boolean(missing());
  if (document.getElementById(`tab-${state.tab}`)?.hidden) state.tab = 'overview';
}

function choice(name, values, current, set) {
  if (values.length < 2) return null;
  const select = el('select', { id: `choice-${name}` }, values.map((value) => el('option', { value }, value)));
  select.value = current;
  select.addEventListener('change', () => { set(select.value); redraw(); });
  return el('label', {}, `${name} `, select);
}

function choices() {
  const datasets = [...new Set(data.runs.map((run) => run.dataset))];
  const variants = [...new Set(runsHere().map((run) => run.variant))];
  document.getElementById('choices').replaceChildren(...[
    choice('dataset', datasets, state.dataset, (value) => { state.dataset = value; state.variant = chosen().variant; choices(); }),
    choice('variant', variants, state.variant, (value) => { state.variant = value; }),
  ].filter((node) => node));
}

function tabs() {
  const bar = document.getElementById('tabs'), panels = document.getElementById('panels');
  for (const [id, name] of TABS) {
    const button = el('button', { id: `tab-${id}`, role: 'tab', type: 'button', 'aria-controls': id }, name);
    button.addEventListener('click', () => show(id));
    bar.append(button);
    panels.append(el('section', { id, role: 'tabpanel', 'aria-labelledby': `tab-${id}`, 'data-state': '', hidden: '' }));
  }
  bar.addEventListener('keydown', (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const shown = shownTabs(), at = shown.findIndex(([id]) => id === state.tab);
    const next = shown[(at + step + shown.length) % shown.length][0];
    show(next);
    document.getElementById(`tab-${next}`).focus();
  });
}

async function start() {
  document.getElementById('title').textContent = data.title;
  document.title = data.title;
  document.getElementById('subtitle').textContent = data.subtitle ?? '';
  if (!data.runs.length) return document.getElementById('panels').append(note('No run left anything to show.'));
  state.dataset = data.runs[0].dataset;
  state.variant = (runsHere().find((run) => run.variant === 'ensemble') ?? data.runs[0]).variant;
  choices();
  tabs();
  hideEmpty();
  try {
    await loadCharts();
  } catch (error) {
    document.getElementById('panels').prepend(note(`The charts can't be drawn in this browser (${error.message}); one of 2023 or later can.`));
  }
  await show('overview');
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redraw);
  document.documentElement.dataset.ready = '1';
}

start();
