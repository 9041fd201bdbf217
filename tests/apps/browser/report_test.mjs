// Reports of real runs in a real browser: of a small synthetic town; for pictures (--shots), which show real data, of
// TUTTI_DATA/redkitchen if it is there.
// usage: node report_test.mjs TUTTI CONFIGS [--shots DIR]
import { spawnSync } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, rmSync, statSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { check, launch, SKIP } from './browser.mjs';
import { lookThrough } from './report.mjs';

const [tutti, configs, , shots] = process.argv.slice(2);
const EVERY_CHART = ['map', 'space', 'error', 'recall', 'posterior', 'gallery', 'timing'];

function run(...words) {
  const result = spawnSync(tutti, words, { encoding: 'utf8' });
  check(result.status === 0, `tutti ${words.join(' ')}\n${result.stderr}`);
}

// A run with loops.
function realRun(folder) {
  const kitchen = join(process.env.TUTTI_DATA ?? '', 'redkitchen');
  if (shots && process.env.TUTTI_DATA && existsSync(kitchen)) {
    run('run', '--config', join(configs, '7scenes.yaml'), '--dataset', kitchen, '--out', join(folder, 'kitchen'), '--quiet');
    return join(folder, 'kitchen', 'report.html');
  }
  if (shots) console.log('no TUTTI_DATA/redkitchen: a small synthetic town takes its place');
  const town = join(folder, 'town');
  run('generate', '--out', town, '--sensor', 'stereo', '--blocks-x', '1', '--block', '26', '--laps', '1.15', '--rate', '4.5',
    '--width', '320', '--height', '160', '--supersample', '1');
  run('run', town, '--out', join(folder, 'run'), '--quiet');
  return join(folder, 'run', 'report.html');
}

// A data set whose path is an attack: it ends the script element, and would run as an attribute, too.
function attack(folder) {
  const dataset = join(folder, `a"'&<img src=x onerror=window.hacked=1><`, 'script><script>window.hacked=2<', 'script><!--');
  mkdirSync(dataset, { recursive: true });
  run('generate', '--out', dataset, '--sensor', 'stereo', '--frames', '40', '--width', '320', '--height', '160',
    '--supersample', '1', '--force');
  const config = join(dataset, 'config.yaml');
  run('run', '--config', config, '--dataset', dataset, '--out', join(folder, 'attack'), '--quiet');
  run('compare', '--config', config, '--dataset', dataset, '--out', join(folder, 'compared'), '--variants', 'odometry,orb,ensemble',
    '--runs', '2');
  run('collect', join(folder, 'attack'), join(folder, 'compared'), '--report', join(folder, 'collected.html'));
  return [join(folder, 'attack', 'report.html'), join(folder, 'compared', 'report.html'), join(folder, 'collected.html')];
}

const browser = await launch();
const folder = mkdtempSync(join(tmpdir(), 'tutti-report-'));
try {
  const report = realRun(folder);
  if (!existsSync(report)) {
    console.log('skipped: this tutti was built without the chart library (packages.apt, group report)');
    process.exit(SKIP);
  }
  check(statSync(report).size < 10e6, `${report}: ${statSync(report).size} bytes`);
  await lookThrough(browser, report, { expected: EVERY_CHART, words: { posterior: 'log10 NFA' }, shots });
  // All charts have been seen in every look. A page of one run has the same ones; tables and choices are new in the other two.
  const [alone, compared, collected] = attack(folder);
  const expected = ['map', 'space', 'error', 'timing'], words = { overview: 'RPE [m]', timing: 'odometry_track' };
  await lookThrough(browser, alone, { expected, looks: ['phone'] });
  await lookThrough(browser, compared, { expected, words });
  await lookThrough(browser, collected, { expected, words, looks: ['light', 'phone'] });
} finally {
  await browser.close();
  rmSync(folder, { recursive: true, force: true });
}
