// Headless Chromium for the tests: starts it, opens pages, collects what goes wrong on them.
import { existsSync } from 'node:fs';
import puppeteer from 'puppeteer-core';

export const SKIP = 77;  // exit status that ctest takes for a skipped test

const CANDIDATES = [process.env.TUTTI_CHROMIUM, '/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'];

export async function launch() {
  const executablePath = CANDIDATES.find((path) => path && existsSync(path));
  if (!executablePath) {
    console.log('skipped: no Chromium (Debian: apt-get install chromium; TUTTI_CHROMIUM names another one)');
    process.exit(SKIP);
  }
  return puppeteer.launch({
    executablePath,
    protocolTimeout: 240000,
    // A test runs as root in containers, without a GPU, and loads nothing from outside.
    args: ['--no-sandbox', '--disable-dev-shm-usage', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
  });
}

export const DESKTOP = { width: 1280, height: 900 };
export const PHONE = { width: 390, height: 844, deviceScaleFactor: 2, isMobile: true, hasTouch: true };

// A page, and the list of everything that went wrong on it: errors, those of the console, requests to a network.
export async function openPage(browser, url, { viewport = DESKTOP, scheme = 'light', allow = () => false } = {}) {
  const page = await browser.newPage();
  const problems = [];
  page.on('console', (message) => {
    if (message.type() === 'error') problems.push(`console: ${message.text()}`);
  });
  page.on('pageerror', (error) => problems.push(`error: ${error.message}`));
  page.on('dialog', (dialog) => { problems.push(`dialog: ${dialog.message()}`); dialog.dismiss(); });
  page.on('request', (request) => {
    const target = request.url();
    if (!/^(file|data|blob):/.test(target) && !allow(target)) problems.push(`request: ${target}`);
  });
  await page.emulateMediaFeatures([{ name: 'prefers-color-scheme', value: scheme }]);
  await page.setViewport(viewport);
  await page.goto(url, { waitUntil: 'load', timeout: 120000 });
  return { page, problems };
}

export function check(condition, what) {
  if (condition) return;
  console.error(`FAILED: ${what}`);
  process.exitCode = 1;
}

export const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

// What the promise gives, or nothing after so many milliseconds. A timer that is left would keep the process alive.
export function within(ms, promise) {
  let timer;
  const late = new Promise((done) => { timer = setTimeout(done, ms); });
  return Promise.race([promise, late]).finally(() => clearTimeout(timer));
}
