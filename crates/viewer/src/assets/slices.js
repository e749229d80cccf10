// Slices on canvases: along the patient's axes, and along and perpendicular to the needle. In millimetres, to scale.
'use strict';

/**
 * Planes along the patient's axes, in the radiological convention: as seen from the feet, from the front, from the
 * left.
 */
PLAN.PLANES = {
  axial: { title: 'Axial', u: 0, v: 1, w: 2, flip: false, letters: ['R', 'L', 'A', 'P'] },
  coronal: { title: 'Coronal', u: 0, v: 2, w: 1, flip: true, letters: ['R', 'L', 'S', 'I'] },
  sagittal: { title: 'Sagittal', u: 1, v: 2, w: 0, flip: true, letters: ['A', 'P', 'S', 'I'] },
};

PLAN.COLORS = {
  needle: NB.palette.yellow,
  bent: '#fff',
  target: NB.palette.orange,
  entry: NB.palette.sky,
  cross: NB.palette.green,
  lesion: NB.palette.purple,
  marker: NB.palette.sky,
  error: NB.palette.vermillion,
};

/** Square root of what chi-square of three degrees of freedom stays below in 95 % of cases. */
PLAN.SIGMAS_95 = 2.7955;

/** A canvas in millimetres that is sharp on every screen, with lettering and a scale. */
class Picture {
  /** @param {string} title @param {string} help */
  constructor(title, help) {
    this.title = title;
    this.canvas = NB.el('canvas', { tabindex: '0', role: 'application', 'aria-label': `${title} slice. ${help}` });
    this.caption = NB.el('span', { class: 'slice-title', text: title });
    this.element = NB.el('figure', { class: 'slice' }, this.canvas, NB.el('figcaption', null, this.caption));
    this.zoom = 1;
    /** @type {number[] | null} */
    this.middle = null;
    // Pixels of a millimetre, where (0, 0) is, and width and height of the canvas.
    this.scale = 1;
    this.origin = [0, 0];
    this.box = [0, 0];
    this.asked = 0;
    // What the picture shows already.
    this.drawn = '';
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  /**
   * Whether something else is to be drawn than what is.
   * @param {string} what
   */
  isNew(what) {
    const isNew = this.drawn !== what;
    this.drawn = what;
    return isNew;
  }

  /** Each kind of picture has its own. */
  render() {}

  /** Draws once before the next frame, however often it is asked. */
  draw() {
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = 0;
      this.render();
    });
  }

  /** @param {number[]} size @param {number[]} middle */
  begin([width, height], middle) {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [w, h] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!w || !h) return null;
    if (this.canvas.width !== Math.round(w * ratio) || this.canvas.height !== Math.round(h * ratio)) {
      [this.canvas.width, this.canvas.height] = [Math.round(w * ratio), Math.round(h * ratio)];
    }
    const context = NB.context(this.canvas);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = '#000';
    context.fillRect(0, 0, w, h);
    this.scale = Math.min(w / width, h / height) * this.zoom;
    this.origin = [w / 2 - middle[0] * this.scale, h / 2 - middle[1] * this.scale];
    this.box = [w, h];
    return context;
  }

  /**
   * A place of the picture, mm, on the canvas.
   * @param {number[]} place
   */
  onCanvas([x, y]) {
    return [this.origin[0] + x * this.scale, this.origin[1] + y * this.scale];
  }

  /** @param {MouseEvent} event */
  inPicture(event) {
    const box = this.canvas.getBoundingClientRect();
    return [
      (event.clientX - box.left - this.origin[0]) / this.scale,
      (event.clientY - box.top - this.origin[1]) / this.scale,
    ];
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {number[]} a
   * @param {number[]} b
   * @param {string} color
   * @param {number} width
   * @param {number[]} [dashes]
   */
  line(context, a, b, color, width, dashes = []) {
    this.polyline(context, [a, b], color, width, dashes);
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {number[][]} points
   * @param {string} color
   * @param {number} width
   * @param {number[]} [dashes]
   */
  polyline(context, points, color, width, dashes = []) {
    context.setLineDash(dashes);
    for (const [style, size] of /** @type {[string, number][]} */ ([
      ['rgba(0, 0, 0, 0.7)', width + 2],
      [color, width],
    ])) {
      context.strokeStyle = style;
      context.lineWidth = size;
      context.beginPath();
      for (const [x, y] of points) context.lineTo(x, y);
      context.stroke();
    }
    context.setLineDash([]);
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {number[]} at
   * @param {number} radius
   * @param {string} color
   * @param {number} [width]
   */
  ring(context, at, radius, color, width = 1.5) {
    for (const [style, size] of /** @type {[string, number][]} */ ([
      ['rgba(0, 0, 0, 0.7)', width + 2],
      [color, width],
    ])) {
      context.strokeStyle = style;
      context.lineWidth = size;
      context.beginPath();
      context.arc(at[0], at[1], Math.max(radius, 0.5), 0, 2 * Math.PI);
      context.stroke();
    }
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {string} words
   * @param {number[]} place
   * @param {string} [color]
   * @param {CanvasTextAlign} [align]
   */
  text(context, words, [x, y], color = '#fff', align = 'left') {
    context.font = '12px system-ui, sans-serif';
    context.textAlign = align;
    context.textBaseline = 'middle';
    context.lineWidth = 3;
    context.strokeStyle = 'rgba(0, 0, 0, 0.85)';
    context.strokeText(words, x, y);
    context.fillStyle = color;
    context.fillText(words, x, y);
  }

  /** @param {CanvasRenderingContext2D} context @param {string[]} letters */
  letters(context, [left, right, top, bottom]) {
    const [w, h] = this.box;
    context.save();
    this.text(context, left, [6, h / 2]);
    this.text(context, right, [w - 6, h / 2], '#fff', 'right');
    this.text(context, top, [w / 2, 10], '#fff', 'center');
    this.text(context, bottom, [w / 2, h - 10], '#fff', 'center');
    context.restore();
  }

  /** @param {CanvasRenderingContext2D} context */
  ruler(context) {
    const [w, h] = this.box;
    const length = [100, 50, 20, 10, 5].find((mm) => mm * this.scale < 0.3 * w) || 2;
    const to = w - 12;
    this.line(context, [to - length * this.scale, h - 12], [to, h - 12], '#fff', 2);
    this.text(context, `${length} mm`, [to, h - 24], '#fff', 'right');
  }

  /**
   * The outline of the 95 % ellipsoid on a plane of two unit vectors (axes of ct): mm of the plane.
   * @param {CanvasRenderingContext2D} context
   * @param {number[]} at
   * @param {number[][]} covariance
   * @param {number[]} a
   * @param {number[]} b
   * @param {string} color
   */
  ellipse(context, at, covariance, a, b, color) {
    /** @param {number[]} p @param {number[]} q */
    const of = (p, q) =>
      PLAN.dot(
        p,
        covariance.map((row) => PLAN.dot(row, q)),
      );
    const [xx, xy, yy] = [of(a, a), of(a, b), of(b, b)];
    const mean = (xx + yy) / 2;
    const spread = Math.hypot((xx - yy) / 2, xy);
    const radii = [mean + spread, mean - spread].map(
      (variance) => PLAN.SIGMAS_95 * 1e3 * Math.sqrt(Math.max(variance, 0)) * this.scale,
    );
    const turn = 0.5 * Math.atan2(2 * xy, xx - yy);
    for (const [style, size] of /** @type {[string, number][]} */ ([
      ['rgba(0, 0, 0, 0.7)', 3.5],
      [color, 1.75],
    ])) {
      context.strokeStyle = style;
      context.lineWidth = size;
      context.beginPath();
      context.ellipse(at[0], at[1], Math.max(radii[0], 0.5), Math.max(radii[1], 0.5), turn, 0, 2 * Math.PI);
      context.stroke();
    }
  }
}

/** A slice along the patient's axes. `planner` has the volume and what is shown; it is told of clicks and drags. */
class Slice extends Picture {
  /** @param {Plane} plane @param {Planner} planner */
  constructor(plane, planner) {
    super(
      plane.title,
      'Arrow keys move the crosshair, page up and down change the slice, plus and minus zoom, 0 shows all, T and ' +
        'E set target and entry at the crosshair.',
    );
    this.plane = plane;
    this.planner = planner;
    this.image = document.createElement('canvas');
    this.outline = document.createElement('canvas');
    /** @type {number | undefined} */
    this.outlined = undefined;
    /** @type {'target' | 'entry' | 'crosshair' | null} */
    this.held = null;
    this.from = [0, 0];
    this.moved = false;
    this.listen();
  }

  /**
   * Picture (mm) of an index: to the right and down from the corner of the first pixel.
   * @param {Index} index
   */
  place(index) {
    const { u, v, flip } = this.plane;
    const { size, spacing } = this.planner.volume;
    return [(index[u] + 0.5) * spacing[u], (flip ? size[v] - 0.5 - index[v] : index[v] + 0.5) * spacing[v]];
  }

  /**
   * Index of a place of the picture, in the slice that is shown.
   * @param {number[]} place
   * @param {number} depth
   */
  index([x, y], depth) {
    const { u, v, w, flip } = this.plane;
    const { size, spacing } = this.planner.volume;
    const index = [0, 0, 0];
    index[u] = x / spacing[u] - 0.5;
    index[v] = flip ? size[v] - 0.5 - y / spacing[v] : y / spacing[v] - 0.5;
    index[w] = depth;
    return index;
  }

  /** @param {MouseEvent} event */
  voxel(event) {
    const { w } = this.plane;
    const index = this.index(this.inPicture(event), this.planner.state.crosshair[w]);
    return this.planner.within(index.map(Math.round));
  }

  render() {
    const { volume, state, greys, route, shown } = this.planner;
    if (!volume) return;
    const { u, v, w } = this.plane;
    const { size, spacing } = volume;
    const extent = [size[u] * spacing[u], size[v] * spacing[v]];
    const context = this.begin(extent, this.middle || [extent[0] / 2, extent[1] / 2]);
    if (!context) return;
    const slice = state.crosshair[w];
    if (this.isNew(`${slice} ${state.window_hu}`)) PLAN.plane(volume, this.plane, slice, greys, this.image);
    context.imageSmoothingEnabled = true;
    context.imageSmoothingQuality = 'high';
    const [x, y] = this.onCanvas([0, 0]);
    context.drawImage(this.image, x, y, extent[0] * this.scale, extent[1] * this.scale);
    this.outlines(context, slice, extent);
    this.balls(context, slice);
    this.entries(context, slice);
    this.crosshair(context);
    if (route) this.needle(context, route, slice);
    /** @param {Index | null} index @param {string} color @param {string} label */
    const handle = (index, color, label) => {
      if (!index) return;
      const at = this.onCanvas(this.place(index));
      const beside = Math.abs(index[w] - slice) * spacing[w];
      this.ring(context, at, 5, color, beside < 2 ? 2 : 1);
      this.text(context, label, [at[0] + 9, at[1] - 9], color);
    };
    handle(shown.target, PLAN.COLORS.target, 'target');
    handle(shown.entry, PLAN.COLORS.entry, 'entry');
    this.letters(context, this.plane.letters);
    this.ruler(context);
    this.caption.textContent = `${this.title} ${slice + 1} of ${size[w]}`;
  }

  /**
   * Outlines of the labels, where they are switched on.
   * @param {CanvasRenderingContext2D} context
   * @param {number} slice
   * @param {number[]} extent
   */
  outlines(context, slice, extent) {
    const { labels, labelColors, volume, showsLabels } = this.planner;
    if (!labels || !showsLabels) return;
    if (this.outlined !== slice) {
      PLAN.outlines(volume.size, labels, this.plane, slice, labelColors, this.outline);
      this.outlined = slice;
    }
    context.imageSmoothingEnabled = false;
    const [x, y] = this.onCanvas([0, 0]);
    context.drawImage(this.outline, x, y, extent[0] * this.scale, extent[1] * this.scale);
    context.imageSmoothingEnabled = true;
  }

  /**
   * Admissible entries of the map that are within 2 mm of the slice.
   * @param {CanvasRenderingContext2D} context
   * @param {number} slice
   */
  entries(context, slice) {
    this.planner.entryMap.entriesNear(this.plane.w, slice, 2, (index, color) => {
      const [x, y] = this.onCanvas(this.place(index));
      context.fillStyle = color;
      context.strokeStyle = '#fff';
      context.lineWidth = 1;
      context.beginPath();
      context.arc(x, y, 2.5, 0, 2 * Math.PI);
      context.fill();
      context.stroke();
    });
  }

  /**
   * Lesions and markers where the slice cuts them.
   * @param {CanvasRenderingContext2D} context
   * @param {number} slice
   */
  balls(context, slice) {
    const { facts, volume, state } = this.planner;
    const { w } = this.plane;
    /** @param {Lesion | Marker} ball @param {string} color @param {string} name */
    const cut = (ball, color, name) => {
      const radius = 0.5e3 * (ball.diameter_m ?? 0);
      const off = (ball.index[w] - slice) * volume.spacing[w];
      if (!(radius > Math.abs(off))) return;
      const at = this.onCanvas(this.place(ball.index));
      const size = Math.sqrt(radius ** 2 - off ** 2) * this.scale;
      this.ring(context, at, size, color, 1);
      this.text(context, name, [at[0], at[1] + size + 9], color, 'center');
    };
    for (const lesion of facts.lesions) cut(lesion, PLAN.COLORS.lesion, NB.words(lesion.name));
    for (const marker of facts.markers)
      if (!state.hidden_markers.includes(marker.name)) cut(marker, PLAN.COLORS.marker, NB.words(marker.name));
  }

  /** @param {CanvasRenderingContext2D} context */
  crosshair(context) {
    const [x, y] = this.onCanvas(this.place(this.planner.state.crosshair));
    const [w, h] = this.box;
    context.strokeStyle = PLAN.COLORS.cross;
    context.lineWidth = 1;
    // Open in the middle, so that what is there is seen.
    for (const [a, b] of [
      [
        [0, y],
        [x - 8, y],
      ],
      [
        [x + 8, y],
        [w, y],
      ],
      [
        [x, 0],
        [x, y - 8],
      ],
      [
        [x, y + 8],
        [x, h],
      ],
    ]) {
      context.beginPath();
      context.moveTo(a[0], a[1]);
      context.lineTo(b[0], b[1]);
      context.stroke();
    }
  }

  /**
   * Dashed where it runs before or behind the slice, and as thick as it is where it runs within.
   * @param {CanvasRenderingContext2D} context
   * @param {RouteAnswer} route
   * @param {number} slice
   */
  needle(context, route, slice) {
    const { w } = this.plane;
    const { volume, facts, tip } = this.planner;
    const [from, to] = [route.entry_index, route.target_index];
    /** @param {number} share */
    const at = (share) => this.onCanvas(this.place(PLAN.add(from, PLAN.add(to, from, -1), share)));
    // Under the straight needle.
    /** @param {Index} index */
    const mm = (index) => index.map((value, axis) => value * volume.spacing[axis]);
    const along = PLAN.unit(PLAN.add(mm(to), mm(from), -1));
    const normal = [0, 1, 2].map((axis) => Number(axis === w));
    // A needle along the normal bends to any side of the slice.
    const aside =
      Math.abs(along[w]) < 0.999
        ? PLAN.unit(PLAN.cross(along, normal))
        : [0, 1, 2].map((axis) => Number(axis === this.plane.u));
    for (const bent of PLAN.bends(route, mm(from), along, aside))
      this.polyline(
        context,
        bent.map((point) => this.onCanvas(this.place(point.map((value, axis) => value / volume.spacing[axis])))),
        PLAN.COLORS.bent,
        1,
      );
    this.line(context, at(-15e-3 / route.length_m), at(1), PLAN.COLORS.needle, 1, [5, 4]);
    const half = Math.max(0.5, 1 / volume.spacing[w]);
    const across = to[w] - from[w];
    const shares =
      Math.abs(across) < 1e-9
        ? Math.abs(from[w] - slice) <= half
          ? [0, 1]
          : null
        : [(slice - half - from[w]) / across, (slice + half - from[w]) / across].sort((a, b) => a - b);
    if (shares && shares[0] < 1 && shares[1] > 0) {
      this.line(
        context,
        at(Math.max(shares[0], 0)),
        at(Math.min(shares[1], 1)),
        PLAN.COLORS.needle,
        Math.max(1e3 * facts.needle_diameter_m * this.scale, 2),
      );
    }
    if (tip) {
      const axes = [
        [1, 0, 0],
        [0, 1, 0],
        [0, 0, this.plane.flip ? -1 : 1],
      ];
      const center = PLAN.add(
        to,
        tip.bias_m.map((metres, axis) => (metres * 1e3) / volume.spacing[axis]),
      );
      this.ellipse(
        context,
        this.onCanvas(this.place(center)),
        tip.covariance_m2,
        axes[this.plane.u],
        axes[this.plane.v],
        PLAN.COLORS.error,
      );
    }
  }

  listen() {
    const { canvas, planner } = this;
    canvas.addEventListener('pointerdown', (event) => {
      if (!planner.volume || event.button > 0) return;
      canvas.setPointerCapture(event.pointerId);
      canvas.focus();
      this.held = this.handleAt(event);
      this.from = [event.clientX, event.clientY];
      this.moved = false;
      if (this.held) return;
      if (planner.tool !== 'crosshair') planner.put(planner.tool, this.voxel(event));
      else {
        this.held = 'crosshair';
        planner.look(this.voxel(event));
      }
    });
    canvas.addEventListener('pointermove', (event) => {
      if (!this.held) {
        canvas.style.cursor = planner.volume && this.handleAt(event) ? 'grab' : 'crosshair';
        return;
      }
      if (this.held === 'crosshair') {
        planner.look(this.voxel(event));
        return;
      }
      if (!this.moved) {
        // A click on it brings the crosshair there.
        if (Math.hypot(event.clientX - this.from[0], event.clientY - this.from[1]) < 3) return;
        this.moved = true;
        planner.beginDrag();
      }
      // In the plane; its depth stays.
      const depth = planner.shown[this.held]?.[this.plane.w] ?? 0;
      planner.drag(this.held, planner.within(this.index(this.inPicture(event), depth)));
    });
    const end = () => {
      if (this.held && this.held !== 'crosshair') {
        if (this.moved) planner.endDrag();
        else {
          const at = planner.shown[this.held];
          if (at) planner.look(planner.within(at.map(Math.round)));
        }
      }
      this.held = null;
    };
    canvas.addEventListener('pointerup', end);
    canvas.addEventListener('pointercancel', end);
    canvas.addEventListener(
      'wheel',
      (event) => {
        event.preventDefault();
        if (event.ctrlKey) this.zoomBy(event.deltaY < 0 ? 1.2 : 1 / 1.2, this.inPicture(event));
        else planner.step(this.plane.w, event.deltaY < 0 ? 1 : -1);
      },
      { passive: false },
    );
    canvas.addEventListener('dblclick', () => this.zoomBy(0));
    canvas.addEventListener('keydown', (event) => this.key(event));
  }

  /**
   * `target` or `entry`, if one is under the pointer.
   * @param {PointerEvent} event
   * @returns {'target' | 'entry' | null}
   */
  handleAt(event) {
    const box = this.canvas.getBoundingClientRect();
    /** @param {Index | null} index */
    const near = (index) => {
      if (!index) return false;
      const at = this.onCanvas(this.place(index));
      const reach = event.pointerType === 'touch' ? 22 : 10;
      return Math.hypot(at[0] - event.clientX + box.left, at[1] - event.clientY + box.top) < reach;
    };
    const { shown } = this.planner;
    return near(shown.entry) ? 'entry' : near(shown.target) ? 'target' : null;
  }

  /**
   * About a place of the picture that stays where it is; 0 shows all.
   * @param {number} factor
   * @param {number[] | null} [about]
   */
  zoomBy(factor, about = null) {
    const { u, v } = this.plane;
    const { size, spacing } = this.planner.volume;
    const whole = [(size[u] * spacing[u]) / 2, (size[v] * spacing[v]) / 2];
    const { zoom: before, middle: seen } = this;
    const zoom = factor === 0 ? 1 : Math.min(Math.max(before * factor, 1), 12);
    const at = about || this.place(this.planner.state.crosshair);
    const middle = seen || whole;
    this.middle = zoom === 1 ? null : middle.map((value, axis) => at[axis] + ((value - at[axis]) * before) / zoom);
    this.zoom = zoom;
    this.draw();
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const { planner, plane } = this;
    if (!planner.volume || event.ctrlKey || event.metaKey || event.altKey) return;
    /** @type {{ [key: string]: number[] | undefined }} */
    const moves = {
      ArrowLeft: [plane.u, -1],
      ArrowRight: [plane.u, 1],
      ArrowUp: [plane.v, plane.flip ? 1 : -1],
      ArrowDown: [plane.v, plane.flip ? -1 : 1],
      PageUp: [plane.w, 1],
      PageDown: [plane.w, -1],
    };
    const move = moves[event.key];
    if (move) planner.step(move[0], move[1] * (event.shiftKey ? 10 : 1));
    else if (event.key === '+' || event.key === '=') this.zoomBy(1.2);
    else if (event.key === '-') this.zoomBy(1 / 1.2);
    else if (event.key === '0') this.zoomBy(0);
    else if (event.key === 't' || event.key === 'T') planner.put('target', planner.state.crosshair);
    else if (event.key === 'e' || event.key === 'E') planner.put('entry', planner.state.crosshair);
    else return;
    event.preventDefault();
  }
}

/** Slices interpolated between voxels: along the needle, and perpendicular to it at a depth. */
class Probe extends Picture {
  /** @param {'along' | 'across'} kind @param {Planner} planner */
  constructor(kind, planner) {
    super(
      kind === 'along' ? 'Along the needle' : 'Perpendicular to the needle',
      kind === 'along'
        ? 'Left and right arrow keys rotate it about the needle.'
        : 'Left and right arrow keys move it along the needle.',
    );
    this.kind = kind;
    this.planner = planner;
    this.image = document.createElement('canvas');
    this.canvas.addEventListener('keydown', (event) => {
      const step = event.key === 'ArrowLeft' ? -1 : event.key === 'ArrowRight' ? 1 : 0;
      if (!step) return;
      event.preventDefault();
      planner.turnProbe(this.kind, step);
    });
  }

  /**
   * Unit vectors of ct: to the right, down, and where the middle is, mm from the first voxel.
   * @param {RouteAnswer} route
   */
  axes(route) {
    /** @param {Index} index */
    const mm = (index) => index.map((value, axis) => value * this.planner.volume.spacing[axis]);
    const [entry, target] = [mm(route.entry_index), mm(route.target_index)];
    const along = PLAN.unit(PLAN.add(target, entry, -1));
    // As near to the axial plane as it gets.
    const up = Math.abs(along[2]) < 0.95 ? [0, 0, 1] : [0, -1, 0];
    const across = PLAN.unit(PLAN.cross(along, up));
    const third = PLAN.cross(along, across);
    const { turn, depth } = this.planner.probe;
    if (this.kind === 'along') {
      const aside = PLAN.unit(across.map((value, axis) => value * Math.cos(turn) + third[axis] * Math.sin(turn)));
      const length = Math.hypot(...PLAN.add(target, entry, -1));
      return {
        right: along,
        down: aside,
        middle: PLAN.add(entry, along, length / 2),
        size: [length + 60, 90],
        entry,
        target,
      };
    }
    return { right: across, down: third, middle: PLAN.add(entry, along, depth), size: [90, 90], entry, target };
  }

  render() {
    const { volume, route, state, facts, tip } = this.planner;
    if (!volume) return;
    if (!route) {
      const context = this.begin([100, 60], [0, 0]);
      if (context) this.text(context, 'choose target and entry', [this.box[0] / 2, this.box[1] / 2], '#ccc', 'center');
      return;
    }
    const { right, down, middle, size, entry, target } = this.axes(route);
    const context = this.begin(size, [0, 0]);
    if (!context) return;
    // All of the canvas, with at most as many pixels as it has; coarser while the needle moves, so that numbers follow
    // it.
    const [w, h] = this.box;
    const [columns, rows] = [w, h].map((pixels) =>
      Math.round(Math.min(pixels, 420) * (this.planner.dragging ? 0.4 : 1)),
    );
    const key = `${columns} ${rows} ${w} ${h} ${this.scale} ${right} ${down} ${middle} ${state.window_hu}`;
    if (this.isNew(key)) this.sample(right, down, middle, [w / this.scale, h / this.scale], [columns, rows]);
    context.imageSmoothingEnabled = true;
    context.drawImage(this.image, 0, 0, w, h);
    /** @param {number[]} mm */
    const flat = (mm) => {
      const off = PLAN.add(mm, middle, -1);
      return this.onCanvas([PLAN.dot(off, right), PLAN.dot(off, down)]);
    };
    const thick = Math.max(1e3 * facts.needle_diameter_m * this.scale, 2);
    if (this.kind === 'along') {
      this.line(context, flat(entry), flat(target), PLAN.COLORS.needle, thick);
      for (const bent of PLAN.bends(route, entry, right, down))
        this.polyline(context, bent.map(flat), PLAN.COLORS.bent, 1);
    } else
      this.ring(
        context,
        flat(PLAN.add(entry, PLAN.unit(PLAN.add(target, entry, -1)), this.planner.probe.depth)),
        thick / 2,
        PLAN.COLORS.needle,
      );
    if (tip && (this.kind === 'along' || Math.abs(this.planner.probe.depth - 1e3 * route.length_m) < 0.5)) {
      const center = PLAN.add(
        target,
        tip.bias_m.map((metres) => 1e3 * metres),
      );
      this.ellipse(context, flat(center), tip.covariance_m2, right, down, PLAN.COLORS.error);
    }
    if (this.kind === 'along') {
      this.text(context, 'skin', flat(entry), PLAN.COLORS.entry, 'right');
      this.text(context, 'target', PLAN.add([...flat(target), 0], [8, 0, 0]).slice(0, 2), PLAN.COLORS.target);
    }
    this.letters(context, [right.map((value) => -value), right, down.map((value) => -value), down].map(PLAN.towards));
    this.ruler(context);
    const degrees = Math.round((this.planner.probe.turn * 180) / Math.PI);
    this.caption.textContent =
      this.kind === 'along'
        ? `${this.title}, rotated by ${NB.minus(String(degrees))}\u00b0`
        : `${this.title}, ${NB.fixed(this.planner.probe.depth, 1)} mm from the skin`;
  }

  /**
   * @param {number[]} right
   * @param {number[]} down
   * @param {number[]} middle
   * @param {number[]} size
   * @param {number[]} pixels
   */
  sample(right, down, middle, [width, height], [columns, rows]) {
    const { volume, greys } = this.planner;
    const { spacing } = volume;
    if (this.image.width !== columns || this.image.height !== rows)
      [this.image.width, this.image.height] = [columns, rows];
    const context = NB.context(this.image);
    const image = context.createImageData(columns, rows);
    const pixels = new Uint32Array(image.data.buffer);
    const step = right.map((value, axis) => (value * width) / columns / spacing[axis]);
    for (let row = 0, to = 0; row < rows; row++) {
      const y = ((row + 0.5) / rows - 0.5) * height;
      const x = (0.5 / columns - 0.5) * width;
      let [i, j, k] = middle.map((value, axis) => (value + y * down[axis] + x * right[axis]) / spacing[axis]);
      for (let column = 0; column < columns; column++, i += step[0], j += step[1], k += step[2]) {
        pixels[to++] = greys[Math.round(volume.between(i, j, k)) + 32768];
      }
    }
    context.putImageData(image, 0, 0);
  }
}

/**
 * Lines of the median needle as tissue bends it, mm of ct: two, to both sides of a view, if it is not known to which.
 * @param {RouteAnswer} route
 * @param {number[]} entry
 * @param {number[]} along unit vector
 * @param {number[]} aside unit vector in the view
 */
PLAN.bends = ({ bend }, entry, along, aside) => {
  if (!bend) return [];
  const sides = bend.towards ? [bend.towards] : [aside, aside.map((value) => -value)];
  return sides.map((side) =>
    bend.path_m.map(([depth, off]) => PLAN.add(PLAN.add(entry, along, 1e3 * depth), side, 1e3 * off)),
  );
};

/** Letters of where a direction runs, the main one first: `A` or `AL`. */
PLAN.towards = (direction) => {
  const letters = [
    ['R', 'L'],
    ['A', 'P'],
    ['I', 'S'],
  ];
  const sides = direction.map((value, axis) => ({ size: Math.abs(value), letter: letters[axis][value > 0 ? 1 : 0] }));
  return sides
    .filter(({ size }) => size > 0.35)
    .sort((a, b) => b.size - a.size)
    .map(({ letter }) => letter)
    .slice(0, 2)
    .join('');
};
