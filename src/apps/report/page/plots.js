// SPDX-License-Identifier: MIT
// Plots of steps over time, as SVG; all have one cursor.
'use strict';

const PLOT = {
  width: 380,
  height: 170,
  left: 58,
  right: 10,
  top: 8,
  bottom: 22
};
const LINE_COLOURS =
    ['#0072b2', '#d55e00', '#009e73', '#cc79a7', '#b07400', '#3a9bd0', '#1d2530', '#7a3e9d', '#8c4a2f', '#7f7f00'];

function svg(name, attributes = {}, ...children) {
  const element = document.createElementNS('http://www.w3.org/2000/svg', name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

function html(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes))
    key in element && key !== 'list' ? element[key] = value : element.setAttribute(key, value);
  element.append(...children);
  return element;
}

function shortNumber(value) {
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) return value.toExponential(2).replace(/\.?0+e/, 'e').replace('e+', 'e');
  return String(Number(value.toPrecision(4)));
}

// Numbers of one scale, all written alike.
function marksOf(values) {
  const size = Math.max(...values.map(Math.abs)), isShort = size < 1e5 && size >= 0.01;
  return isShort && values.every(v => v === 0 || Math.abs(v) >= 0.01 * size) ?
      values.map(shortNumber) :
      values.map(v => v === 0 ? '0' : v.toExponential(1).replace('e+', 'e'));
}

function ticksOf(low, high, log) {
  const found = [];
  if (log) {
    const found = roundBetween(low, high);
    if (found.length > 1) return found;
  }
  if (!(high - low > 1e-9 * Math.max(Math.abs(low), Math.abs(high)))) return [low];
  const raw = (high - low) / 5, power = 10 ** Math.floor(Math.log10(raw)),
        step = [1, 2, 5, 10].find(m => m * power >= raw) * power;
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) found.push(k * step);
  return found;
}

// 1, 2 and 5 times powers of ten, or where they are many these powers.
function roundBetween(low, high) {
  const found = [], decades = Math.log10(high / low), every = Math.max(1, Math.ceil(decades / 6));
  for (let e = Math.floor(Math.log10(low)); e <= Math.log10(high); e += every)
    for (const m of decades < 2.2 ? [1, 2, 5] : [1])
      if (m * 10 ** e >= 0.9999 * low && m * 10 ** e <= 1.0001 * high) found.push(m * 10 ** e);
  return found;
}

// Plots of steps.jsonl and of the frames' resultants.
function plotsOf(run) {
  const steps = run.steps, times = steps.map(s => s.t), take = f => steps.map(s => f(s) ?? NaN), list = [];
  const add = (title, unit, series, log = false, at = times) => {
    const shown = series.filter(s => s.values.some(v => Number.isFinite(v) && v !== 0));
    if (shown.length && at.length > 1)
      list.push({title, unit: run.unit(unit), time: run.unit('s'), log, times: at, series: shown});
  };
  const names = ['inertia', 'elastic', 'body', 'contact', 'friction', 'damping'];
  add('Energy of the step by term', 'J', [
    ...names.map((name, k) => ({name, colour: LINE_COLOURS[k]})), {name: 'total', colour: '#1d2530', dashes: '4 3'}
  ].map(s => ({...s, values: take(step => step.step > 0 ? step.energy?.[s.name] : NaN)})));  // no step has made step 0
  add('Vertices', '', [{name: '', values: take(s => s.vertices)}]);
  add('Seconds a step', '', [
    'total', 'remesh', 'linear_solve', 'assembly', 'ccd'
  ].map(name => ({name: name.replace('_', ' '), values: take(s => s.seconds?.[name])})));
  add('Newton iterations a step', '', [{name: '', values: take(s => s.newton_iterations)}]);
  add('Operations of remeshing that were accepted', '', [
    'splits', 'curves', 'straightens', 'collapses', 'swaps', 'smooths'
  ].map(name => ({name, values: take(s => s[name]?.accepted)})));
  add('Energy that remeshing gained', 'J', [{name: '', values: take(gainOf)}]);
  add('Least distance in contact', 'm', [{name: '', values: take(s => s.min_distance)}], true);
  add('Least volume ratio', '', [{name: '', values: take(s => s.min_volume_ratio)}]);
  const axes = ['x', 'y', 'z'].slice(0, run.dim),
        along = (axis, values) => ({name: axis, values, colour: LINE_COLOURS[Math.max(axes.indexOf(axis), 0)]});
  for (const [name, curve] of run.curves) {
    const part = kind => axes.map(axis => along(axis, curve[`${kind}_${axis}`]));
    const isThere = kind => part(kind).some(s => s.values.some(v => v !== 0)),
          kinds = ['contact', 'friction', 'reaction'].filter(isThere);
    add(`Force on ${name}`, 'N', part('all'), false, curve.times);
    for (const kind of kinds.length > 1 ? kinds : [])
      add(`${titleCase(kind)} force on ${name}`, 'N', part(kind), false, curve.times);
    const moments = run.dim === 2 ? [['', 'all_moment']] : axes.map(axis => [axis, `all_m${axis}`]);
    add(`Moment on ${name}`, 'N m', moments.map(([axis, column]) => along(axis, curve[column])), false, curve.times);
  }
  for (const force of Object.keys(run.frames[0].forces ?? {}))
    add(`Sum over all bodies, ${force.replace('_', ' ')}`, 'N',
        axes.map((axis, k) => along(axis, run.frames.map(f => f.forces[force]?.[k] ?? NaN))), false,
        run.frames.map(f => f.t));
  return list;
}

const titleCase = text => text[0].toUpperCase() + text.slice(1);

function gainOf(step) {
  return step.step > 0 ? step.energy_before_remesh + (step.shape_energy ?? 0) - step.energy.total - step.history_loss : 0;
}

class Plot {
  constructor(plot, onTime) {
    Object.assign(this, plot);
    const {width, height, left, right, top, bottom} = PLOT;
    const used = this.series.flatMap(s => s.values).filter(v => Number.isFinite(v) && (!this.log || v > 0));
    let low = used.reduce((a, b) => Math.min(a, b), Infinity), high = used.reduce((a, b) => Math.max(a, b), -Infinity);
    if (!this.log && low > 0 && low < 0.6 * high) low = 0;
    if (!(high - low > 1e-9 * Math.max(Math.abs(low), Math.abs(high))))
      [low, high] = this.log ? [low / 2, high * 2] : [low - (Math.abs(low) || 1) / 2, high + (Math.abs(high) || 1) / 2];
    const [t0, t1] = [this.times[0], this.times[this.times.length - 1]];
    this.x = t => left + (t - t0) / (t1 - t0) * (width - left - right);
    const share = this.log ? v => Math.log(v / low) / Math.log(high / low) : v => (v - low) / (high - low);
    this.y = v => height - bottom - share(v) * (height - top - bottom);
    this.drawing = svg('svg', {viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': this.title});
    for (const tick of ticksOf(low, high, this.log)) {
      this.drawing.append(svg('line', {x1: left, x2: width - right, y1: this.y(tick), y2: this.y(tick), stroke: '#e3e5e9'}));
      this.drawing.append(svg('text', {x: left - 5, y: this.y(tick) + 3.5, 'text-anchor': 'end'}, shortNumber(tick)));
    }
    for (const tick of ticksOf(t0, t1, false))
      this.drawing.append(svg('text', {x: this.x(tick), y: height - 7, 'text-anchor': 'middle'}, shortNumber(tick)));
    this.drawing.append(svg('text', {x: left - 16, y: height - 7, 'text-anchor': 'end'}, `t [${this.time ?? 's'}]`));
    const colourOf = (s, k) => s.colour ?? LINE_COLOURS[k % LINE_COLOURS.length];
    this.series.forEach((s, k) => this.drawing.append(svg('path', {
      d: this.path(s.values),
      fill: 'none',
      stroke: colourOf(s, k),
      'stroke-width': 1.4,
      'stroke-dasharray': s.dashes ?? 'none'
    })));
    this.cursor = svg('line', {y1: top, y2: height - bottom, stroke: '#1d2530', 'stroke-dasharray': '3 2'});
    this.drawing.append(this.cursor);
    this.values = this.series.map((s, k) => html('span', {style: `color:${colourOf(s, k)}`}));
    const unit = this.unit ? ` [${this.unit}]` : '';
    this.figure =
        html('figure', {className: 'plot'}, html('figcaption', {}, this.title + unit, ...this.values), this.drawing);
    const move = event => {
      const box = this.drawing.getBoundingClientRect(), at = (event.clientX - box.left) / box.width * width;
      onTime(t0 + Math.min(Math.max((at - left) / (width - left - right), 0), 1) * (t1 - t0));
    };
    this.drawing.addEventListener('pointermove', move);
    this.drawing.addEventListener('pointerdown', move);
  }
  path(values) {
    let text = '', pen = 'M';
    values.forEach((v, i) => {
      if (!Number.isFinite(v) || (this.log && !(v > 0))) return pen = 'M';
      text += `${pen}${this.x(this.times[i]).toFixed(1)} ${this.y(v).toFixed(1)}`;
      pen = 'L';
    });
    return text;
  }
  show(t) {
    const i = nearest(this.times, t), x = this.x(this.times[i]);
    this.cursor.setAttribute('x1', x);
    this.cursor.setAttribute('x2', x);
    this.series.forEach(
        (s, k) => this.values[k].textContent =
            `${s.name} ${Number.isFinite(s.values[i]) ? shortNumber(s.values[i]) : '–'}`.trim());
  }
}

// Index of the nearest of ascending numbers.
function nearest(list, value) {
  let low = 0, high = list.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    list[middle] <= value ? low = middle : high = middle;
  }
  return value - list[low] <= list[high] - value ? low : high;
}
