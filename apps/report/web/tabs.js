'use strict';
// The parts without charts: overview, gallery, configuration.

function card(title, value, more = '') {
  return el('div', { class: 'card' }, el('span', {}, title), el('b', {}, String(value)), more ? el('span', {}, more) : null);
}

function cardsOf(run) {
  const f = run.figures, cards = [];
  if (f.slam && !f.slam.error) {
    const before = f.odometry && !f.odometry.error ? `odometry alone ${lengthText(f.odometry.ate_rmse_m)}` : '';
    cards.push(card('ATE (rmse)', lengthText(f.slam.ate_rmse_m), before));
    if (isNumber(f.slam.rpe_rmse_m)) cards.push(card('RPE, frame to frame', lengthText(f.slam.rpe_rmse_m)));
    if (isNumber(f.slam.t_rel_percent)) {
      cards.push(card('KITTI errors', `${fixed(f.slam.t_rel_percent, 2)} %`, `${fixed(f.slam.r_rel_deg_per_100m, 3)} deg/100 m`));
    }
    cards.push(card('path', lengthText(f.path_m)));
  }
  const noDepth = f.without_depth ? `, ${f.without_depth} without depth` : '';
  const blurred = f.by_grey_values ? `, ${f.by_grey_values} by grey values alone` : '';
  cards.push(card('frames with a pose', `${f.tracked} / ${f.frames}`, `${f.keyframes} keyframes${noDepth}${blurred}`));
  const judged = 'true' in f ? `${f.true} true, ${f.false} false` : '';
  cards.push(card('loops accepted', `${f.accepted} of ${f.proposed}`, judged));
  cards.push(card('time', `${fixed(f.wall_s, 1)} s`, `a pose ${fixed(f.latency_ms, 1)} ms after its image, p99 ${fixed(f.latency_p99_ms, 1)} ms`));
  cards.push(card('memory', `${fixed(f.memory_mb, 0)} MB`, `processor ${fixed(f.cpu_s, 1)} s`));
  if (f.imu) {
    const { imu } = f;
    const says = imu.findings ? 'left out: see Health' : imu.used ? 'agrees with the images' : 'not enough motion to use it';
    const clock = `clock ${fixed(imu.time_offset_ms, 1)} ms, ${fixed(imu.residual_deg, 3)} deg a frame unexplained`;
    const up = imu.up_sigma_deg === null ? '' : `; z is up to ${fixed(imu.up_sigma_deg, 2)} deg`;
    cards.push(card(`IMU, ${imu.rate_hz} Hz`, says, imu.used ? clock + up : ''));
  }
  if (f.lens) {
    const known = (name) => `${name} ${fixed(f.lens[name], 4)} ± ${fixed(f.lens[`${name}_sigma`], 4)}`;
    cards.push(card('lens, self-calibrated', known('k1'), `${known('k2')}; moved ${f.lens.steps} times`));
  }
  if (f.height && f.height.corrections > 0)
    cards.push(card('scale, by the height', `${f.height.corrections} corrections`, `ground measured ${f.height.measurements} times`));
  return el('div', { class: 'cards' }, cards);
}

async function drawOverview(panel) {
  for (const part of (data.tables ?? []).filter((t) => t.dataset === state.dataset)) {
    panel.append(el('h2', {}, 'What did the ensemble buy?'), table(part.header, part.rows));
    for (const line of part.notes) panel.append(el('p', {}, line));
  }
  const run = chosen();
  if (data.runs.length > 1) panel.append(el('h2', {}, `${run.variant}, seed ${run.seed}`));
  panel.append(healthOf(run));
  panel.append(cardsOf(run));
  if (run.figures.slam?.error) panel.append(note(`No evaluation: ${run.figures.slam.error}`));
  if (!run.figures.slam) panel.append(note('No ground truth, so no errors; loops are neither true nor false.'));
  if (!run.odometry_complete) panel.append(note('The odometry of this run ends at the first correction (run.odometry_pass: false, or it was interrupted).'));
  for (const finding of run.findings) panel.append(note(`The calibration can't be right: ${finding}`));
  for (const failure of data.failures ?? []) panel.append(note(`Failed: ${failure}`));
  // Several tabs may lack the same thing.
  for (const missing of new Set(TABS.map(([, , , why]) => why()).filter((why) => why))) panel.append(note(missing));
  if (!missingMap()) await drawTopChart(panel, '');
  const loops = run.loops.filter((loop) => loop.outcome !== 'missed');
  if (loops.length) {
    const rows = loops.map((l) => [`${OUTCOMES[l.outcome].sign} ${OUTCOMES[l.outcome].name}`, l.query, l.candidate, fixed(l.h, 3), fixed(l.p, 3), l.inliers, l.reason]);
    panel.append(el('details', {}, el('summary', {}, `All ${loops.length} proposed loops`),
      table(['outcome', 'frame', 'place of frame', 'H', 'probability', 'inliers', 'reason'], rows, [6])));
  }
}

const missingGallery = () => (chosen().gallery.entries.length ? '' : chosen().gallery.note ? `No gallery: ${chosen().gallery.note}`
  : 'No gallery: no loop was proposed, and none is known.');

// Opens a picture as large as the window; arrows go on to the next one, Escape or a click closes it.
function openPicture(figures, at) {
  const picture = el('img', { alt: '' }), words = el('p', {});
  const dialog = el('dialog', { class: 'large', 'aria-label': 'picture' }, picture, words);
  const go = (k) => {
    at = (k + figures.length) % figures.length;
    picture.src = figures[at].querySelector('img').src;
    picture.alt = words.textContent = figures[at].querySelector('figcaption').innerText.replace(/\n/g, ': ');
  };
  dialog.addEventListener('click', () => dialog.close());
  dialog.addEventListener('close', () => { dialog.remove(); figures[at].querySelector('button').focus(); });
  dialog.addEventListener('keydown', (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (step) go(at + step);
  });
  go(at);
  document.body.append(dialog);
  dialog.showModal();
}

async function drawGallery(panel) {
  const gallery = chosen().gallery;
  if (gallery.note) panel.append(note(gallery.note));
  panel.append(note('Left: the image. Right: the place that was meant (missed: where the ground truth says it was before). Lines: matched features. A click enlarges a picture.'));
  for (const [outcome, style] of Object.entries(OUTCOMES)) {
    const entries = gallery.entries.filter((entry) => entry.outcome === outcome);
    if (!entries.length) continue;
    panel.append(el('h2', {}, `${style.sign} ${style.name}`));
    panel.append(el('div', { class: 'gallery' }, entries.map((entry) => el('figure', { style: `--mark: ${style.color}` },
      el('button', { type: 'button', 'aria-label': `enlarge: ${entry.title}` },
        el('img', { src: entry.picture, alt: `${style.name}: ${entry.title}`, loading: 'lazy' })),
      el('figcaption', {}, el('b', { 'data-sign': style.sign }, entry.title), el('br'), entry.text)))));
  }
  const figures = [...panel.querySelectorAll('figure')];
  figures.forEach((figure, k) => figure.querySelector('button').addEventListener('click', () => openPicture(figures, k)));
}

async function drawConfiguration(panel) {
  const c = chosen().configuration;
  panel.append(table(['what', 'value'], [['data set', c.dataset], ['configuration', c.file], ['seed', c.seed],
    ['ground truth', c.ground_truth || 'none'], ...Object.entries(c.versions)], [1]));
  for (const section of c.sections) {
    panel.append(el('details', {}, el('summary', {}, `${section.name}:`), table(['key', 'value', 'meaning'], section.rows, [1, 2])));
  }
}
