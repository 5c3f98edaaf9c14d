// SPDX-License-Identifier: MIT
// Triangles of a frame, and how WebGL shows them.
'use strict';

// In variants, as software has to run them too: CUT, EDGES and FLAT (one colour).
const VERTEX_SHADER = `
in vec3 place; in float share; in vec4 corner; in vec3 normal;
uniform mat4 toClip;
uniform vec3 light;  // 0: none
uniform vec4 cut;
out float value; out vec3 weights; out float beyond; flat out float shine;
void main() {
  value = share;
  weights = corner.xyz;
  beyond = dot(cut.xyz, place) - cut.w;
  shine = light == vec3(0.0) ? 1.0 : 0.55 + 0.45 * abs(dot(normalize(normal), light));
  gl_Position = toClip * vec4(place, 1.0);
}`;

const FRAGMENT_SHADER = `
precision highp float;
in float value; in vec3 weights; in float beyond; flat in float shine;
uniform sampler2D colours;
uniform vec3 flatColour;
uniform float edges;   // how dark
uniform float opacity;
out vec4 colour;
void main() {
#ifdef CUT
  if (beyond > 0.0) discard;
#endif
#ifdef FLAT
  vec3 base = shine * flatColour;
#else
  vec3 base = shine * texture(colours, vec2(value, 0.5)).rgb;
#endif
#ifdef EDGES
  vec3 width = fwidth(weights), far = weights / max(width, vec3(1e-6));
  float fade = clamp(0.22 / max(max(width.x, width.y), width.z), 0.15, 1.0);
  base *= 1.0 - edges * fade * (1.0 - smoothstep(0.35, 1.25, min(min(far.x, far.y), far.z)));
#endif
  colour = vec4(base, opacity);
}`;

// Corners of triangles: places (3 numbers), share of the colours, weights (4 bytes, 0 on the edge that is drawn).
class Triangles {
  constructor(capacity = 1024) {
    this.count = 0;
    this.grow(capacity);
  }
  grow(n) {
    const larger = (array, Type, length) => {
      const out = new Type(length);
      if (array) out.set(array);
      return out;
    };
    this.capacity = n;
    this.place = larger(this.place, Float32Array, 9 * n);
    this.share = larger(this.share, Float32Array, 3 * n);
    this.corner = larger(this.corner, Uint8Array, 12 * n);
    this.normal = larger(this.normal, Float32Array, 9 * n);
    this.cell = larger(this.cell, Int32Array, n);
    this.nodes = larger(this.nodes, Int32Array, 3 * n);
  }
  // mask: bit k: the edge opposite of corner k is drawn.
  add(p, i, j, k, a, b, c, cell, mask, nodes) {
    if (this.count === this.capacity) this.grow(2 * this.capacity);
    const t = this.count++, q = this.place, at = 9 * t;
    q[at] = p[3 * i];
    q[at + 1] = p[3 * i + 1];
    q[at + 2] = p[3 * i + 2];
    q[at + 3] = p[3 * j];
    q[at + 4] = p[3 * j + 1];
    q[at + 5] = p[3 * j + 2];
    q[at + 6] = p[3 * k];
    q[at + 7] = p[3 * k + 1];
    q[at + 8] = p[3 * k + 2];
    const ax = q[at + 3] - q[at], ay = q[at + 4] - q[at + 1], az = q[at + 5] - q[at + 2];
    const bx = q[at + 6] - q[at], by = q[at + 7] - q[at + 1], bz = q[at + 8] - q[at + 2], m = this.normal;
    m[at] = m[at + 3] = m[at + 6] = ay * bz - az * by;
    m[at + 1] = m[at + 4] = m[at + 7] = az * bx - ax * bz;
    m[at + 2] = m[at + 5] = m[at + 8] = ax * by - ay * bx;
    this.share[3 * t] = a;
    this.share[3 * t + 1] = b;
    this.share[3 * t + 2] = c;
    const w = this.corner, o = 12 * t;
    for (let e = 0; e < 3; ++e) {
      const hidden = mask >> e & 1 ? 0 : 255;
      w[o + e] = hidden;
      w[o + 4 + e] = hidden;
      w[o + 8 + e] = hidden;
      w[o + 4 * e + e] = 255;
    }
    this.cell[t] = cell;
    this.nodes[3 * t] = nodes ? nodes[0] : i;
    this.nodes[3 * t + 1] = nodes ? nodes[1] : j;
    this.nodes[3 * t + 2] = nodes ? nodes[2] : k;
  }
}

const PARTS = 6;  // into which a curved edge is drawn

// The weights of the last triangle's corners in the facet that it is a part of: lines go on from part to part.
function weigh(out, ...corners) {
  corners.forEach((l, c) => l.forEach((w, k) => out.corner[12 * (out.count - 1) + 4 * c + k] = Math.round(255 * w)));
}

// Adds a facet with curved edges in straight parts; nodes: of the edges opposite of its corners, -1 where straight.
function addCurved(out, x, v, node, shares, cell) {
  const p = new Float32Array(3 * (PARTS + 1) * (PARTS + 2) / 2), s = [], index = [], all = [];
  let n = 0;
  for (let i = 0; i <= PARTS; ++i) {
    index.push([]);
    for (let j = 0; j <= PARTS - i; ++j, ++n) {
      const l = [1 - (i + j) / PARTS, i / PARTS, j / PARTS];
      const weight = [...l], ofNode = [0, 0, 0];
      for (let e = 0; e < 3; ++e) {
        if (node[e] < 0) continue;
        const a = (e + 1) % 3, b = (e + 2) % 3, product = l[a] * l[b];
        ofNode[e] = 4 * product;
        weight[a] -= 2 * product;
        weight[b] -= 2 * product;
      }
      for (let k = 0; k < 3; ++k) {
        let sum = 0;
        for (let e = 0; e < 3; ++e) {
          sum += weight[e] * x[3 * v[e] + k];
          if (node[e] >= 0) sum += ofNode[e] * x[3 * node[e] + k];
        }
        p[3 * n + k] = sum;
      }
      let share = 0;
      for (let e = 0; e < 3; ++e) share += weight[e] * shares[e] + (node[e] >= 0 ? ofNode[e] * shares[3 + e] : 0);
      s.push(share);
      index[i].push(n);
      all.push(l);
    }
  }
  for (let i = 0; i < PARTS; ++i)
    for (let j = 0; j < PARTS - i; ++j) {
      const a = index[i][j], b = index[i + 1][j], c = index[i][j + 1];
      out.add(p, a, b, c, s[a], s[b], s[c], cell, 0, v);
      weigh(out, all[a], all[b], all[c]);
      if (i + j + 1 < PARTS) {
        const d = index[i + 1][j + 1];
        out.add(p, b, d, c, s[b], s[d], s[c], cell, 0, v);
        weigh(out, all[b], all[d], all[c]);
      }
    }
}

// Shares of the colours for a frame's triangles. field: as Frame.field; share: of a value.
function triangles(out, frame, x, field, share, cut) {
  const {run, mesh} = frame, inPlane = run.dim === 2;
  out.count = 0;
  const rows = inPlane ? run.cells.columns : run.facets.columns, [c0, c1, c2] = rows;
  const byCell = field.of === 'cell', values = field.values, key = (a, b) => mesh.curved.get(run.edgeKey(a, b)) ?? -1;
  for (const id of inPlane ? mesh.cells : mesh.facets) {
    const a = c0[id], b = c1[id], c = c2[id], cell = inPlane ? id : rows[3][id];
    const s = byCell ? share(values[cell]) : 0;
    const sa = byCell ? s : share(values[a]), sb = byCell ? s : share(values[b]), sc = byCell ? s : share(values[c]);
    if (mesh.curved) {
      const node = [key(b, c), key(c, a), key(a, b)];
      if (node[0] >= 0 || node[1] >= 0 || node[2] >= 0) {
        const onNodes = node.map(n => n < 0 ? 0 : byCell ? s : share(values[n]));
        addCurved(out, x, [a, b, c], node, [sa, sb, sc, ...onNodes], cell);
        continue;
      }
    }
    out.add(x, a, b, c, sa, sb, sc, cell, 7, null);
  }
  if (cut && !inPlane) addSection(out, frame, x, field, share, cut);
}

// Adds the sections of cells that a plane cuts, a hair within the cells that are shown.
function addSection(out, frame, x, field, share, cut) {
  const {run, mesh} = frame, corners = run.cells.columns.slice(0, 4), byCell = field.of === 'cell';
  const heights = new Float32Array(run.meta.counts.vertices);
  for (const id of mesh.vertices)
    heights[id] = cut[0] * x[3 * id] + cut[1] * x[3 * id + 1] + cut[2] * x[3 * id + 2] - cut[3];
  const isCut = h => {
    const isAbove = h[0] > 0;
    return h.some(value => value > 0 !== isAbove);
  };
  const isOuter = () => true, valueOf = id => byCell ? 0 : field.values[id];
  for (const cell of mesh.cells) {
    const v = corners.map(column => column[cell]), paint = byCell ? () => share(field.values[cell]) : share;
    const edges = mesh.curved ? curvedEdgesOf(run, mesh, v) : [];
    const h = v.map(id => heights[id]);
    if (!edges.length) {
      if (isCut(h))
        addTetrahedron(out, v.map(id => x.subarray(3 * id, 3 * id + 3)), h, v.map(valueOf), v, paint, cell, cut, isOuter);
      continue;
    }
    // All of a curved cell is within its Bézier points.
    if (!isCut([...h, ...edges.map(([i, j, node]) => 2 * heights[node] - (h[i] + h[j]) / 2)])) continue;
    const at = (l, of) => v.reduce((sum, id, i) => sum + l[i] * of(id), 0) +
        edges.reduce((sum, [i, j, node]) => sum + 2 * l[i] * l[j] * (2 * of(node) - of(v[i]) - of(v[j])), 0);
    for (const part of PARTS_OF_CURVED) {
      const ph = part.map(l => at(l, id => heights[id]));
      if (!isCut(ph)) continue;
      const points = part.map(l => [0, 1, 2].map(k => at(l, id => x[3 * id + k])));
      const near = part.map(l => v[l.indexOf(Math.max(...l))]);
      // Lines where the part's face is on a face of the cell.
      const isLine = face => [0, 1, 2, 3].some(m => face.every(i => part[i][m] === 0));
      addTetrahedron(out, points, ph, part.map(l => at(l, valueOf)), near, paint, cell, cut, isLine);
    }
  }
}

// [corner, corner, node], corners 0 to 3.
function curvedEdgesOf(run, mesh, v) {
  const found = [];
  for (let i = 0; i < v.length; ++i)
    for (let j = 0; j < i; ++j) {
      const node = mesh.curved.get(run.edgeKey(v[i], v[j]));
      if (node !== undefined) found.push([i, j, node]);
    }
  return found;
}

// The 64 tetrahedra that halving all edges twice makes, by barycentric coordinates.
const PARTS_OF_CURVED = (() => {
  const middle = (a, b) => a.map((value, k) => (value + b[k]) / 2);
  const halved = ([a, b, c, d]) => {
    const [ab, ac, ad, bc, bd, cd] = [[a, b], [a, c], [a, d], [b, c], [b, d], [c, d]].map(([p, q]) => middle(p, q));
    return [
      [a, ab, ac, ad], [ab, b, bc, bd], [ac, bc, c, cd], [ad, bd, cd, d], [ab, ac, ad, bd], [ab, ac, bc, bd],
      [ac, ad, bd, cd], [ac, bc, bd, cd]
    ];
  };
  return halved([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]).flatMap(halved);
})();

// The section of a straight tetrahedron with heights h above the plane; isLine: of a face, by three of its corners.
function addTetrahedron(out, points, h, values, ids, paint, cell, cut, isLine) {
  const above = [], below = [], p = new Float32Array(12);
  for (let i = 0; i < 4; ++i) (h[i] > 0 ? above : below).push(i);
  const pairs = above.length === 2 ?
      [[above[0], below[0]], [above[0], below[1]], [above[1], below[1]], [above[1], below[0]]] :
      above.length === 1 ? below.map(i => [above[0], i]) :
                           above.map(i => [below[0], i]);
  const s = pairs.map(([i, j], n) => {
    const t = h[i] / (h[i] - h[j]);
    for (let k = 0; k < 3; ++k) p[3 * n + k] = points[i][k] + t * (points[j][k] - points[i][k]) - 1e-6 * cut[k] * cut[4];
    return paint(values[i] * (1 - t) + values[j] * t);
  });
  const near = pairs.map(([i, j]) => Math.abs(h[i]) < Math.abs(h[j]) ? ids[i] : ids[j]), n = pairs.length;
  const drawn =
      pairs.map((pair, k) => isLine([...new Set([...pair, ...pairs[(k + 1) % n]])]));  // from each point to the next
  const bits = (...list) => list.reduce((sum, is, k) => sum + (is ? 1 << k : 0), 0);
  if (n === 3) return out.add(p, 0, 1, 2, s[0], s[1], s[2], cell, bits(drawn[1], drawn[2], drawn[0]), near);
  out.add(p, 0, 1, 2, s[0], s[1], s[2], cell, bits(drawn[1], false, drawn[0]), near);
  out.add(p, 0, 2, 3, s[0], s[2], s[3], cell, bits(drawn[2], drawn[3], false), [near[0], near[2], near[3]]);
}

// Six times the volume within closed surfaces.
function enclosedVolume({place: p, count}) {
  let sum = 0;
  for (let i = 0; i < 9 * count; i += 9) {
    sum += p[i] * (p[i + 4] * p[i + 8] - p[i + 5] * p[i + 7]) - p[i + 1] * (p[i + 3] * p[i + 8] - p[i + 5] * p[i + 6]) +
        p[i + 2] * (p[i + 3] * p[i + 7] - p[i + 4] * p[i + 6]);
  }
  return sum;
}

const ATTRIBUTES = [['place', 3], ['share', 1], ['corner', 4], ['normal', 3]];

// Whether triangles are drawn by the processor: smooth outlines would take most of its time.
function isSoftware() {
  const gl = document.createElement('canvas').getContext('webgl2'), info = gl?.getExtension('WEBGL_debug_renderer_info');
  const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : '';
  gl?.getExtension('WEBGL_lose_context')?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software/i.test(name);
}

class Painter {
  // Throws where there is no WebGL2.
  constructor(canvas) {
    const gl = this.gl = canvas.getContext('webgl2', {antialias: !isSoftware(), alpha: false, stencil: true});
    if (!gl) throw new Error('no WebGL2');
    this.programs = new Map();
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    const pixels = new Uint8Array(1024 * 4);
    for (let i = 0; i < 1024; ++i) pixels.set([...colourAt(i / 1023), 255], 4 * i);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 1024, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    for (const [name, value] of [
             [gl.TEXTURE_MIN_FILTER, gl.NEAREST], [gl.TEXTURE_MAG_FILTER, gl.NEAREST], [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE],
             [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]])
      gl.texParameteri(gl.TEXTURE_2D, name, value);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE);
  }

  program(...words) {
    const key = words.filter(Boolean).join(' '), known = this.programs.get(key);
    if (known) return known;
    const {gl} = this, program = gl.createProgram(),
          head = '#version 300 es\n' + key.split(' ').map(word => word && `#define ${word}\n`).join('');
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX_SHADER], [gl.FRAGMENT_SHADER, FRAGMENT_SHADER]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, head + text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    ATTRIBUTES.forEach(([name], i) => gl.bindAttribLocation(program, i, name));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const at = Object.fromEntries(
        ['toClip', 'cut', 'flatColour', 'light', 'edges', 'opacity'].map(n => [n, gl.getUniformLocation(program, n)]));
    this.programs.set(key, {program, at});
    return this.programs.get(key);
  }

  buffers() {
    const {gl} = this, array = gl.createVertexArray(), list = [];
    gl.bindVertexArray(array);
    ATTRIBUTES.forEach(([name, size], i) => {
      const isBytes = name === 'corner';
      list.push(gl.createBuffer());
      gl.bindBuffer(gl.ARRAY_BUFFER, list[i]);
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, size, isBytes ? gl.UNSIGNED_BYTE : gl.FLOAT, isBytes, 0, 0);
    });
    return {array, list, count: 0};
  }

  upload(to, from) {
    const {gl} = this, n = from.count;
    to.count = 3 * n;
    ATTRIBUTES.forEach(([name, size], i) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, to.list[i]);
      gl.bufferData(gl.ARRAY_BUFFER, from[name].subarray(0, 3 * size * n), gl.DYNAMIC_DRAW);
    });
  }

  begin(width, height, toClip, light) {
    const {gl} = this;
    Object.assign(this, {toClip, light});
    gl.depthMask(true);  // what is not written is not cleared
    gl.viewport(0, 0, width, height);
    gl.clearColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
  }

  // isClosed: the triangles enclose bodies, their fronts outside. mark: later drawing knows the pixels, and is only over the
  // 'marked' ones, or over the 'rest'.
  draw(
      what,
      {cut = null, flat = null, edges = 0, lines = false, isClosed = false, mark = false, over = null, opacity = 1} = {}) {
    const {gl} = this;
    if (!what.count) return;
    isClosed ? gl.enable(gl.CULL_FACE) : gl.disable(gl.CULL_FACE);
    const {program, at} = this.program(cut && 'CUT', edges > 0 && 'EDGES', flat && 'FLAT');
    gl.useProgram(program);
    gl.uniformMatrix4fv(at.toClip, false, this.toClip);
    gl.uniform3fv(at.light, lines ? [0, 0, 0] : this.light);
    if (cut) gl.uniform4f(at.cut, cut[0], cut[1], cut[2], cut[3]);
    if (flat) gl.uniform3fv(at.flatColour, flat);
    if (edges > 0) gl.uniform1f(at.edges, edges);
    gl.uniform1f(at.opacity, opacity);
    mark || over ? gl.enable(gl.STENCIL_TEST) : gl.disable(gl.STENCIL_TEST);
    gl.stencilFunc(mark ? gl.ALWAYS : gl.EQUAL, over === 'rest' ? 0 : 1, 1);
    gl.stencilOp(gl.KEEP, gl.KEEP, mark ? gl.REPLACE : gl.KEEP);
    opacity < 1 ? gl.enable(gl.BLEND) : gl.disable(gl.BLEND);
    gl.depthMask(opacity === 1);
    gl.bindVertexArray(what.array);
    gl.drawArrays(lines ? gl.LINES : gl.TRIANGLES, 0, what.count);
  }
}

// From dark blue to yellow, as red, green, blue at equal distances (matplotlib's viridis, 9 of its colours).
const COLOURS = [
  [68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99], [170, 220, 50],
  [253, 231, 37]
];

function colourAt(share) {
  const at = Math.min(Math.max(share, 0), 1) * (COLOURS.length - 1), k = Math.min(Math.floor(at), COLOURS.length - 2);
  return COLOURS[k].map((c, i) => Math.round(c + (at - k) * (COLOURS[k + 1][i] - c)));
}

// Parallel projection: the eye at angles [degree] about y from z and above the plane; pixels a metre; what is at the middle.
class Camera {
  constructor(dim) {
    Object.assign(this, {dim, azimuth: dim === 2 ? 0 : 35, elevation: dim === 2 ? 0 : 20, zoom: 1, target: [0, 0, 0]});
  }
  axes() {
    const a = this.azimuth * Math.PI / 180, e = this.elevation * Math.PI / 180;
    const forward = [Math.sin(a) * Math.cos(e), Math.sin(e), Math.cos(a) * Math.cos(e)],
          right = [Math.cos(a), 0, -Math.sin(a)];
    const up = [0, 1, 2].map(k => forward[(k + 1) % 3] * right[(k + 2) % 3] - forward[(k + 2) % 3] * right[(k + 1) % 3]);
    return {right, up, forward};
  }
  // Column by column; radius: of all that may be seen, around the target.
  matrix(scale, width, height, radius) {
    const {right, up, forward} = this.axes(), t = this.target, m = new Float32Array(16);
    [[right, 2 * scale / width], [up, 2 * scale / height], [forward, -1 / radius]].forEach(([axis, factor], row) => {
      for (let k = 0; k < 3; ++k) m[4 * k + row] = factor * axis[k];
      m[12 + row] = -factor * (axis[0] * t[0] + axis[1] * t[1] + axis[2] * t[2]);
    });
    m[15] = 1;
    return m;
  }
}
