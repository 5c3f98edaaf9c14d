// SPDX-License-Identifier: MIT
// Reads the file's data: blocks of compressed bytes in base64, see frames.cpp for how they are made.
'use strict';

const KIND = {
  vertex: 0,
  node: 1,
  obstacle: 2
};
// Codes of magnitudes: 512 an octave, 0 is zero.
const MAGNITUDES = Float32Array.from({length: 65536}, (_, code) => code ? 2 ** (code / 512 - 70) : 0);

async function inflate(id) {
  const element = document.getElementById(id);
  const text = atob(element.textContent.trim());
  element.remove();
  const packed = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) packed[i] = text.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Arrays one after the other, each as the lowest bytes of all its values, then the next ones.
class Reader {
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }
  take(Type, n) {
    const size = Type.BYTES_PER_ELEMENT, out = new Uint8Array(size * n);
    for (let k = 0; k < size; ++k)
      for (let i = 0; i < n; ++i) out[size * i + k] = this.bytes[this.at++];
    return new Type(out.buffer);
  }
  columns(Type, rows, n) {
    return Array.from({length: n}, () => this.take(Type, rows));
  }
  living(rows, n) {
    return {
      columns: this.columns(Int32Array, rows, n),
      birth: this.take(Int32Array, rows),
      death: this.take(Int32Array, rows)
    };
  }
}

function alive(rows, frame) {
  const {birth, death} = rows, out = [];
  for (let i = 0; i < birth.length; ++i)
    if (birth[i] <= frame && frame < death[i]) out.push(i);
  return Int32Array.from(out);
}

class Run {
  constructor(prefix = '') {
    this.prefix = prefix;
    this.meta = JSON.parse(document.getElementById(prefix + 'meta').textContent);
    this.dim = this.meta.dim;
    this.frames = this.meta.frames;
    this.decoded = new Map();
    this.meshes = new Map();
    const known = (list, where) => list.map((f, i) => ({...f, where, i}));
    this.stored = [...known(this.meta.vertex_fields, 'vertex'), ...known(this.meta.cell_fields, 'cell')];
    this.stored.forEach((f, i) => (f.largest = this.meta.largest[i], f.shown = this.meta.shown[i]));
  }

  // The scene's name of a unit of SI.
  unit(si) {
    return this.meta.units[si] ?? si;
  }

  async load() {
    const n = this.meta.counts, dim = this.dim;
    const [topology, steps, forces] =
        await Promise.all(['topology', 'steps', 'forces'].map(id => inflate(this.prefix + id)));
    const r = new Reader(topology);
    this.rest = r.columns(Float32Array, n.vertices, dim);
    this.vertices = r.living(n.vertices, 1);
    this.kind = this.vertices.columns[0];
    this.cells = r.living(n.cells, dim + 2);
    this.body = this.cells.columns[dim + 1];
    this.facets = r.living(n.facets, dim + 1);
    this.curved = r.living(n.curved, 3);
    const ids = this.obstacleIds = alive(this.vertices, 0).filter(v => this.kind[v] === KIND.obstacle);
    this.obstacleEdges = r.columns(Int32Array, n.obstacle_edges, 2).map(column => column.map(i => ids[i]));
    this.obstacleFaces = r.columns(Int32Array, n.obstacle_faces, 3).map(column => column.map(i => ids[i]));
    const linesOf = bytes => new TextDecoder().decode(bytes).split('\n').filter(Boolean);
    this.steps = linesOf(steps).map(line => JSON.parse(line));
    this.curves = curvesOf(linesOf(forces));
    return this;
  }

  // Ids of what a frame's mesh has; curved: the node of an edge by its key.
  mesh(frame) {
    const number = this.frames[frame].mesh;
    let mesh = this.meshes.get(number);
    if (mesh) return mesh;
    mesh = {
      number,
      vertices: alive(this.vertices, frame),
      cells: alive(this.cells, frame),
      facets: alive(this.facets, frame),
      curved: null
    };
    if (this.meta.counts.curved) {
      mesh.curved = new Map();
      const [a, b, node] = this.curved.columns;
      for (const e of alive(this.curved, frame)) mesh.curved.set(this.edgeKey(a[e], b[e]), node[e]);
    }
    if (this.meshes.size > 40) this.meshes.delete(this.meshes.keys().next().value);
    this.meshes.set(number, mesh);
    return mesh;
  }
  edgeKey(a, b) {
    return a < b ? a * this.meta.counts.vertices + b : b * this.meta.counts.vertices + a;
  }

  // Codes of a frame's displacements and fields, in the order of its mesh's ids.
  decode(index) {
    if (!this.decoded.has(index))
      this.decoded.set(index, inflate(`${this.prefix}frame${index}`).then(bytes => {
        const r = new Reader(bytes), mesh = this.mesh(index), {vertex_fields, cell_fields} = this.meta;
        const take = (ids, n) => r.columns(Uint16Array, ids.length, n);
        return {
          u: take(mesh.vertices, this.dim),
          vertex: take(mesh.vertices, vertex_fields.length),
          cell: take(mesh.cells, cell_fields.length)
        };
      }));
    return this.decoded.get(index);
  }

  async frame(index) {
    const codes = await this.decode(index);
    if (index + 1 < this.frames.length) this.decode(index + 1);
    return new Frame(this, index, codes);
  }
}

// A frame's mesh, displacements by id of vertex [m], and values of fields.
class Frame {
  constructor(run, index, codes) {
    Object.assign(this, {run, index, codes, ...run.frames[index], mesh: run.mesh(index)});
    const n = run.meta.counts.vertices, ids = this.mesh.vertices;
    this.u = codes.u.map((column, k) => {
      const out = new Float32Array(n), low = this.low[k], scale = (this.high[k] - low) / 65535;
      for (let i = 0; i < ids.length; ++i) out[ids[i]] = low + scale * column[i];
      return out;
    });
  }

  // Positions by id, a row of three each [m], from the origin; deformed times a factor.
  positions(factor) {
    const {run, u} = this, n = run.meta.counts.vertices, x = new Float32Array(3 * n);
    for (let k = 0; k < run.dim; ++k) {
      const rest = run.rest[k], of = u[k];
      for (const id of this.mesh.vertices) x[3 * id + k] = rest[id] + factor * of[id];
    }
    if (factor !== 1)
      for (const id of run.obstacleIds)
        for (let k = 0; k < run.dim; ++k) x[3 * id + k] = run.rest[k][id] + u[k][id];
    return x;
  }

  spread(codes, ids, n) {
    const out = new Float32Array(n);
    for (let i = 0; i < ids.length; ++i) out[ids[i]] = MAGNITUDES[codes[i]];
    return out;
  }

  // {of: 'vertex' or 'cell', values by id}
  field(name) {
    const {run, mesh} = this, counts = run.meta.counts, stored = run.stored.find(f => f.name === name);
    if (stored && stored.where === 'vertex')
      return {of: 'vertex', values: this.spread(this.codes.vertex[stored.i], mesh.vertices, counts.vertices)};
    if (stored) return {of: 'cell', values: this.spread(this.codes.cell[stored.i], mesh.cells, counts.cells)};
    if (name === 'u') {
      const values = new Float32Array(counts.vertices), [a, b, c] = this.u;
      for (const id of mesh.vertices) values[id] = Math.hypot(a[id], b[id], c ? c[id] : 0);
      return {of: 'vertex', values};
    }
    const values = new Float32Array(counts.cells), corners = run.cells.columns.slice(0, run.dim + 1);
    const x = name === 'J' || name === 'body' ? null : this.positions(1);
    const measure = {
      body: c => run.body[c],
      J: c => volume(run, c, (k, id) => run.rest[k][id] + this.u[k][id]) / volume(run, c, (k, id) => run.rest[k][id]),
      size: c => longestEdge(x, corners, c),
      quality: c => quality(run.dim, x, corners, c),
      order: c => 1 + curvedEdges(run, mesh, corners, c) / (run.dim * (run.dim + 1) / 2),
    }[name];
    for (const c of mesh.cells) values[c] = measure(c);
    return {of: 'cell', values};
  }
}

// Curves in lines of forces.csv: by name, times and the values of each column after it.
function curvesOf([header, ...lines]) {
  const curves = new Map(), columns = (header ?? '').split(',').slice(3);
  for (const line of lines) {
    const [, t, name, ...values] = line.split(',');
    if (!curves.has(name)) curves.set(name, {times: [], ...Object.fromEntries(columns.map(c => [c, []]))});
    curves.get(name).times.push(Number(t));
    columns.forEach((c, k) => curves.get(name)[c].push(Number(values[k])));
  }
  return curves;
}

function volume(run, c, at) {
  const d = run.dim, v = run.cells.columns, m = [];
  for (let i = 1; i <= d; ++i)
    for (let k = 0; k < d; ++k) m.push(at(k, v[i][c]) - at(k, v[0][c]));
  if (d === 2) return (m[0] * m[3] - m[1] * m[2]) / 2;
  return (m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6])) / 6;
}

function edgeSquares(x, corners, c) {
  const out = [];
  for (let i = 0; i < corners.length; ++i)
    for (let j = 0; j < i; ++j) {
      const a = 3 * corners[i][c], b = 3 * corners[j][c];
      out.push((x[a] - x[b]) ** 2 + (x[a + 1] - x[b + 1]) ** 2 + (x[a + 2] - x[b + 2]) ** 2);
    }
  return out;
}

function longestEdge(x, corners, c) {
  return Math.sqrt(Math.max(...edgeSquares(x, corners, c)));
}

// Volume by the mean square of edges, 1 for the regular simplex.
function quality(dim, x, corners, c) {
  const sum = edgeSquares(x, corners, c).reduce((a, b) => a + b, 0);
  const p = corners.map(column => [0, 1, 2].map(k => x[3 * column[c] + k]));
  const minus = (a, b) => a.map((value, k) => value - b[k]);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const a = minus(p[1], p[0]), b = minus(p[2], p[0]), n = cross(a, b);
  if (dim === 2) return 2 * Math.sqrt(3) * n[2] / sum;
  const d = minus(p[3], p[0]), six = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
  return 12 * Math.sign(six) * (Math.abs(six) / 2) ** (2 / 3) / sum;
}

function curvedEdges(run, mesh, corners, c) {
  let n = 0;
  if (mesh.curved)
    for (let i = 0; i < corners.length; ++i)
      for (let j = 0; j < i; ++j) n += mesh.curved.has(run.edgeKey(corners[i][c], corners[j][c]));
  return n;
}
