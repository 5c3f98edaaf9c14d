// SPDX-License-Identifier: MIT
// The view of a run with its controls and its link.
'use strict';

const FIELD_LABELS = {
  elastic_density: 'elastic energy density',
  von_mises: 'von Mises stress',
  u: 'displacement |u|',
  v: 'velocity |v|',
  gap: 'gap, to other bodies and obstacles',
  contact_force: 'contact force',
  friction_force: 'friction force',
  reaction_force: 'reaction force',
  quality: 'quality of cells',
  size: 'longest edge of cells',
  J: 'volume ratio J',
  body: 'body',
  order: 'order (1 to 2)',
};
const EDITS = [
  ['new', '#0a8f3c', 'new vertices'], ['gone', '#d0021b', 'collapsed vertices'], ['swapped', '#1f5fd0', 'cells of swaps'],
  ['curved', '#8e2bbf', 'edges curved'], ['straight', '#c77c00', 'edges straightened']
];

class View {
  // extras: fields that are given, {label, unit, values} by name.
  constructor(run, {onChange = () => {}, camera, extras = {}, largestU = run.meta.largest_u} = {}) {
    Object.assign(this, {
      run,
      onChange,
      extras,
      largestU,
      meta: run.meta,
      dim: run.dim,
      playing: false,
      sharpness: 1,
      ready: Promise.resolve()
    });
    this.camera = camera ?? new Camera(run.dim);
    this.state = {
      frame: run.frames.length - 1,
      field: 'elastic_density',
      log: false,
      least: null,
      most: null,
      factor: 1,
      edges: true,
      obstacles: true,
      edits: false,
      axis: '',
      cut: 0.5,
      flip: false,
      pick: null
    };
    if (!this.fields().includes(this.state.field)) this.state.field = this.fields()[0];
    const relative = list => [0, 1, 2].map(k => (list[k] ?? 0) - (run.meta.origin[k] ?? 0));
    this.low = relative(run.meta.low);
    this.high = relative(run.meta.high);
    this.home = {
      ...new Camera(run.dim),
      target: this.low.map((l, k) => (l + this.high[k]) / 2)
    };
    if (!camera || !camera.isPlaced) Object.assign(this.camera, this.home, {isPlaced: true});
    this.found = {};  // ranges of what is computed here, by field
    this.build();
    this.painter = new Painter(this.canvas);
    this.bodies = new Triangles();
    this.buffer = this.painter.buffers();
    this.obstacles = new Triangles();
    this.obstacleBuffer = this.painter.buffers();
    this.lineBuffer = this.painter.buffers();
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(this.stage);
  }

  fields() {
    const {run} = this, curved = run.meta.counts.curved ? ['order'] : [];
    return [
      ...run.stored.filter(f => f.where === 'cell').map(f => f.name), 'u',
      ...run.stored.filter(f => f.where === 'vertex').map(f => f.name), 'J', 'quality', 'size', ...curved, 'body',
      ...Object.keys(this.extras)
    ];
  }
  label(name) {
    return this.extras[name]?.label ?? FIELD_LABELS[name] ?? name;
  }
  valuesOf(name) {
    return this.extras[name]?.values ?? this.frame.field(name);
  }
  unit(name) {
    const length = this.run.unit('m'), unit = this.extras[name]?.unit ?? {u: length, size: length}[name] ??
        this.run.stored.find(f => f.name === name)?.unit;
    return (unit ?? '').replace('^2', '²').replace('^3', '³');
  }

  build() {
    const {state, run} = this, isPair = 'difference' in this.extras, set = (key, value) => this.set({[key]: value});
    this.canvas = html('canvas', {tabIndex: 0});
    this.over = html('canvas', {className: 'over'});
    this.legend = html('div', {className: 'legend'});
    this.made = html('div', {className: 'made', hidden: true});
    this.stage = html('div', {className: 'stage'}, this.canvas, this.over, this.legend, this.made);
    const check = (key, title) => {
      const input = html('input', {type: 'checkbox', checked: state[key], onchange: () => set(key, input.checked)});
      this.inputs[key] = input;
      return html('label', {}, input, title);
    };
    const labelled = (title, ...inputs) => html('label', {}, html('span', {}, title), ...inputs);
    const number = (key, title) => {
      const input = html('input', {
        type: 'number',
        step: 'any',
        title,
        placeholder: title,
        onchange: () => set(key, input.value === '' ? null : Number(input.value))
      });
      return this.inputs[key] = input;
    };
    this.inputs = {};
    const field = this.inputs.field = html(
        'select', {onchange: () => this.set({field: field.value, least: null, most: null})},
        ...this.fields().map(name => html('option', {value: name}, this.label(name))));
    const factor = this.inputs.factor =
        html('input', {type: 'number', step: 'any', onchange: () => set('factor', Number(factor.value))});
    const axis = this.inputs.axis = html(
        'select', {onchange: () => set('axis', axis.value)},
        ...[['', 'none'], ['x', 'across x'], ['y', 'across y'], ['z', 'across z']].map(
            ([value, text]) => html('option', {value}, text)));
    const cut = this.inputs.cut =
        html('input', {type: 'range', min: 0, max: 1, step: 0.002, oninput: () => set('cut', Number(cut.value))});
    const views = [['x', 90, 0], ['y', 0, 90], ['z', 0, 0]].map(
        ([name, azimuth, elevation]) =>
            html('button', {title: `look along ${name}`, onclick: () => this.look({azimuth, elevation})}, name));
    this.pickText = html('div', {className: 'pick'}, 'Click on the body for ids and values.');
    const link = html('button', {onclick: () => this.copyLink(link)}, 'copy link');
    this.side = html(
        'div', {className: 'side'}, labelled('colour', field), check('log', 'logarithmic'),
        labelled('from, to', number('least', 'least'), number('most', 'most')), html('hr'), labelled('deform ×', factor),
        check('edges', 'edges of cells'), check('obstacles', 'obstacles'),
        ...(isPair ? [] : [check('edits', 'edits of remeshing')]),
        ...(this.dim === 3 ? [html('hr'), labelled('cut', axis), labelled('at', cut), check('flip', 'other side')] : []),
        html('hr'),
        html(
            'label', {className: 'many'}, html('button', {onclick: () => this.look(this.home), title: 'key f'}, 'fit'),
            ...(this.dim === 3 ? views : []), ...(isPair ? [] : [link]),
            html('button', {onclick: () => this.savePicture()}, 'PNG')),
        html('hr'), this.pickText);
    this.slider = html('input', {
      type: 'range',
      min: 0,
      max: run.frames.length - 1,
      step: 1,
      oninput: () => set('frame', Number(this.slider.value))
    });
    this.playButton = html('button', {onclick: () => this.play(!this.playing), title: 'space'}, '▶');
    this.time = html('output');
    const step = by => () => set('frame', state.frame + by);
    this.root = html(
        'div', {className: 'run'}, this.stage, this.side,
        html(
            'div', {className: 'time'}, this.playButton, html('button', {onclick: step(-1), title: ','}, '‹'),
            html('button', {onclick: step(1), title: '.'}, '›'), this.slider, this.time));
    this.listen();
  }

  // Changes what is shown; resolves when it is seen.
  set(changes) {
    const {run} = this;
    if ('frame' in changes) changes.frame = Math.min(Math.max(Math.round(changes.frame) || 0, 0), run.frames.length - 1);
    Object.assign(this.state, changes);
    this.showInputs();
    this.onChange(this);
    return this.ready = this.update();
  }

  showInputs() {
    for (const [key, input] of Object.entries(this.inputs))
      input.type === 'checkbox' ? input.checked = this.state[key] : input.value = this.state[key] ?? '';
    this.slider.value = this.state.frame;
    const f = this.run.frames[this.state.frame];
    const time = `t = ${shortNumber(f.t)} ${this.run.unit('s')}`;
    this.time.textContent = `${time} · step ${f.step} · ${f.vertices} vertices · ${f.cells} cells`;
  }

  // One update after another; what was asked for meanwhile is done at once at the end.
  update() {
    if (!this.running)
      this.running = (async () => {
        do {
          this.isStale = false;
          await this.prepare();
        } while (this.isStale);
        this.running = null;
      })();
    else
      this.isStale = true;
    return this.running;
  }

  async prepare() {
    const {state, run} = this;
    if (!this.frame || this.frame.index !== state.frame) this.frame = await run.frame(state.frame);
    const frame = this.frame;
    this.x = frame.positions(state.factor);
    const field = this.field = this.valuesOf(state.field);
    const [least, most] = this.range = this.rangeOf(field);
    const share = state.log ? v => v > 0 ? Math.max(Math.log(v / least) / Math.log(most / least), 0) : 0 :
                              v => Math.max((v - least) / (most - least), 0);
    this.cutPlane = this.plane();
    triangles(this.bodies, frame, this.x, field, share, this.cutPlane);
    this.isOutward ??= this.dim === 3 && enclosedVolume(this.bodies) > 0;  // then the back of facets is never seen
    this.painter.upload(this.buffer, this.bodies);
    this.prepareObstacles();
    this.edits = state.edits ? await this.findEdits() : null;
    this.showLegend();
    this.showPick();
    this.draw();
  }

  prepareObstacles() {
    const {run, x} = this, [a, b, c] = run.obstacleFaces, [e0, e1] = run.obstacleEdges, out = this.obstacles;
    out.count = 0;
    for (let i = 0; i < a.length; ++i) out.add(x, a[i], b[i], c[i], 0, 0, 0, -1, 7, null);
    this.painter.upload(this.obstacleBuffer, out);
    if (a.length) return this.lineBuffer.count = 0;
    const n = e0.length, lines = {
      count: 0,
      place: new Float32Array(9 * n),
      share: new Float32Array(3 * n),
      corner: new Uint8Array(12 * n).fill(255),
      normal: new Float32Array(9 * n)
    };
    for (let i = 0; i < n; ++i)
      for (let k = 0; k < 3; ++k) lines.place[6 * i + k] = x[3 * e0[i] + k], lines.place[6 * i + 3 + k] = x[3 * e1[i] + k];
    lines.count = n;
    this.painter.upload(this.lineBuffer, lines);
    this.lineBuffer.count = 2 * n;
  }

  // Fixed over time: of all frames where the file says it, else of those seen so far.
  rangeOf(field) {
    const {state, run} = this, name = state.field, stored = run.stored.find(f => f.name === name);
    let range = stored              ? [0, stored.shown || stored.largest] :
        field.largest !== undefined ? [0, field.largest] :
                                      {u: [0, this.largestU], quality: [0, 1], order: [1, 2], ...run.meta.ranges}[name];
    if (!range) {
      const seen = this.found[name] ??= [Infinity, -Infinity];
      for (const c of this.frame.mesh.cells) {
        seen[0] = Math.min(seen[0], field.values[c]);
        seen[1] = Math.max(seen[1], field.values[c]);
      }
      range = [...seen];
    }
    if (state.log && !(range[0] > 0)) range = [1e-4 * range[1], range[1]];
    range = [state.least ?? range[0], state.most ?? range[1]];
    return range[1] > range[0] ? range : [range[0], range[0] + (Math.abs(range[0]) || 1)];
  }

  // Normal, height, size of the scene; null: no cut.
  plane() {
    const k = 'xyz'.indexOf(this.state.axis);
    if (this.dim === 2 || this.state.axis === '') return null;
    const n = [0, 0, 0], sign = this.state.flip ? -1 : 1, room = 1e-3 * (this.high[k] - this.low[k]);
    n[k] = sign;
    const at = this.low[k] - room + this.state.cut * (this.high[k] - this.low[k] + 2 * room);
    return [...n, sign * at, Math.hypot(...this.high.map((h, i) => h - this.low[i]))];
  }

  isCutAway(p) {
    const cut = this.cutPlane;
    return cut && cut[0] * p[0] + cut[1] * p[1] + cut[2] * p[2] > cut[3] + 1e-6 * cut[4];
  }

  // Finds cells and edges that came and went between the stored frame before and this one.
  async findEdits() {
    const {run, state} = this, f = state.frame, found = {new: [], gone: [], swapped: [], curved: [], straight: []};
    let locator = null;
    const whereNow = (id, old) => {  // of what is no more: where its material is
      locator ??= new Locator(this.frame);
      const rest = run.rest.map(column => column[id]), u = locator.displacement(rest);
      return u ? [0, 1, 2].map(k => k < run.dim ? rest[k] + state.factor * u[k] : 0) : at(old, [id]);
    };
    if (f === 0 || run.frames[f].mesh === run.frames[f - 1].mesh) return found;
    const before = await run.frame(f - 1), old = before.positions(state.factor), {vertices, cells, kind, curved} = run;
    const corners = cells.columns.slice(0, run.dim + 1),
          at = (x, ids) => [0, 1, 2].map(k => ids.reduce((sum, id) => sum + x[3 * id + k], 0) / ids.length);
    for (const id of this.frame.mesh.vertices)
      if (vertices.birth[id] === f && kind[id] === KIND.vertex) found.new.push(at(this.x, [id]));
    for (const id of before.mesh.vertices)
      if (vertices.death[id] === f && kind[id] === KIND.vertex) found.gone.push(whereNow(id, old));
    // A new cell of vertices that were there comes from a swap, but where a vertex is gone beside it.
    const besideGone = new Set();
    for (const c of before.mesh.cells) {
      const ids = corners.map(column => column[c]);
      if (cells.death[c] === f && ids.some(id => vertices.death[id] === f)) ids.forEach(id => besideGone.add(id));
    }
    for (const c of this.frame.mesh.cells) {
      if (cells.birth[c] !== f) continue;
      const ids = corners.map(column => column[c]);
      if (ids.some(id => vertices.birth[id] === f) || ids.filter(id => besideGone.has(id)).length >= run.dim) continue;
      found.swapped.push(at(this.x, ids));
    }
    const had = before.mesh.curved, has = this.frame.mesh.curved;
    if (has)
      for (const [key, node] of has)
        if (!had?.has(key)) found.curved.push(at(this.x, [node]));
    if (had)
      for (const [key, node] of had)
        if (!has?.has(key)) found.straight.push(whereNow(node, old));
    return found;
  }

  // Gives back what browsers have few of.
  close() {
    this.playing = false;
    this.observer.disconnect();
    this.painter.gl.getExtension('WEBGL_lose_context')?.loseContext();
  }

  resize() {
    const box = this.stage.getBoundingClientRect(), ratio = Math.min(window.devicePixelRatio || 1, 2) * this.sharpness;
    this.width = box.width;
    this.height = box.height;
    for (const canvas of [this.canvas, this.over]) {
      canvas.width = Math.max(1, Math.round(box.width * ratio));
      canvas.height = Math.max(1, Math.round(box.height * ratio));
    }
    if (this.field) this.draw();
  }

  // Pixels a metre: all of the bodies' way fits in.
  scale() {
    const {right, up} = new Camera(this.dim).axes(),
                  size = this.high.map((h, k) => h - this.low[k]);
    const extent = axis =>
        Math.max(size.reduce((sum, s, k) => sum + s * Math.abs(axis[k]), 0), 1e-12 * Math.hypot(...size), 1e-300);
    return 0.92 * Math.min(this.width / extent(right), this.height / extent(up)) * this.camera.zoom;
  }

  sharpen(sharpness) {
    this.sharpness = sharpness;
    this.resize();
  }

  draw() {
    if (!this.width || !this.field) return;
    const {painter, state, camera, canvas} = this, cut = this.cutPlane;
    if (!this.radius) {
      let most = Math.hypot(...this.high.map((h, i) => h - this.low[i]));
      for (const id of this.run.obstacleIds)
        most = Math.max(most, Math.hypot(...[0, 1, 2].map(k => this.x[3 * id + k] - this.home.target[k])));
      this.radius = most;
    }
    const away = Math.hypot(...camera.target.map((t, k) => t - this.home.target[k])),
          factor = Math.max(1, Math.abs(state.factor));
    const light = [0, 0, 0], {right, up, forward} = camera.axes();
    if (this.dim === 3)
      for (let k = 0; k < 3; ++k) light[k] = 0.25 * right[k] + 0.45 * up[k] + 0.86 * forward[k];
    this.matrix = camera.matrix(this.scale(), this.width, this.height, 2 * factor * this.radius + away);
    painter.begin(canvas.width, canvas.height, this.matrix, light);
    painter.draw(this.buffer, {cut, edges: state.edges ? 0.6 : 0, isClosed: this.isOutward && !cut, mark: true});
    if (state.obstacles) {
      const obstacle = {flat: [0.95, 0.955, 0.97], edges: state.edges ? 0.25 : 0};
      painter.draw(this.obstacleBuffer, {...obstacle, over: 'rest'});
      painter.draw(this.obstacleBuffer, {...obstacle, over: 'marked', opacity: 0.25});
      if (this.dim === 3) painter.draw(this.lineBuffer, {flat: [0.2, 0.22, 0.26], lines: true});
    }
    this.drawOver();
  }

  // Page pixels of a point, from the stage's corner, and its depth.
  project(p) {
    const m = this.matrix, at = [0, 1, 2].map(row => m[row] * p[0] + m[4 + row] * p[1] + m[8 + row] * p[2] + m[12 + row]);
    return [(at[0] + 1) / 2 * this.width, (1 - at[1]) / 2 * this.height, at[2]];
  }

  drawOver() {
    const context = this.over.getContext('2d'), ratio = this.over.width / this.width;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, this.width, this.height);
    const dot = (p, radius, colour) => {
      const [x, y] = this.project(p);
      context.beginPath();
      context.arc(x, y, radius, 0, 7);
      context.fillStyle = colour;
      context.fill();
      context.strokeStyle = '#fff';
      context.lineWidth = 0.7;
      context.stroke();
    };
    if (this.edits)
      for (const [kind, colour] of EDITS)
        for (const p of this.edits[kind])
          if (!this.isCutAway(p)) dot(p, 3, colour);
    if (this.dim === 2 && this.state.obstacles) {
      const [from, to] = this.run.obstacleEdges;
      context.strokeStyle = '#33383f';
      context.lineWidth = 1.5;
      context.beginPath();
      for (let i = 0; i < from.length; ++i) {
        context.moveTo(...this.project(this.x.subarray(3 * from[i], 3 * from[i] + 3)).slice(0, 2));
        context.lineTo(...this.project(this.x.subarray(3 * to[i], 3 * to[i] + 3)).slice(0, 2));
      }
      context.stroke();
    }
    const pick = this.state.pick;
    if (pick && this.isThere(pick)) {
      const [x, y] = this.project([0, 1, 2].map(k => this.x[3 * pick.vertex + k]));
      context.strokeStyle = '#e6007a';
      context.lineWidth = 2;
      context.beginPath();
      context.arc(x, y, 6, 0, 7);
      context.stroke();
    }
    const {right, up} = this.camera.axes();
    ['x', 'y', 'z'].slice(0, this.dim).forEach((name, k) => {
      const dx = 26 * right[k], dy = -26 * up[k], x0 = 34, y0 = this.height - 34;
      context.strokeStyle = context.fillStyle = ['#c0392b', '#27862f', '#2a5bc7'][k];
      context.lineWidth = 1.5;
      context.beginPath();
      context.moveTo(x0, y0);
      context.lineTo(x0 + dx, y0 + dy);
      context.stroke();
      context.font = '11px system-ui, sans-serif';
      context.fillText(name, x0 + 1.25 * dx - 3, y0 + 1.25 * dy + 4);
    });
  }

  showLegend() {
    const {state, range, meta} = this, unit = this.unit(state.field), name = this.label(state.field);
    const [low, high] = range, at = s => state.log ? low * (high / low) ** s : low + s * (high - low);
    const stored = this.run.stored.find(f => f.name === state.field),
          isExceeded = state.most === null && stored && high < stored.largest, shares = [1, 0.75, 0.5, 0.25, 0];
    const marks = marksOf(shares.map(at));
    if (isExceeded) marks[0] = '≥ ' + marks[0];
    const stops = COLOURS.map(c => `rgb(${c})`).join(',');
    this.legend.replaceChildren(
        html('b', {}, unit ? `${name} [${unit}]` : name),
        html('div', {className: 'bar', style: `background:linear-gradient(to top,${stops})`}),
        html(
            'div', {className: 'marks', title: isExceeded ? `the largest is ${shortNumber(stored.largest)}` : ''},
            ...marks.map(mark => html('span', {}, mark))));
    this.made.hidden = !this.edits;
    if (!this.edits) return;
    const [now, before] = [this.run.frames[state.frame], this.run.frames[state.frame - 1]];
    const steps = this.run.steps.filter(s => before && s.step > before.step && s.step <= now.step),
          gain = steps.reduce((sum, s) => sum + gainOf(s), 0);
    this.made.replaceChildren(
        ...EDITS.filter(([kind]) => this.edits[kind].length)
            .map(
                ([kind, colour, title]) =>
                    html('div', {}, html('i', {style: `background:${colour}`}), `${this.edits[kind].length} ${title}`)),
        before ? `${now.step === before.step + 1 ? 'Step' : `Steps ${before.step + 1} to`} ${now.step}: energy lower by ${
                     shortNumber(gain)} J` :
                 'The first frame: nothing before it');
  }

  isThere(pick) {
    const {vertices} = this.run, f = this.state.frame;
    return vertices.birth[pick.vertex] <= f && f < vertices.death[pick.vertex];
  }

  // Picks at a point of the stage: {cell, vertex}, ids of the run that stay from frame to frame; null: nothing.
  pickAt(px, py) {
    const t = this.bodies, m = this.matrix, p = t.place, cut = this.cutPlane;
    let best = Infinity, found = null;
    // In clip coordinates first, as most triangles are elsewhere.
    const cx = 2 * px / this.width - 1, cy = 1 - 2 * py / this.height;
    const isBeside = (i, row, value) => {
      const along = k => m[row] * p[k] + m[4 + row] * p[k + 1] + m[8 + row] * p[k + 2] + m[12 + row] - value;
      const a = along(9 * i), b = along(9 * i + 3), c = along(9 * i + 6);
      return a < 0 && b < 0 && c < 0 || a > 0 && b > 0 && c > 0;
    };
    for (let i = 0; i < t.count; ++i) {
      if (isBeside(i, 0, cx) || isBeside(i, 1, cy)) continue;
      const c = [0, 1, 2].map(k => this.project(p.subarray(9 * i + 3 * k, 9 * i + 3 * k + 3)));
      const area = (c[1][0] - c[0][0]) * (c[2][1] - c[0][1]) - (c[1][1] - c[0][1]) * (c[2][0] - c[0][0]);
      if (!area) continue;
      const w1 = ((px - c[0][0]) * (c[2][1] - c[0][1]) - (py - c[0][1]) * (c[2][0] - c[0][0])) / area;
      const w2 = ((c[1][0] - c[0][0]) * (py - c[0][1]) - (c[1][1] - c[0][1]) * (px - c[0][0])) / area,
            w = [1 - w1 - w2, w1, w2];
      if (w.some(v => v < 0)) continue;
      const depth = w[0] * c[0][2] + w[1] * c[1][2] + w[2] * c[2][2];
      if (depth >= best) continue;
      const height = k => w[0] * p[9 * i + k] + w[1] * p[9 * i + 3 + k] + w[2] * p[9 * i + 6 + k];
      if (cut && cut[0] * height(0) + cut[1] * height(1) + cut[2] * height(2) > cut[3]) continue;
      best = depth;
      const nodes = t.nodes.subarray(3 * i, 3 * i + 3), distance = [...nodes].map(id => {
        const [x, y] = this.project(this.x.subarray(3 * id, 3 * id + 3));
        return Math.hypot(x - px, y - py);
      });
      found = {cell: t.cell[i], vertex: nodes[distance.indexOf(Math.min(...distance))]};
    }
    return found;
  }

  showPick() {
    const {state, run, frame} = this, pick = state.pick;
    if (!pick) return this.pickText.textContent = 'Click on the body for ids and values.';
    if (!this.isThere(pick)) return this.pickText.textContent = `vertex ${pick.vertex} is not in this frame`;
    const {vertex} = pick,
          point = column => column.map((of, k) => shortNumber(Number((of + run.meta.origin[k]).toPrecision(7)))).join(', ');
    const lines = [
      `vertex ${vertex}`, `  rest  ${point(run.rest.map(c => c[vertex]))} ${run.unit('m')}`,
      `  now   ${point(run.rest.map((c, k) => c[vertex] + frame.u[k][vertex]))} ${run.unit('m')}`
    ];
    const show = (of, id) => {
      for (const name of this.fields()) {
        const values = this.valuesOf(name);
        if (values.of === of)
          lines.push(`  ${this.label(name)}  ${shortNumber(Number(values.values[id].toPrecision(3)))} ${this.unit(name)}`);
      }
    };
    show('vertex', vertex);
    const {birth, death} = run.cells, f = state.frame, isThere = birth[pick.cell] <= f && f < death[pick.cell];
    lines.push('', `cell ${pick.cell}${isThere ? '' : ' is not in this frame'}`);
    if (isThere) {
      lines.push(`  vertices  ${run.cells.columns.slice(0, this.dim + 1).map(c => c[pick.cell]).join(' ')}`);
      show('cell', pick.cell);
      lines.push(`  there from step ${run.frames[birth[pick.cell]].step}${
          death[pick.cell] < run.frames.length ? ` to ${run.frames[death[pick.cell] - 1].step}` : ''}`);
    }
    this.pickText.textContent = lines.join('\n');
  }

  look(camera) {
    Object.assign(this.camera, camera);
    this.camera.target = [...this.camera.target];
    this.draw();
    this.onChange(this);
  }

  pan(dx, dy) {
    const {right, up} = this.camera.axes(), scale = this.scale();
    this.look({target: this.camera.target.map((t, k) => t - (dx * right[k] - dy * up[k]) / scale)});
  }
  turn(dx, dy) {
    if (this.dim === 2) return this.pan(dx, dy);
    this.look(
        {azimuth: this.camera.azimuth - 0.4 * dx, elevation: Math.min(Math.max(this.camera.elevation + 0.4 * dy, -90), 90)});
  }
  zoomAt(factor, px = this.width / 2, py = this.height / 2) {
    const dx = px - this.width / 2, dy = py - this.height / 2;
    this.pan(-dx, -dy);
    this.camera.zoom = Math.min(Math.max(this.camera.zoom * factor, 1e-3), 1e6);
    this.pan(dx, dy);
  }

  listen() {
    const {canvas} = this, down = new Map();
    let travel = 0;
    const middle =
        () => [...down.values()].reduce((sum, p) => [sum[0] + p[0] / down.size, sum[1] + p[1] / down.size], [0, 0]);
    const spread = () => {
      const [a, b] = [...down.values()];
      return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
    };
    canvas.addEventListener('pointerdown', e => {
      canvas.setPointerCapture(e.pointerId);
      down.set(e.pointerId, [e.offsetX, e.offsetY]);
      if (down.size === 1) travel = 0;
      canvas.focus({preventScroll: true});
    });
    canvas.addEventListener('pointermove', e => {
      if (!down.has(e.pointerId)) return;
      const [x, y] = middle(), before = spread();
      down.set(e.pointerId, [e.offsetX, e.offsetY]);
      const [nx, ny] = middle(), dx = nx - x, dy = ny - y;
      travel += Math.abs(dx) + Math.abs(dy) + Math.abs(spread() - before);
      if (travel < 4) return;
      if (down.size > 1) {
        this.pan(dx, dy);  // first, so that what is between the fingers stays there
        if (before) this.zoomAt(spread() / before, nx, ny);
      } else if (e.shiftKey || e.buttons & 6) {
        this.pan(dx, dy);
      } else {
        this.turn(dx, dy);
      }
    });
    const up = e => {
      const wasClick = down.size === 1 && travel < 4 && e.type === 'pointerup' && e.button === 0;
      down.delete(e.pointerId);
      if (wasClick && this.matrix) this.set({pick: this.pickAt(e.offsetX, e.offsetY)});
    };
    canvas.addEventListener('pointerup', up);
    canvas.addEventListener('pointercancel', up);
    canvas.addEventListener('contextmenu', e => e.preventDefault());
    canvas.addEventListener('wheel', e => {
      e.preventDefault();
      this.zoomAt(Math.exp(-0.0015 * e.deltaY), e.offsetX, e.offsetY);
    }, {passive: false});
    canvas.addEventListener('keydown', e => {
      if (e.ctrlKey || e.metaKey || e.altKey) return;
      const move = e.shiftKey ? (dx, dy) => this.pan(3 * dx, 3 * dy) : (dx, dy) => this.turn(dx, dy);
      const keys = {
        ' ': () => this.play(!this.playing),
        ',': () => this.set({frame: this.state.frame - 1}),
        '.': () => this.set({frame: this.state.frame + 1}),
        Home: () => this.set({frame: 0}),
        End: () => this.set({frame: this.run.frames.length - 1}),
        f: () => this.look(this.home),
        '+': () => this.zoomAt(1.25),
        '-': () => this.zoomAt(0.8),
        e: () => this.set({edits: !this.state.edits}),
        l: () => this.set({log: !this.state.log}),
        ArrowLeft: () => move(-12, 0),
        ArrowRight: () => move(12, 0),
        ArrowUp: () => move(0, -12),
        ArrowDown: () => move(0, 12),
      };
      const act = keys[e.key];
      if (act) e.preventDefault(), act();
    });
  }

  async play(on) {
    this.playing = on;
    this.playButton.textContent = on ? '❚❚' : '▶';
    const turn = this.playTurn = {};
    if (on && this.state.frame === this.run.frames.length - 1) await this.set({frame: 0});
    const pause = Math.max(1000 / 30, Math.min(200, 4000 / this.run.frames.length));
    let taken = pause, due = performance.now();
    while (this.playing && turn === this.playTurn && this.state.frame + 1 < this.run.frames.length) {
      const start = performance.now();
      await this.set({frame: this.state.frame + 1});
      due = Math.max(due + pause, start);  // a late frame is made up for by the next one
      do await new Promise(requestAnimationFrame);
      while (performance.now() < due - 5);
      // Where drawing is slow, pixels are larger while it plays.
      taken += 0.2 * (performance.now() - start - taken);
      if (taken > 1.3 * pause && this.sharpness > 0.5) this.sharpen(this.sharpness - 0.25), taken = pause;
    }
    if (this.sharpness < 1 && turn === this.playTurn) this.sharpen(1);
    if (turn === this.playTurn && this.playing) this.play(false);
    this.onChange(this);
  }

  // All that makes a view, for a link.
  toHash() {
    const {state, camera, run} = this, round = v => Number(v.toPrecision(6)), parts = {
      t: run.frames[state.frame].t,
      view: [camera.azimuth, camera.elevation, camera.zoom, ...camera.target.slice(0, this.dim)].map(round).join(','),
      field: state.field,
      log: state.log ? 1 : null,
      range: state.least === null && state.most === null ? null : `${state.least ?? ''},${state.most ?? ''}`,
      factor: state.factor === 1 ? null : state.factor,
      edges: state.edges ? null : 0,
      obstacles: state.obstacles ? null : 0,
      edits: state.edits ? 1 : null,
      cut: state.axis ? `${state.axis},${state.cut},${state.flip ? 1 : 0}` : null,
      pick: state.pick ? `${state.pick.cell},${state.pick.vertex}` : null,
    };
    return '#' + Object.entries(parts).filter(([, v]) => v !== null).map(([k, v]) => `${k}=${v}`).join('&');
  }

  fromHash(hash) {
    const parts =
        Object.fromEntries(hash.replace(/^#/, '').split('&').filter(Boolean).map(p => p.split('=').map(decodeURIComponent)));
    const {run} = this, changes = {}, list = text => text.split(',').map(v => v === '' ? null : Number(v));
    if (parts.t !== undefined) changes.frame = nearest(run.frames.map(f => f.t), Number(parts.t));
    if (this.fields().includes(parts.field)) changes.field = parts.field;
    if (parts.range) [changes.least, changes.most] = list(parts.range);
    if (parts.factor !== undefined && Number.isFinite(Number(parts.factor))) changes.factor = Number(parts.factor);
    for (const key of ['log', 'edges', 'obstacles', 'edits'])
      if (parts[key] !== undefined) changes[key] = parts[key] === '1';
    if (parts.cut) {
      const [axis, at, flip] = parts.cut.split(',');
      if ('xyz'.includes(axis)) Object.assign(changes, {axis, cut: Number(at), flip: flip === '1'});
    }
    if (parts.pick) {
      const [cell, vertex] = list(parts.pick), counts = run.meta.counts;
      if (cell >= 0 && cell < counts.cells && vertex >= 0 && vertex < counts.vertices) changes.pick = {cell, vertex};
    }
    if (parts.view) {
      const [azimuth, elevation, zoom, ...target] = list(parts.view);
      if ([azimuth, elevation, zoom, ...target].every(Number.isFinite) && target.length === this.dim)
        Object.assign(this.camera, {azimuth, elevation, zoom, target: [...target, 0].slice(0, 3)});
    }
    return this.set(changes);
  }

  async copyLink(button) {
    const address = location.href.replace(/#.*/, '') + this.toHash();
    try {
      await navigator.clipboard.writeText(address);
      button.textContent = 'copied';
    } catch {
      location.hash = this.toHash();
      button.textContent = 'see address';
    }
    setTimeout(() => button.textContent = 'copy link', 1500);
  }

  savePicture() {
    this.draw();
    const both = html('canvas', {width: this.canvas.width, height: this.canvas.height}), context = both.getContext('2d');
    context.drawImage(this.canvas, 0, 0);
    context.drawImage(this.over, 0, 0);
    both.toBlob(blob => html('a', {
                          href: URL.createObjectURL(blob),
                          download: `${this.meta.title}-${this.run.frames[this.state.frame].step}.png`
                        }).click());
  }
}
