'use strict';
// Errors, precision and recall, times.

// Errors of every trajectory of the data set, with its name.
function errorLines() {
  const lines = [];
  const runs = runsHere();
  const alone = runs.find((run) => run.variant === 'odometry') ?? chosen();
  if (alone.errors.odometry) lines.push(['odometry', alone.errors.odometry]);
  for (const run of runs) if (run.variant !== 'odometry' && run.errors.slam) lines.push([run.variant, run.errors.slam]);
  return lines;
}

const missingErrors = () => (errorLines().length ? '' : 'No errors: no ground truth covers this run.');

// A panel for each trajectory, with the same axes: curves that jump about hide each other in one.
async function drawRelative(panel, lines) {
  const known = lines.filter(([, error]) => error.relative?.error.length);
  if (!known.length) return;
  const top = 1.05 * Math.max(...known.flatMap(([, error]) => error.relative.error));
  const pair = el('div', { class: 'pair', id: 'relative' });
  panel.append(el('h2', {}, 'Relative translation error, frame to frame'), pair);
  for (const [name, error] of known) {
    await chart(pair, 'small', [{ type: 'scatter', mode: 'lines', x: error.relative.distance, y: error.relative.error, name: label(name),
      line: { ...lineOf(name, 1.2), dash: 'solid' }, hovertemplate: '%{x:.1f} m: %{y:.4f} m<extra></extra>' }],
    layoutOf(`${name}: rmse ${lengthText(error.relative.rmse)}`, { showlegend: false, xaxis: axis('distance along the reference [m]'), yaxis: axis('RPE [m]', { range: [0, top] }) }));
  }
}

async function drawErrors(panel) {
  const lines = errorLines();
  const each = merged(lines.map(([name, error]) => ({ name, error })), ({ error }) => [error.error, error.turn_deg]);
  const traces = (field) => toldApart(each.map(({ names, error }) => ({ type: 'scatter', mode: 'lines', x: error.distance, y: error[field],
    name: label(names.join(', ')) + (field === 'error' ? `: rmse ${lengthText(error.rmse)}` : ''), line: lineOf(names.at(-1)) })));
  const range = { rangemode: 'tozero' };
  const x = 'distance along the reference [m]';
  await chart(panel, '', traces('error'), layoutOf('Absolute translation error',
    { xaxis: axis(x), yaxis: axis('error [m]', range), hovermode: 'x unified', showlegend: true }));
  await chart(panel, '', traces('turn_deg'), layoutOf('Absolute rotation error',
    { xaxis: axis(x), yaxis: axis('error [deg]', range), hovermode: 'x unified', showlegend: true }));
  await drawRelative(panel, lines);
  const figures = chosen().figures;
  panel.append(note(`Aligned by ${figures.alignment === 'sim3' ? 'Sim(3)' : 'SE(3)'}, as tutti evaluate.`));
}

function recallLine(curve, name, style) {
  const x = [0, ...curve.recall], y = [curve.precision[0] ?? 1, ...curve.precision];
  return [
    { type: 'scatter', mode: 'lines', x, y, name: `${label(name)}: ${fixed(100 * curve.recall_at_100, 1)} % recall at 100 % precision`,
      line: { ...style, shape: 'vh' }, legendgroup: name },
    { type: 'scatter', mode: 'markers', x: [curve.at_threshold[0]], y: [curve.at_threshold[1]], name: 'at the threshold',
      showlegend: false, legendgroup: name, marker: { color: style.color, size: 10, line: { color: css('--paper'), width: 1.5 } },
      hovertemplate: 'at the default threshold: recall %{x:.3f}, precision %{y:.3f}' },
  ];
}

const missingRecall = () => (runsHere().some((run) => run.precision_recall) ? '' : 'No precision and recall: this run looked for no loops, or nobody knows ' +
  'its loops (no ground truth covers it, or no image comes back to an earlier place).');

async function drawRecall(panel) {
  const run = chosen();
  const layout = (title) => layoutOf(title, { xaxis: axis('recall', { range: [-0.02, 1.02] }),
    yaxis: axis('precision', { range: [-0.02, 1.04] }) });
  const known = runsHere().filter((r) => r.precision_recall);
  if (known.length > 1) {
    for (const [which, title] of [['verified', 'Every variant, after verification'], ['ensemble', 'Every variant, by its posterior alone']]) {
      const traces = known.flatMap((r) => {
        const curve = r.precision_recall.curves.find((c) => c.name === which);
        return curve ? recallLine(curve, r.variant, lineOf(r.variant)) : [];
      });
      await chart(panel, '', toldApart(traces), layout(title));
    }
  }
  if (!run.precision_recall) {
    return panel.append(note('No curves of members: the chosen run looked for no loops.'));
  }
  const traces = run.precision_recall.curves.flatMap((curve) =>
    recallLine(curve, curve.name === 'verified' ? 'ensemble, verified' : curve.name, lineOf(curve.name)));
  await chart(panel, '', toldApart(traces), layout(known.length > 1 ? `Members of ${run.variant}` : 'Members, ensemble, and the ensemble verified'));
  const pr = run.precision_recall;
  panel.append(note(`${pr.rows_with_loop} of ${pr.images} images have a loop (${pr.rule}). Discs: at the default threshold.`));
}

const missingImu = () => (chosen().imu?.moments.length || chosen().imu?.findings.length ? ''
  : 'No IMU: none was beside the images, or it was left out (--no-imu), or the camera hardly turned.');

// Lines over time: [name, style, values].
async function drawImuSeries(panel, title, unit, t, lines, more = {}) {
  await chart(panel, 'small', lines.map(([name, style, y]) => ({ type: 'scatter', mode: more.mode ?? 'lines', x: t, y, name, line: { color: style, width: 1.2 }, marker: { color: style, size: 6 } })),
    layoutOf(title, { xaxis: axis('time since the first pose [s]'), yaxis: axis(unit, more.axis), hovermode: 'x unified', showlegend: lines.length > 1 }));
}

async function drawImu(panel) {
  const { imu } = chosen();
  const [first, second, third] = ['ensemble', 'odometry', 'reference'].map((name) => lineOf(name).color);
  const zero = { axis: { rangemode: 'tozero' } };
  for (const finding of imu.findings) panel.append(note(`The IMU was left out: ${finding}`));
  if (imu.turns.length) {
    const t = imu.turns.map((turn) => turn[0]);
    await drawImuSeries(panel, 'Turning, from frame to frame', 'rate [deg/s]', t, [['camera', second, imu.turns.map((turn) => turn[1])], ['gyroscope', first, imu.turns.map((turn) => turn[2])]], zero);
    await drawImuSeries(panel, 'Unexplained by the gyroscope', 'angle [deg]', t, [['apart', first, imu.turns.map((turn) => turn[3])]], zero);
  }
  if (imu.moments.length) {
    const t = imu.moments.map((moment) => moment.t);
    await drawImuSeries(panel, "The gyroscope's bias, by the images", 'bias [rad/s]', t, ['x', 'y', 'z'].map((name, k) => [name, [first, second, third][k], imu.moments.map((moment) => moment.bias[k])]));
    await drawImuSeries(panel, 'How late its clock is', 'offset [ms]', t, [['offset', first, imu.moments.map((moment) => moment.offset_ms)]]);
  }
  if (imu.tilts.length) await drawImuSeries(panel, "Up by the accelerometer, off the map's", 'angle [deg]', imu.tilts.map((tilt) => tilt[0]), [['tilt', first, imu.tilts.map((tilt) => tilt[1])]], { ...zero, mode: 'lines+markers' });
  if (imu.noise) {
    const both = [['gyro', 'gyroscope', 'rad/s'], ['acceleration', 'accelerometer', 'm/s²']];
    for (const [which, name, unit] of both) {
      await chart(panel, 'small', [{ type: 'scatter', mode: 'lines+markers', x: imu.noise.tau_s, y: imu.noise[which], name, line: { color: first, width: 1.2 } }],
        layoutOf(`Allan deviation of the ${name}, at rest for ${fixed(imu.noise.rest_s, 0)} s`, { xaxis: axis('mean over [s]', { type: 'log' }), yaxis: axis(`deviation [${unit}]`, { type: 'log' }), showlegend: false }));
    }
  }
  panel.append(note('Each chart and its bounds: docs/inertial.md.'));
}

async function drawTiming(panel) {
  const runs = runsHere();
  const names = [...new Set(runs.flatMap((run) => run.timing.stages.map((stage) => stage.name)))];
  const seconds = (run, name) => (run.timing.stages.find((stage) => stage.name === name)?.ms ?? 0) / 1000;
  names.sort((a, b) => seconds(chosen(), a) - seconds(chosen(), b));
  const traces = runs.map((run) => ({ type: 'bar', orientation: 'h', y: names.map(label), x: names.map((name) => seconds(run, name)),
    name: label(run.variant), marker: { color: lineOf(run.variant).color }, hovertemplate: '%{x:.2f} s' }));
  await chart(panel, 'tall', traces, layoutOf('Stages, summed over the run', { barmode: 'group', xaxis: axis('time [s]'), yaxis: axis(''), showlegend: runs.length > 1 }));
  const run = chosen(), times = run.timing.frame_ms;
  if (times.length) {
    const step = run.timing.frames / times.length;
    await chart(panel, 'small', [{ type: 'scatter', mode: 'lines', x: times.map((_, k) => Math.round(k * step)), y: times,
      name: 'frame', line: { color: lineOf('ensemble').color, width: 1.2 } }],
    layoutOf('From having a frame to having its pose', { xaxis: axis('frame'), yaxis: axis('time [ms]', { rangemode: 'tozero' }), showlegend: false }));
  }
  for (const part of (data.tables ?? []).filter((t) => t.dataset === state.dataset && t.stage_rows?.length)) {
    panel.append(el('h2', {}, 'Time per stage, mean over the runs'), table(part.stage_header, part.stage_rows));
  }
  panel.append(note('Several stages run at once, on threads of their own; what ends in _wait waits for others. Times are of the machine and its load.'));
}
