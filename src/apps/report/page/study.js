// SPDX-License-Identifier: MIT
// Shows the results of a study: diagrams of error against cost, answers, commands, and two runs side by side.
'use strict';

const MEASURES = [
  ['l2', 'L2 error of the displacement, relative'], ['h1', 'H1 error of the displacement, relative'],
  ['surface', 'distance of the surfaces [m]'], ['energy', 'error of the energy [J]'],
  ['momentum', 'error of the momentum [kg m/s]']
];
const COSTS = [
  ['processor_seconds', 'processor seconds'], ['unknowns', 'unknowns, mean over the steps'], ['memory_mb', 'memory [MB]']
];

// null: smaller than what the reference is worth, so not told; empty: not compared.
function errorText(study, run, measure) {
  const value = run.errors?.[measure],
        write = v => ['l2', 'h1'].includes(measure) ? `${shortNumber(100 * v)} %` : shortNumber(v);
  if (value === undefined) return '';
  return value === null ? `< ${write(study.worth?.[measure] ?? 0)}` : write(value);
}

// Runs that diagrams compare: those on other meshes, not with other solvers or time steps; without what tells the worth.
const shownIn = study =>
    study.runs.filter(r => !['solvers', 'time', ...(study.worth ? ['reference'] : [])].includes(r.series));

// Text with `names` as code.
const withCode = text => text.split('`').map((part, i) => i % 2 ? html('code', {}, part) : part);

// Logarithmic in both directions, a line for each series; points tell of their run and choose it.
class Diagram {
  constructor(study, [measure, label], [cost, costLabel], {onPoint, colourOf}) {
    const {width, left, right, top} = PLOT, height = 250, bottom = 38;
    const worth = study.worth?.[measure] ?? 0, isPoint = r => r.errors?.[measure] > 0 && r[cost] > 0;
    this.points = shownIn(study).filter(isPoint).map(run => ({run, x: run[cost], y: run.errors[measure]}));
    if (!this.points.length) return;
    const range = values => {
      const [low, high] = [Math.min(...values), Math.max(...values)];
      return [low / 1.25, high * 1.25];
    };
    const [x0, x1] = range(this.points.map(p => p.x)),
               [y0, y1] = range([...this.points.map(p => p.y), ...(worth > 0 ? [worth] : [])]),
               log = (v, a, b) => Math.log(v / a) / Math.log(b / a);
    const x = v => left + log(v, x0, x1) * (width - left - right),
          y = v => height - bottom - log(v, y0, y1) * (height - top - bottom);
    const drawing =
        svg('svg', {viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': `${label} against ${costLabel}`});
    for (const tick of ticksOf(x0, x1, true))
      drawing.append(
          svg('line', {x1: x(tick), x2: x(tick), y1: top, y2: height - bottom, stroke: '#e3e5e9'}),
          svg('text', {x: x(tick), y: height - bottom + 14, 'text-anchor': 'middle'}, shortNumber(tick)));
    for (const tick of ticksOf(y0, y1, true))
      drawing.append(
          svg('line', {x1: left, x2: width - right, y1: y(tick), y2: y(tick), stroke: '#e3e5e9'}),
          svg('text', {x: left - 5, y: y(tick) + 3.5, 'text-anchor': 'end'}, shortNumber(tick)));
    if (worth > 0)
      drawing.append(
          svg('line',
              {x1: left, x2: width - right, y1: y(worth), y2: y(worth), stroke: '#8a4b00', 'stroke-dasharray': '4 3'}),
          svg('text', {x: left + 4, y: y(worth) - 4}, 'what the reference is worth'));
    drawing.append(svg('text', {x: (left + width - right) / 2, y: height - 6, 'text-anchor': 'middle'}, costLabel));
    for (const series of new Set(this.points.map(p => p.run.series))) {
      const own = this.points.filter(p => p.run.series === series).sort((a, b) => b.y - a.y);
      drawing.append(svg('polyline', {
        points: own.map(p => `${x(p.x).toFixed(1)},${y(p.y).toFixed(1)}`).join(' '),
        fill: 'none',
        stroke: colourOf(series),
        'stroke-width': 1.3
      }));
      for (const p of own) {
        const dot =
            svg('circle', {cx: x(p.x), cy: y(p.y), r: 4.5, fill: colourOf(series), tabindex: 0, 'data-run': p.run.run},
                svg('title', {},
                    `${p.run.run}: ${p.run.label}\n${label} ${shortNumber(p.y)}\n${costLabel} ${shortNumber(p.x)}\n${
                        p.run.vertices} vertices at the end`));
        dot.addEventListener('pointerenter', () => onPoint(p.run, false));
        dot.addEventListener('click', () => onPoint(p.run, true));
        drawing.append(dot);
      }
    }
    this.figure = html('figure', {className: 'plot'}, html('figcaption', {}, label), drawing);
  }
  mark(name) {
    for (const dot of this.figure?.querySelectorAll('circle') ?? [])
      dot.setAttribute('stroke', dot.dataset.run === name ? '#1d2530' : 'none');
  }
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
  const series = [...new Set(shownIn(study).map(r => r.series))],
        colourOf = name => LINE_COLOURS[series.indexOf(name) % LINE_COLOURS.length];
  const report = {study, diagrams: [], views: [null, null], shown: ['', '']};

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
    report.diagrams.forEach(d => d.mark(run.run));
  };
  const onPoint = (run, isChosen) => {
    tell(run);
    if (isChosen && names.includes(run.run)) report.show(0, run.run);
  };
  for (const measure of MEASURES)
    for (const cost of COSTS) {
      const diagram = new Diagram(study, measure, cost, {onPoint, colourOf});
      if (diagram.figure) report.diagrams.push(diagram), plots.append(diagram.figure);
    }
  const legend = html(
      'p', {className: 'series'},
      ...series.map(name => html('span', {}, html('i', {style: `background:${colourOf(name)}`}), name)));
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
  const point = html('section', {className: 'words point'}, legend, about, html('p', {}, command, ' ', copy));
  const answers = html(
      'section', {className: 'words'}, html('ul', {}, ...study.answers.map(a => html('li', {}, ...withCode(a)))),
      html('ul', {className: 'doubts'}, ...(study.doubts ?? []).map(d => html('li', {}, ...withCode(d)))), table);
  plots.before(point);
  plots.after(answers);
  if (report.diagrams.length) document.body.classList.add('with-diagrams');  // then the stored one is not needed
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
          best = finished.filter(r => r.errors).sort((a, b) => a.errors.l2 - b.errors.l2)[0];
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
