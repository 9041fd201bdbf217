'use strict';
// The loop detector's belief: evidence and posterior over all places, the members' weights, and the decision on each image.

function unpackMap(map, cells, value) {
  const bytes = atob(map.q), rows = [];
  for (let r = 0; r < cells; ++r) {
    const row = new Array(cells);
    for (let c = 0; c < cells; ++c) row[c] = value(bytes.charCodeAt(r * cells + c));
    rows.push(row);
  }
  return rows;
}

// Square roots of the posterior, as they are stored: small ones stay visible.
const rootOf = (byte) => byte / 255;
const logOf = (evidence) => (byte) => (byte === 0 ? null : Math.round((byte - evidence.zero) * evidence.step * 1e6) / 1e6);

function extent(maps) {
  let low = Infinity, high = -Infinity;
  for (const rows of maps) {
    for (const row of rows) {
      for (const v of row) {
        if (v === null) continue;
        low = Math.min(low, v);
        high = Math.max(high, v);
      }
    }
  }
  return [low, high];
}

// Loops over a heat map: time of the query and of its place.
function loopMarks(run, posterior) {
  return ['accepted', 'false'].flatMap((outcome) => {
    const loops = run.loops.filter((loop) => loop.outcome === outcome);
    if (!loops.length) return [];
    const style = OUTCOMES[outcome];
    return [{ type: 'scatter', mode: 'markers', name: style.name, hoverinfo: 'skip',
      x: loops.map((l) => l.qt - posterior.first_stamp_s), y: loops.map((l) => l.ct - posterior.first_stamp_s),
      marker: { symbol: `${style.symbol}-open`, size: 11, color: '#ffffff', line: { width: 1.5 } } }];
  });
}

// Probabilities of what was proposed, by outcome; hovering gives the reason.
function probabilityMarks(run, posterior) {
  return ['accepted', 'false', 'rejected'].flatMap((outcome) => {
    const loops = run.loops.filter((loop) => loop.outcome === outcome);
    if (!loops.length) return [];
    const style = OUTCOMES[outcome];
    return [{ type: 'scatter', mode: 'markers', name: style.name, x: loops.map((l) => l.qt - posterior.first_stamp_s),
      y: loops.map((l) => l.p), customdata: loops.map((l) => [l.query, l.candidate, label(l.reason || 'accepted')]),
      marker: { symbol: style.symbol, size: 8, color: style.color },
      hovertemplate: 'frame %{customdata[0]}, place of frame %{customdata[1]}: probability %{y:.3f}<br>%{customdata[2]}' }];
  });
}

const threshold = (p, value, name) => ({ type: 'scatter', mode: 'lines', x: [0, p.hypothesis_t.at(-1)], y: [value, value],
  name: `${name} ${value}`, hoverinfo: 'skip', line: { color: css('--faint'), dash: 'dot', width: 1.5 } });

async function drawOverTime(panel, run) {
  const p = run.posterior, x = axis('time [s]');
  const line = (field) => (of) => ({ type: 'scatter', mode: 'lines', x: p.hypothesis_t, y: of[field], name: label(of.name), line: lineOf(of.name) });
  await chart(panel, 'small', [...p.hypotheses.map(line('h')), threshold(p, p.threshold, 'looked at from')],
    layoutOf('Hypothesis: 1 - p(new place)', { xaxis: x, yaxis: axis('H', { rangemode: 'tozero' }), hovermode: 'x unified' }));
  const pair = el('div', { class: 'pair' });
  panel.append(pair);
  const marks = probabilityMarks(run, p);
  await chart(pair, 'small', [...marks, threshold(p, p.loop_threshold, 'accepted from')],
    layoutOf('Probability that it is a loop', { xaxis: axis('time [s]', { range: [0, p.hypothesis_t.at(-1)] }), yaxis: axis('probability', { range: [-0.04, 1.04] }) }));
  if (p.weights.length > 1) {
    await chart(pair, 'small', p.weights.map(line('w')), layoutOf('Weight of each member',
      { xaxis: x, yaxis: axis('share of the sum', { rangemode: 'tozero' }), hovermode: 'x unified' }));
  }
}

// Of one image: evidence and posterior over the places, what each member says, and how it was decided.
function beliefLayout(title, p, image, y) {
  const line = (row, dash) => (row < 0 ? [] : [{ type: 'line', x0: p.place_t[row], x1: p.place_t[row], yref: 'paper', y0: 0, y1: 1,
    layer: 'below', line: { color: css('--faint'), width: 1.5, dash } }]);
  return layoutOf(title, { xaxis: axis('time of the place [s]', { range: [0, p.place_t.at(-1)] }), yaxis: y, hovermode: 'x unified',
    shapes: [...line(image.row, 'dash'), ...(image.geometry ? line(image.geometry.row, 'solid') : [])] });
}

const OUTCOME_WORDS = { accepted: 'accepted', false: 'accepted, but false', rejected: 'rejected', none: 'not proposed' };

function decisionTable(p, image) {
  const g = image.geometry, rows = [];
  const add = (name, value, meaning) => rows.push([name, value, meaning]);
  add('p(new place)', fixed(image.new, 4), `geometry looks at 1 - p from ${p.threshold} on`);
  add('best place', image.candidate < 0 ? '-' : `frame ${image.candidate}`, `posterior ${fixed(image.posterior, 4)}`);
  if (g) {
    add('geometry says', `frame ${g.place}`, g.place === image.candidate ? 'the best place' : 'a place near it, or the next best');
    add('mass around it', fixed(g.mass, 4), 'posterior of all within 4 links');
    add('inliers', `${g.inliers} of ${g.matches}`, `in ${g.coverage} of 48 cells`);
    add('log10 NFA', fixed(g.log_nfa, 1), 'motions that chance fits as well');
    add('motion spread', fixed(g.spread, 4), 'of the inliers, share of the diagonal');
  }
  if (isNumber(image.probability)) add('probability', fixed(image.probability, 4), `accepted from ${p.loop_threshold} on`);
  return table(['decision', 'value', ''], rows, [2]);
}

function membersTable(p, image, logs) {
  const logAt = (k) => (image.row < 0 ? null : logs[k][image.row][image.column]);
  const rows = p.weights.map((member, k) => {
    const m = image.members[k];
    if (!m) return [member.name, '-', '-', '-', '-', 'sat out'];
    return [member.name, fixed(m[0], 3), fixed(m[1], 4), fixed(logAt(k), 1), fixed(m[3], 4), m[2] < 0 ? '-' : `frame ${m[2]}`];
  });
  rows.push(['ensemble', '', fixed(1 - image.new, 4), logs[p.weights.length] ? fixed(logAt(p.weights.length), 1) : '', fixed(image.posterior, 4), image.candidate < 0 ? '-' : `frame ${image.candidate}`]);
  return table(['member', 'weight', 'H', 'ln L there', 'p there', 'its best place'], rows);
}

function verdict(image) {
  const style = OUTCOMES[image.outcome];
  const missed = image.missed && image.outcome !== 'accepted' ? ' The ground truth has a loop here.' : '';
  return el('p', { class: 'verdict', style: style ? `--mark: ${style.color}` : '' }, el('b', {}, `${style ? `${style.sign} ` : ''}${OUTCOME_WORDS[image.outcome]}`),
    `${image.reason ? `: ${image.reason}` : ''}.${missed}`);
}

// The chosen image can be changed by the slider, the buttons and a click into a chart of all images.
async function drawOneImage(panel, run, logs, roots) {
  const p = run.posterior, images = p.images;
  const proposed = images.map((image, k) => k).filter((k) => images[k].outcome !== 'none');
  const slider = el('input', { type: 'range', id: 'image', min: '0', max: String(images.length - 1), step: '1', 'aria-label': 'image' });
  const button = (text, to) => {
    const node = el('button', { type: 'button' }, text);
    node.addEventListener('click', () => { const k = to(Number(slider.value)); if (k !== undefined) select(k); });
    return node;
  };
  const name = el('b', { id: 'image-name' });
  const words = el('div', { class: 'pair', id: 'image-words' }), charts = el('div', { class: 'pair', id: 'image-charts' });
  panel.append(el('h2', {}, 'One image'), el('div', { class: 'chooser' },
    button('\u2039 proposed', (k) => proposed.filter((i) => i < k).at(-1)), button('proposed \u203a', (k) => proposed.find((i) => i > k)), slider, name), words, charts);
  const over = (maps, value) => maps.map(([of, rows]) => ({ type: 'scatter', mode: 'lines', x: p.place_t, y: rows.map((row) => value(row[Number(slider.value)])),
    name: label(of), line: { ...lineOf(of), shape: 'hvh' }, connectgaps: false }));
  const plots = (image) => [
    [over(p.evidence.maps.map((map, k) => [map.name, logs[k]]), (v) => v),
      beliefLayout('Evidence: ln L of each place (0: as likely as a new one)', p, image, axis('ln L', { zerolinecolor: css('--faint') }))],
    [over(p.maps.map((map, k) => [map.name, roots[k]]), (v) => v * v), beliefLayout('Posterior of each place', p, image, axis('p', { rangemode: 'tozero' }))]];
  const say = () => {
    const k = Number(slider.value), image = { ...images[k], column: k };
    name.textContent = `frame ${image.query}, ${fixed(p.t[k], 1)} s`;
    words.replaceChildren(el('div', {}, verdict(image), decisionTable(p, image)), el('div', {}, membersTable(p, image, logs)));
    return image;
  };
  const redrawn = [];
  const follow = () => redrawn.forEach((draw) => draw(p.t[Number(slider.value)]));
  const select = (k) => {
    slider.value = String(k);
    plots(say()).forEach(([traces, layout], i) => Plotly.react(charts.children[i], traces, layout));
    follow();
  };
  slider.addEventListener('input', () => select(Number(slider.value)));
  const telling = images.map((image, k) => [image.outcome !== 'none' ? 1 + (image.probability ?? 0) : 1 - image.new, k]);
  slider.value = String(telling.reduce((a, b) => (b[0] > a[0] ? b : a))[1]);
  for (const [traces, layout] of plots(say())) await chart(charts, 'small', traces, layout);
  // What a chart over the time of the images needs to choose one, and to show which one is chosen.
  return (div) => {
    div.on?.('plotly_click', (event) => {
      const t = event.points[0].x;
      select(p.t.reduce((best, v, k) => (Math.abs(v - t) < Math.abs(p.t[best] - t) ? k : best), 0));
    });
    const draw = (t) => Plotly.relayout(div, { shapes: [{ type: 'line', x0: t, x1: t, yref: 'paper', y0: 0, y1: 1, line: { color: css('--accent'), width: 1.5, dash: 'dot' } }] });
    redrawn.push(draw);
    return draw(p.t[Number(slider.value)]);
  };
}

async function drawMaps(panel, first, run, logs, roots) {
  const p = run.posterior, marks = loopMarks(run, p);
  const pair = el('div', { class: 'pair', id: 'belief-maps' });
  panel.append(el('h2', {}, 'Evidence and posterior of each member'), pair);
  const largest = Math.max(0.05, extent(roots)[1]);
  const ticks = [0.001, 0.01, 0.03, 0.1, 0.3, 1].filter((v) => Math.sqrt(v) <= largest);
  const [low, high] = extent(logs).map((v) => (Number.isFinite(v) ? v : 0));
  const reach = Math.max(0.5, -low, high);
  const axes = { xaxis: axis('time of the image [s]'), yaxis: axis('time of the place [s]') };
  const hover = 'at %{x:.1f} s: place of %{y:.1f} s, ';
  const evidence = (k) => chart(pair, '', [{ type: 'heatmap', x: p.t, y: p.place_t, z: logs[k], zmin: -reach, zmax: reach, hoverongaps: false,
    colorscale: [[0, '#d55e00'], [0.5, css('--raised')], [1, css('--accent')]], colorbar: { thickness: 10, title: { text: 'ln L', side: 'top' } },
    hovertemplate: `${hover}ln L = %{z:.1f}<extra></extra>` }], layoutOf(`Evidence: ${p.evidence.maps[k].name}`, axes));
  const isEnsemble = (k) => p.maps[k].name === 'ensemble' || p.maps.length === 1;
  const posterior = (k) => {
    const top = isEnsemble(k) ? marks : [];
    return chart(isEnsemble(k) ? first : pair, isEnsemble(k) ? 'tall' : '', [{ type: 'heatmap', x: p.t, y: p.place_t, z: roots[k], colorscale: 'Cividis', zmin: 0, zmax: largest,
      customdata: roots[k].map((row) => row.map((v) => v * v)),
      colorbar: { thickness: 10, title: { text: 'p', side: 'top' }, tickvals: ticks.map(Math.sqrt), ticktext: ticks.map(String) },
      hovertemplate: `${hover}p = %{customdata:.4f}<extra></extra>` }, ...top],
    layoutOf(`Posterior: ${p.maps[k].name}`, { ...axes, showlegend: false }));
  };
  for (const [k] of p.maps.entries()) if (isEnsemble(k)) await posterior(k);
  for (const [k, map] of p.maps.entries()) {
    const of = p.evidence.maps.findIndex((e) => e.name === map.name);
    if (of >= 0) await evidence(of);
    else if (p.maps.length === 1) await evidence(0);  // a member alone is the ensemble
    if (!isEnsemble(k)) await posterior(k);
  }
}

function missingPosterior() {
  const p = chosen().posterior;
  if (!p) return 'No posterior: this run asked no loop detector.';
  if (p.maps.some((map) => /[^\0]/.test(atob(map.q)))) return '';
  return 'No posterior: no image had a place to compare with. The run is so short that all its keyframes were still in short-term memory (loops.stm_size).';
}

async function drawPosterior(panel) {
  const run = chosen(), p = run.posterior;
  const roots = p.maps.map((map) => unpackMap(map, p.cells, rootOf));
  const logs = p.evidence.maps.map((map) => unpackMap(map, p.cells, logOf(p.evidence)));
  // The ensemble's map is the first and the largest, the members' follow.
  const first = el('div', { id: 'ensemble-map' });
  panel.append(first);
  await drawOverTime(panel, run);
  const watch = await drawOneImage(panel, run, logs, roots);
  panel.append(note('ln L, p there: at the ensemble\'s best place. Lines in the charts: dashed at the best place, solid where geometry looked. ' +
    'Weights: shares of the members\' counts in the sum that the ensemble\'s filter gets (other rules than joint: all the same). A click into any other chart chooses its image.'));
  await drawMaps(panel, first, run, logs, roots);
  for (const div of panel.querySelectorAll('.chart')) if (!div.closest('#image-charts')) await watch(div);
  panel.append(note(`${p.cells} x ${p.cells} cells: a column is the one of its images that says most, a cell the largest value of its places. The rest of a posterior is "a new place". ` +
    'Evidence is of the image alone, before the filter: above 0 it speaks for the place, below 0 against it. White marks: accepted loops (crosses: false ones).'));
}
