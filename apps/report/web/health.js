'use strict';
// Whether the run itself says that its result can be believed.

function healthOf(run) {
  const health = run.health;
  if (!health) return '';
  const word = el('b', {}, health.word);
  if (!health.reasons.length) return el('p', { class: 'health' }, 'Health: ', word, '. Nothing that the run shows speaks against its result.');
  return el('div', { class: 'health' }, el('p', {}, 'Health: ', word), el('ul', {}, health.reasons.map((reason) => el('li', {}, reason))));
}
