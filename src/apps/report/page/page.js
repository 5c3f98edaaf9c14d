// SPDX-License-Identifier: MIT
// Opens what the file holds: a run with its plots, or a study.
'use strict';

function describe(run) {
  const {meta} = run, last = run.steps[run.steps.length - 1], s = meta.summary, parts = [];
  if (s)
    parts.push(`${s.scene}: ${s.outcome}`, `solver ${s.solver}`);
  else
    parts.push('not finished');
  if (last) parts.push(`${last.step} steps to t = ${shortNumber(last.t)} ${run.unit('s')}`);
  if (s) parts.push(`computed in ${shortNumber(s.seconds.total)} s`);
  return parts.join(' · ');
}

function showCertificate({certificate}) {
  if (!certificate) return;
  const good = !certificate.count, head = `${certificate.frames} stored frames, each by itself: `;
  const text = good ? 'no intersection, nothing inside of a body, no inversion' : `${certificate.count} violations`;
  const element = html(
      'details', {className: good ? 'certificate' : 'certificate failed'}, html('summary', {}, head + text),
      ...certificate.violations.map(v => html('div', {}, v)));
  document.querySelector('header').append(element);
}

// Shows warnings of one kind, which differ in their numbers, as one; a step of the first leads to its time.
function showWarnings(run, onTime) {
  const kinds = new Map();
  const add = (text, count, step) => {
    const kind = text.replace(/\d+(\.\d+)?(e[+-]?\d+)?/g, '#'), known = kinds.get(kind);
    if (known) return step && (known.count += count, known.last = step);
    kinds.set(kind, {text, count, first: step, last: step});
  };
  for (const step of run.steps)
    for (const text of step.warnings ?? []) add(text, 1, step);
  for (const {text, count} of run.meta.summary?.warnings ?? []) add(text, count);  // also what no step has
  if (!kinds.size) return;
  const list = [...kinds.values()], count = list.reduce((sum, w) => sum + w.count, 0);
  const lineOf = ({text, count, first, last}) => {
    const line = html('div', {}, count > 1 ? `${text} (${count} times)` : text);
    if (!first) return line;
    const from = first.step ? `step ${first.step}` : 'start', where = first === last ? from : `${from} to ${last.step}`;
    line.prepend(html('button', {onclick: () => onTime(first.t), title: 'show this time'}, where), ' ');
    return line;
  };
  document.querySelector('header').append(html(
      'details', {className: 'warnings'}, html('summary', {}, `${count} warning${count > 1 ? 's' : ''}`),
      ...list.map(lineOf)));
}

function showPlots(run, onTime) {
  const plots = plotsOf(run).map(p => new Plot(p, onTime));
  document.getElementById('plots').append(...plots.map(p => p.figure));
  return plots;
}

// Says on the page that something failed; plots stay.
function stayWithPlots(error) {
  document.body.classList.remove('with-view');
  document.getElementById('why').textContent = `Plots only, as there is no 3D drawing here (${error.message}).`;
}

// Bounds of the rounding: displacements are 16-bit shares of their box, other values 16-bit logarithms.
function errorOf(run) {
  const size =
      Math.max(...run.frames[0].low.map((_, k) => run.frames.reduce((m, f) => Math.max(m, f.high[k] - f.low[k]), 0)));
  const u = shortNumber(size / 65535 / 2);
  return `as stored within ${u} ${run.unit('m')} of displacements and 0.1 % of other values`;
}

async function openPage() {
  const run = await new Run().load();
  document.getElementById('said').textContent = describe(run);
  showCertificate(run.meta);
  document.getElementById('foot').textContent = [
    ...run.meta.notes, errorOf(run), `ITR ${run.meta.version}`, 'drag: turn, with shift: move; wheel: zoom',
    'keys: space plays, comma and dot step, arrows turn, + and − zoom, f fits, e edits, l logarithmic'
  ].join(' · ');
  let view = null, pending = 0, shown = 0;
  const report = {run, plots: [], view: null};
  const showTime = () => report.plots.forEach(p => p.show(run.frames[view ? view.state.frame : run.frames.length - 1].t));
  const onTime = t => {
    if (!view) return report.plots.forEach(p => p.show(t));
    const frame = nearest(run.frames.map(f => f.t), t);
    if (frame !== view.state.frame) view.set({frame});
  };
  showWarnings(run, onTime);
  report.plots = showPlots(run, onTime);
  try {
    if (new URLSearchParams(location.search).has('plots')) throw new Error('plots asked for');
    const remember = () => {
      pending = 0;
      try {
        history.replaceState(null, '', view.toHash());
      } catch {  // some browsers do not allow that for files
      }
    };
    view = report.view = new View(run, {
      onChange: () => {
        const now = performance.now();
        if (!view?.playing || now - shown > 100) showTime(), shown = now;  // text takes as long as a frame
        if (!pending) pending = setTimeout(remember, 300);
      }
    });
    document.getElementById('main').append(view.root);
    document.body.classList.add('with-view');
    view.resize();
    await view.fromHash(location.hash);
    addEventListener('hashchange', () => location.hash !== view.toHash() && view.fromHash(location.hash));
  } catch (error) {
    view = report.view = null;
    document.getElementById('main').replaceChildren();
    stayWithPlots(error);
  }
  showTime();
  return report;
}

window.itrReport =
    (document.getElementById('study') ? openStudy() : openPage()).catch(error => (stayWithPlots(error), {failed: error}));
