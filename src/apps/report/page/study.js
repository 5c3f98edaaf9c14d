// SPDX-License-Identifier: MIT
// Shows the results of a study: its diagrams of error against cost, answers, commands, and two runs side by side.
'use strict';

const MEASURES = [
  ['l2', 'L2 error of the displacement, relative'], ['h1', 'H1 error of the displacement, relative'],
  ['surface', 'distance of the surfaces [m]'], ['energy', 'error of the energy [J]'],
  ['momentum', 'error of the momentum [kg m/s]']
];

// null: smaller than what the reference is worth, so not told; empty: not compared.
function errorText(study, run, measure) {
  const value = run.errors?.[measure],
        write = v => ['l2', 'h1'].includes(measure) ? `${shortNumber(100 * v)} %` : shortNumber(v);
  if (value === undefined) return '';
  return value === null ? `< ${write(study.worth?.[measure] ?? 0)}` : write(value);
}

// Text with `names` as code.
const withCode = text => text.split('`').map((part, i) => i % 2 ? html('code', {}, part) : part);

// Points of the stored diagram with their runs: those of a line SERIES-MEASURE-COST are in the order of their errors.
function pointsOf(diagram, study) {
  const points = [];
  for (const series of new Set(study.runs.map(r => r.series)))
    for (const [measure] of MEASURES)
      for (const cost of ['processor_seconds', 'unknowns', 'memory_mb']) {
        const runs = study.runs.filter(r => r.series === series && r.errors?.[measure] > 0 && r[cost] > 0)
                         .sort((a, b) => b.errors[measure] - a.errors[measure]);
        const marks = diagram?.querySelectorAll(`[id="${series}-${measure}-${cost}"] use`) ?? [];
        marks.forEach((mark, k) => points.push({mark, run: runs[k]}));
      }
  return points;
}

// Cells of a rest mesh by place.
class Locator {
  constructor(frame) {
    const {run, mesh} = frame, dim = run.dim, corners = this.corners = run.cells.columns.slice(0, dim + 1);
    Object.assign(this, {frame, run, dim, cells: new Map()});
    let size = 0;
    this.boxes = Array.from(mesh.cells, c => {
      const box = [];
      for (let k = 0; k < dim; ++k) {
        const at = corners.map(column => run.rest[k][column[c]]);
        box.push(Math.min(...at), Math.max(...at));
        size += box[2 * k + 1] - box[2 * k];
      }
      return box;
    });
    this.step = 1.5 * size / Math.max(1, dim * mesh.cells.length) || 1;
    mesh.cells.forEach(
        (c, i) =>
            this.visit(this.boxes[i], key => this.cells.has(key) ? this.cells.get(key).push(c) : this.cells.set(key, [c])));
  }
  visit(box, act) {
    const index = v => Math.floor(v / this.step);
    for (let i = index(box[0]); i <= index(box[1]); ++i)
      for (let j = index(box[2]); j <= index(box[3]); ++j)
        for (let k = this.dim === 3 ? index(box[4]) : 0; k <= (this.dim === 3 ? index(box[5]) : 0); ++k)
          act(`${i},${j},${k}`);
  }
  // Displacement at a rest position, of the cell that has it, or the one that nearly has it; null: there is none.
  displacement(p) {
    const {run, dim, corners, frame} = this;
    let best = -0.05, found = null;
    this.visit(p.flatMap(v => [v, v]), key => {
      for (const c of this.cells.get(key) ?? []) {
        const w = this.weights(c, p), least = Math.min(...w);
        if (least > best) best = least, found = [c, w];
      }
    });
    if (!found) return null;
    const [c, w] = found, u = frame.u.map(column => w.reduce((sum, share, i) => sum + share * column[corners[i][c]], 0)),
              {curved} = frame.mesh;
    if (curved)
      for (let i = 0; i <= dim; ++i)
        for (let j = 0; j < i; ++j) {
          const [a, b] = [corners[i][c], corners[j][c]], node = curved.get(run.edgeKey(a, b));
          if (node !== undefined)
            frame.u.forEach((column, k) => u[k] += 2 * w[i] * w[j] * (2 * column[node] - column[a] - column[b]));
        }
    return u;
  }
  weights(c, p) {
    const {dim, run, corners} = this, v = corners.map(column => p.map((_, k) => run.rest[k][column[c]])),
                     m = (a, b) => a.map((x, k) => x - b[k]);
    const det = dim === 2 ? (a, b) => a[0] * b[1] - a[1] * b[0] :
                            (a, b, d) => a[0] * (b[1] * d[2] - b[2] * d[1]) - a[1] * (b[0] * d[2] - b[2] * d[0]) +
            a[2] * (b[0] * d[1] - b[1] * d[0]);
    const sides = v.slice(1).map(q => m(q, v[0])), whole = det(...sides), to = m(p, v[0]),
          w = sides.map((_, i) => det(...sides.map((s, j) => i === j ? to : s)) / whole);
    return [1 - w.reduce((a, b) => a + b, 0), ...w];
  }
}

// |u - u of the other run| by vertex.
async function differenceOf(run, other) {
  const last = r => r.frame(r.frames.length - 1), [own, theirs] = await Promise.all([last(run), last(other)]),
        locator = new Locator(theirs);
  const values = new Float32Array(run.meta.counts.vertices);
  let largest = 0;
  for (const id of own.mesh.vertices) {
    if (run.kind[id] === KIND.obstacle) continue;
    const u = locator.displacement(run.rest.map(column => column[id]));
    if (u) largest = Math.max(largest, values[id] = Math.hypot(...u.map((v, k) => v - own.u[k][id])));
  }
  return {of: 'vertex', values, largest};
}

const quoted = text => /^[\w./=:-]+$/.test(text) ? text : `'${text.replaceAll('\'', `'\\''`)}'`;

function commandOf(study, run) {
  return [
    'itr run', quoted(study.scene), '-o', quoted(run.run), ...(run.solver ? ['--solver', run.solver] : []),
    ...run.set.flatMap(s => ['--set', quoted(s)])
  ].join(' ');
}

async function openStudy() {
  const parse = id => JSON.parse(document.getElementById(id).textContent), study = parse('study'),
        {runs: names, notes} = parse('study-runs');
  const said = document.getElementById('said'), main = document.getElementById('main'),
        plots = document.getElementById('plots'), foot = document.getElementById('foot');
  said.append(...withCode(`Speed against error: ${study.scene} · errors against ${study.reference}`));
  foot.textContent = [...notes, `ITR ${study.version}`].join(' · ');
  const diagram = document.querySelector('#fallback svg'),
        report = {study, points: pointsOf(diagram, study), views: [null, null], shown: ['', '']};

  const about = html('pre', {className: 'pick'}), command = html('code'),
        copy = html(
            'button', {
              onclick: async () => {
                await navigator.clipboard?.writeText(command.textContent)
                    .catch(() => getSelection().selectAllChildren(command));
              }
            },
            'copy');
  const tell = run => {
    about.textContent = [
      `${run.run}: ${run.label}`,
      ...(run.status === 'failed' ? [`failed: ${run.reason}`] :
                                    [
                                      `${run.vertices} vertices, ${shortNumber(run.processor_seconds)} processor seconds, ${
                                          shortNumber(run.memory_mb)} MB`,
                                      ...MEASURES.filter(([m]) => run.errors?.[m] !== undefined && run.errors[m] !== 0)
                                          .map(([m, label]) => `${label}: ${errorText(study, run, m)}`)
                                    ])
    ].join('\n');
    command.textContent = commandOf(study, run);
    report.points.forEach(p => p.mark.classList.toggle('chosen', p.run === run));
  };
  const onPoint = (run, isChosen) => {
    tell(run);
    if (isChosen && names.includes(run.run)) report.show(0, run.run);
  };
  for (const {mark, run} of report.points) {
    mark.append(svg('title', {}, `${run.run}: ${run.label}\n${run.vertices} vertices at the end`));
    mark.addEventListener('pointerenter', () => onPoint(run, false));
    mark.addEventListener('click', () => onPoint(run, true));
  }
  if (diagram) plots.append(diagram);
  const table = html(
      'table', {},
      html('tr', {}, ...['run', '', 'status', 'vertices', 'processor s', 'L2', 'H1'].map(t => html('th', {}, t))),
      ...study.runs.map(
          run => html(
              'tr', {onclick: () => onPoint(run, true)},
              ...[run.run, run.label, run.status, run.vertices ?? '',
                  run.processor_seconds === undefined ? '' : shortNumber(run.processor_seconds), errorText(study, run, 'l2'),
                  errorText(study, run, 'h1')]
                  .map(t => html('td', {}, String(t))))));
  const point = html('section', {className: 'words point'}, about, html('p', {}, command, ' ', copy));
  const answers = html(
      'section', {className: 'words'}, html('ul', {}, ...study.answers.map(a => html('li', {}, ...withCode(a)))),
      html('ul', {className: 'doubts'}, ...(study.doubts ?? []).map(d => html('li', {}, ...withCode(d)))), table);
  plots.before(point);
  plots.after(answers);
  if (study.runs.length) tell(study.runs.find(r => r.status === 'finished') ?? study.runs[0]);
  if (!names.length) {
    document.getElementById('why').textContent = 'No run of this study has stored frames: no meshes are shown.';
    return report;
  }

  try {
    if (new URLSearchParams(location.search).has('plots')) throw new Error('plots asked for');
    const loaded = new Map(), metas = names.map(name => parse(`run-${name}-meta`)), origin = metas[0].origin;
    const least = (key, pick) => origin.map((_, k) => pick(...metas.map(m => m[key][k]))), low = least('low', Math.min),
          high = least('high', Math.max);
    const load = name => {
      if (!loaded.has(name)) loaded.set(name, unpack(name));
      return loaded.get(name);
    };
    const unpack = async name => {
      const run = await new Run(`run-${name}-`).load(), shift = run.meta.origin.map((o, k) => o - origin[k]);
      run.rest.forEach((column, k) => shift[k] && column.forEach((v, i) => column[i] = v + shift[k]));
      Object.assign(run.meta, {origin, low, high});
      return run;
    };
    const camera = new Camera(origin.length), slots = [0, 1].map(() => html('div', {className: 'slot'}));
    const selects = [0, 1].map(
        i => html(
            'select', {onchange: () => report.show(i, selects[i].value)},
            ...names.map(name => html('option', {value: name}, name))));
    main.append(html('div', {className: 'pair'}, ...slots));
    document.body.classList.add('with-view', 'with-study');
    const follow = i => view => {  // the other view has the same camera and settings
      const other = report.views[1 - i],
            keys = ['field', 'log', 'least', 'most', 'factor', 'edges', 'obstacles', 'axis', 'cut', 'flip'];
      if (!other || report.isFollowing) return;
      report.isFollowing = true;
      const changes =
          Object.fromEntries(keys.filter(key => other.state[key] !== view.state[key]).map(key => [key, view.state[key]]));
      if (Object.keys(changes).length)
        other.set(changes);
      else
        other.draw();
      report.isFollowing = false;
    };
    let turn = Promise.resolve();
    report.show = (i, name) => turn = turn.then(async () => {
      const chosen = [...report.shown];
      chosen[i] = name;
      const runs = await Promise.all(chosen.map(load)), state = report.views[0]?.state ?? {};
      for (const field of runs[0].stored) {  // one range for both
        const same = runs[1].stored.find(f => f.name === field.name);
        if (same) runs.forEach(r => r.stored.find(f => f.name === field.name).shown = Math.max(field.largest, same.largest));
      }
      const largestU = Math.max(...runs.map(r => r.meta.largest_u)),
            differences = await Promise.all([differenceOf(...runs), differenceOf(runs[1], runs[0])]);
      const largest = Math.max(...differences.map(d => d.largest));
      report.views.forEach(view => view?.close());
      report.views = runs.map(
          (run, k) => new View(run, {
            onChange: follow(k),
            camera,
            largestU,
            extras: {difference: {label: `difference of displacements`, unit: 'm', values: {...differences[k], largest}}}
          }));
      report.shown = chosen;
      report.views.forEach((view, k) => {
        selects[k].value = chosen[k];
        slots[k].replaceChildren(html('p', {}, selects[k]), view.root);
        view.resize();
      });
      const {field = 'difference', log = false, edges = true, axis = '', cut = 0.5, flip = false} = state;
      await Promise.all(report.views.map(view => view.set({field, log, edges, axis, cut, flip})));
    });
    const finished = study.runs.filter(r => names.includes(r.run)),
          best = finished.filter(r => r.errors && r.against === 'reference').sort((a, b) => a.errors.l2 - b.errors.l2)[0];
    const left = best?.run ?? names[0], others = names.filter(name => name !== left);
    report.shown = [left, others.includes('reference') ? 'reference' : others.pop() ?? left];
    await report.show(0, report.shown[0]);
  } catch (error) {
    main.replaceChildren();
    document.body.classList.remove('with-study');
    stayWithPlots(error);
  }
  return report;
}
