// The cell in three dimensions. Everything is in the world's frame, in metres, z up.
'use strict';

/** Faces that meet at less than 40 degrees shade as one smooth surface. */
NB.CREASE_COSINE = 0.766;

NB.matrix = (pose) =>
  new THREE.Matrix4().compose(
    new THREE.Vector3().fromArray(pose),
    new THREE.Quaternion().fromArray(pose, 3),
    new THREE.Vector3(1, 1, 1),
  );

/** Frame of parts that are fixed in the room and move with the robot's base, when that is moved. */
NB.BASE = -2;

/** Corners of a box about a base and `reach` m out of it, which may hang or be tilted. */
NB.aboutBase = (base, reach) => {
  const place = NB.matrix(base);
  return [-0.2, 0.2].flatMap((x) =>
    [-0.2, 0.2].flatMap((y) => [-0.1, reach].map((z) => new THREE.Vector3(x, y, z).applyMatrix4(place).toArray())),
  );
};

/** Poses of the six links and the flange: `base * product of joint * turn(axis, q)`. */
NB.forward = (chain, joints) => {
  const poses = [];
  let pose = NB.matrix(chain.base);
  chain.joints.forEach((joint, index) => {
    const turn = new THREE.Matrix4().makeRotationAxis(new THREE.Vector3().fromArray(joint.axis), joints[index]);
    pose = pose.clone().multiply(NB.matrix(joint.pose)).multiply(turn);
    poses.push(pose);
  });
  poses.push(pose.clone().multiply(NB.matrix(chain.flange)));
  return poses;
};

/** Triangles with a normal at each corner, smooth but for creases. */
NB.geometry = (surface) => {
  const codes = NB.array(surface.vertices);
  const indices = NB.array(surface.triangles);
  const count = codes.length / 3;
  const places = new Float32Array(codes.length);
  for (let k = 0; k < codes.length; k++) places[k] = surface.low[k % 3] + surface.step[k % 3] * codes[k];
  const faces = indices.length / 3;
  const normals = new Float32Array(indices.length); // of faces, as long as twice their area
  const units = new Float32Array(indices.length);
  const starts = new Uint32Array(count + 1);
  for (let f = 0; f < faces; f++) {
    const [a, b, c] = [3 * indices[3 * f], 3 * indices[3 * f + 1], 3 * indices[3 * f + 2]];
    const [ux, uy, uz] = [places[b] - places[a], places[b + 1] - places[a + 1], places[b + 2] - places[a + 2]];
    const [vx, vy, vz] = [places[c] - places[a], places[c + 1] - places[a + 1], places[c + 2] - places[a + 2]];
    const [nx, ny, nz] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const size = Math.hypot(nx, ny, nz) || 1;
    normals.set([nx, ny, nz], 3 * f);
    units.set([nx / size, ny / size, nz / size], 3 * f);
    for (let k = 0; k < 3; k++) starts[indices[3 * f + k] + 1]++;
  }
  for (let v = 0; v < count; v++) starts[v + 1] += starts[v];
  const next = starts.slice();
  const around = new Uint32Array(indices.length);
  for (let k = 0; k < indices.length; k++) around[next[indices[k]]++] = Math.floor(k / 3);
  const positions = new Float32Array(3 * indices.length);
  const corners = new Float32Array(3 * indices.length);
  for (let k = 0; k < indices.length; k++) {
    const [vertex, face] = [indices[k], Math.floor(k / 3)];
    let [x, y, z] = [0, 0, 0];
    for (let at = starts[vertex]; at < starts[vertex + 1]; at++) {
      const other = 3 * around[at];
      const cosine =
        units[other] * units[3 * face] +
        units[other + 1] * units[3 * face + 1] +
        units[other + 2] * units[3 * face + 2];
      if (cosine < NB.CREASE_COSINE) continue;
      x += normals[other];
      y += normals[other + 1];
      z += normals[other + 2];
    }
    const size = Math.hypot(x, y, z) || 1;
    corners.set([x / size, y / size, z / size], 3 * k);
    positions.set([places[3 * vertex], places[3 * vertex + 1], places[3 * vertex + 2]], 3 * k);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
  geometry.setAttribute('normal', new THREE.BufferAttribute(corners, 3));
  return geometry;
};

/** Whether this browser supports WebGL; without logged errors if not. */
NB.hasWebgl = () => {
  try {
    const canvas = document.createElement('canvas');
    const context = canvas.getContext('webgl2');
    if (context) context.getExtension('WEBGL_lose_context')?.loseContext();
    return Boolean(context);
  } catch {
    return false;
  }
};

class View {
  /**
   * `label` describes the picture.
   * @param {Scene} scene
   * @param {string} label
   */
  constructor(scene, label) {
    this.scene = scene;
    /** @type {Map<string, THREE.Group>} */
    this.groups = new Map();
    /** @type {{ layer: string, element: HTMLElement, at: THREE.Vector3 }[]} */
    this.labels = [];
    // Surfaces that go where the base goes, with their layers.
    /** @type {{ mesh: ViewMesh, group: string }[]} */
    this.tied = [];
    this.image = NB.el('img', { class: 'print-only view-image', alt: label });
    this.overlay = NB.el('div', { class: 'labels', 'aria-hidden': 'true' });
    this.element = NB.el('div', { class: 'view' }, this.image);
    this.works = NB.hasWebgl();
    if (!this.works) {
      this.element.append(
        NB.el('p', {
          class: 'no-webgl',
          role: 'status',
          text: 'No 3D view: this browser has no WebGL 2, or it is switched off. Tables and plots are not affected.',
        }),
      );
      return;
    }
    /** @type {THREE.WebGLRenderer} */
    this.renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setClearColor(0xf7f8fa);
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'application');
    canvas.setAttribute('aria-label', `${label}. Arrow keys rotate the view, plus and minus zoom, 0 resets.`);
    this.element.append(canvas, this.overlay);
    /** @type {THREE.Scene} */
    this.world = new THREE.Scene();
    /** @type {THREE.PerspectiveCamera} */
    this.camera = new THREE.PerspectiveCamera(35, 1, 0.02, 30);
    this.camera.up.set(0, 0, 1);
    /** @type {THREE.OrbitControls} */
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    this.controls.addEventListener('change', () => this.draw());
    this.world.add(new THREE.HemisphereLight(0xffffff, 0x8d8d94, 2.1));
    /** @type {THREE.DirectionalLight} */
    this.lamp = new THREE.DirectionalLight(0xffffff, 1.5);
    this.world.add(this.lamp, this.lamp.target);
    this.addFloor();
    /** @type {THREE.BufferGeometry[]} */
    this.geometries = scene.parts.map((part) => NB.geometry(part.surface));
    scene.parts.forEach((part, index) => {
      if (part.frame >= 0 || part.group === 'collision') return;
      const mesh = this.mesh(index, part.color);
      this.group(part.group).add(mesh);
      if (part.frame === NB.BASE) this.tied.push({ mesh, group: part.group });
    });
    canvas.addEventListener('keydown', (event) => this.key(event));
    new ResizeObserver(() => this.resize()).observe(this.element);
    window.addEventListener('beforeprint', () => this.snapshot());
  }

  addFloor() {
    const grid = new THREE.GridHelper(3.5, 14, 0xc4c8ce, 0xe1e4e8);
    grid.rotation.x = Math.PI / 2;
    grid.position.z = -0.002;
    this.group('floor').add(grid);
  }

  /**
   * A layer that is shown and hidden as one.
   * @param {string} name
   */
  group(name) {
    let group = this.groups.get(name);
    if (!group) {
      group = new THREE.Group();
      this.groups.set(name, group);
      if (this.works) this.world.add(group);
    }
    return group;
  }

  /** @param {string} name @param {boolean} visible */
  show(name, visible) {
    this.group(name).visible = visible;
    this.draw();
  }

  /** @param {Colour} color @param {boolean} [shaded] */
  material([red, green, blue, opacity], shaded = true) {
    const color = new THREE.Color().setRGB(red, green, blue, 'srgb');
    const settings = {
      color,
      transparent: opacity < 1,
      opacity,
      depthWrite: opacity >= 1,
      side: opacity < 1 ? THREE.FrontSide : THREE.DoubleSide,
    };
    return shaded ? new THREE.MeshLambertMaterial(settings) : new THREE.MeshBasicMaterial(settings);
  }

  /** @param {number} index @param {Colour} color */
  mesh(index, color) {
    const mesh = new THREE.Mesh(this.geometries[index], this.material(color));
    if (color[3] < 1) mesh.renderOrder = this.scene.parts[index].group.split('@')[0] === 'skin' ? 20 : 10;
    return mesh;
  }

  /**
   * A surface of the document besides those of the cell.
   * @param {Surface} surface
   * @param {Colour} color
   */
  surface(surface, color) {
    const mesh = new THREE.Mesh(NB.geometry(surface), this.material(color));
    mesh.renderOrder = 15;
    return mesh;
  }

  /**
   * A copy of the arm with its tool: `pose` it, `stand` its base elsewhere, `tint` its links, `show` it or a `layer` of
   * it; `look` sets colour and opacity.
   * @param {string} name
   * @param {{ color?: Colour, opacity: number } | null} [look]
   * @returns {ArmView}
   */
  arm(name, look = null) {
    if (!this.works) return { pose() {}, stand() {}, tint() {}, show() {}, layer() {} };
    const root = this.group(name);
    const links = Array.from({ length: 7 }, () => new THREE.Group());
    const foot = new THREE.Group();
    foot.matrixAutoUpdate = false;
    root.add(foot);
    /** @type {Map<string, ViewMesh[]>} */
    const layers = new Map();
    /** @type {{ mesh: ViewMesh, frame: number, own: THREE.Color }[]} */
    const painted = [];
    links.forEach((link) => {
      link.matrixAutoUpdate = false;
      root.add(link);
    });
    this.scene.parts.forEach((part, index) => {
      if (look && part.group !== 'robot' && part.group !== 'tool') return;
      if (part.frame < 0 && part.group !== 'collision') return;
      const color = look ? [...(look.color || part.color.slice(0, 3)), look.opacity] : part.color;
      const mesh = this.mesh(index, color);
      if (look) {
        // Where a copy coincides with the arm itself, the arm alone is seen.
        mesh.material.polygonOffset = true;
        mesh.material.polygonOffsetFactor = 2;
        mesh.material.polygonOffsetUnits = 8;
      }
      if (part.frame < 0) foot.add(mesh);
      else links[part.frame].add(mesh);
      if (part.group === 'robot' || part.group === 'tool')
        painted.push({ mesh, frame: part.frame, own: mesh.material.color.clone() });
      layers.set(part.group, [...(layers.get(part.group) || []), mesh]);
    });
    return {
      root,
      pose: (chain, joints) => {
        for (const [index, pose] of NB.forward(chain, joints).entries()) links[index].matrix.copy(pose);
        root.updateMatrixWorld(true);
      },
      stand: (pose) => {
        foot.matrix.copy(pose);
      },
      // A colour (sRGB) by frame, or null for the part's own.
      tint: (colorOf) => {
        for (const { mesh, frame, own } of painted) {
          mesh.material.color.copy(own);
          const color = colorOf(frame);
          if (color) mesh.material.color.lerp(new THREE.Color().setRGB(color[0], color[1], color[2], 'srgb'), 0.7);
        }
      },
      show: (visible) => {
        root.visible = visible;
      },
      layer: (group, visible) => {
        for (const mesh of layers.get(group) || []) mesh.visible = visible;
      },
    };
  }

  /**
   * Takes everything out of a layer.
   * @param {string} name
   */
  empty(name) {
    if (!this.works) return;
    const group = this.group(name);
    for (const child of [...group.children]) {
      group.remove(child);
      child.traverse((each) => {
        if (!(each instanceof THREE.Mesh)) return;
        each.geometry.dispose();
        each.material.dispose();
      });
    }
    this.labels = this.labels.filter((label) => {
      if (label.layer === name) label.element.remove();
      return label.layer !== name;
    });
  }

  /**
   * What is marked is seen through all that stands before it.
   * @template {THREE.MeshBasicMaterial | THREE.MeshLambertMaterial} M
   * @param {M} material
   */
  marked(material) {
    material.depthTest = false;
    material.transparent = true;
    return material;
  }

  /**
   * A straight line as a thin rod.
   * @param {string} name
   * @param {Point} from
   * @param {Point} to
   * @param {number} radius
   * @param {Colour} color
   * @param {boolean} [isMark]
   */
  rod(name, from, to, radius, color, isMark = false) {
    if (!this.works) return;
    const [a, b] = [new THREE.Vector3().fromArray(from), new THREE.Vector3().fromArray(to)];
    const along = b.clone().sub(a);
    const length = Math.max(along.length(), 1e-6);
    const mesh = new THREE.Mesh(new THREE.CylinderGeometry(radius, radius, length, 10), this.material(color, false));
    if (isMark) this.marked(mesh.material);
    mesh.position.copy(a).addScaledVector(along, 0.5);
    mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.normalize());
    mesh.renderOrder = 30;
    this.group(name).add(mesh);
  }

  /** @param {string} name @param {Point} at @param {number} radius @param {Colour} color @param {boolean} [isMark] */
  ball(name, at, radius, color, isMark = false) {
    if (!this.works) return;
    const mesh = new THREE.Mesh(new THREE.SphereGeometry(radius, 20, 14), this.material(color));
    mesh.position.fromArray(at);
    mesh.renderOrder = color[3] < 1 ? 12 : 0;
    if (isMark) {
      this.marked(mesh.material);
      mesh.renderOrder = 30;
    }
    this.group(name).add(mesh);
  }

  /**
   * Unit ball under a matrix (columns are the images of the axes) about a centre.
   * @param {string} name
   * @param {Point} center
   * @param {Point[]} columns
   * @param {Colour} color
   */
  ellipsoid(name, center, columns, color) {
    if (!this.works) return;
    const mesh = new THREE.Mesh(new THREE.SphereGeometry(1, 32, 20), this.material(color));
    const [x, y, z] = columns;
    mesh.matrixAutoUpdate = false;
    mesh.matrix.set(x[0], y[0], z[0], center[0], x[1], y[1], z[1], center[1], x[2], y[2], z[2], center[2], 0, 0, 0, 1);
    mesh.renderOrder = 25;
    this.group(name).add(mesh);
  }

  /** @param {string} name @param {THREE.Group | THREE.Mesh} object */
  add(name, object) {
    if (this.works) this.group(name).add(object);
  }

  /**
   * A text beside a point.
   * @param {string} name
   * @param {string} text
   * @param {Point} at
   */
  label(name, text, at) {
    if (!this.works) return null;
    const element = NB.el('span', { class: 'label', text });
    this.overlay.append(element);
    this.labels.push({ layer: name, element, at: new THREE.Vector3().fromArray(at) });
    return element;
  }

  /**
   * People as they stand, with the eyes of each stature, in the layer `people`; lines of sight belong to it.
   * @param {Person[]} people
   */
  people(people) {
    this.empty('people');
    if (!this.works) return;
    for (const person of people) {
      const [x, y, z] = person.position;
      const tall = 0.82 * person.shortest;
      const body = new THREE.Mesh(
        new THREE.CapsuleGeometry(0.12, tall - 0.24, 6, 20),
        this.material([0.35, 0.42, 0.62, 0.28]),
      );
      body.rotation.x = Math.PI / 2;
      body.position.set(x, y, z + tall / 2);
      body.renderOrder = 12;
      this.add('people', body);
      for (const [stature, eyes] of Object.entries(person.eyes)) {
        this.ball('people', eyes, 0.045, [0.35, 0.42, 0.62, 1]);
        this.label('people', `${NB.words(person.name)}, ${stature} m`, eyes);
      }
    }
    this.group('people').add(this.group('sight'));
  }

  /**
   * Lines of sight, seven numbers each: eye, end, and 1 where it is blocked there.
   * @param {Numbers} lines
   */
  sight(lines) {
    this.empty('sight');
    for (let k = 0; k < lines.length; k += 7) {
      const color = lines[k + 6] ? [0.84, 0.37, 0, 1] : [0, 0.45, 0.7, 1];
      this.rod(
        'sight',
        Array.from(lines.slice(k, k + 3)),
        Array.from(lines.slice(k + 3, k + 6)),
        lines[k + 6] ? 0.0022 : 0.0015,
        color,
      );
    }
  }

  /**
   * The cone that is free for the hand behind the guide, in the layer `cone`.
   * @param {Pose} guideEntry
   * @param {number} halfAngle
   * @param {number} length
   */
  handCone(guideEntry, halfAngle, length) {
    this.empty('cone');
    if (!this.works) return;
    const cone = new THREE.Mesh(NB.cone(halfAngle, length), this.material([0, 0.45, 0.7, 0.4]));
    cone.applyMatrix4(NB.matrix(guideEntry));
    cone.renderOrder = 16;
    this.add('cone', cone);
  }

  /**
   * Looks at a box of points from a direction.
   * @param {Point[]} points
   * @param {Point} direction
   */
  frame(points, direction) {
    if (!this.works) return;
    const low = [0, 1, 2].map((k) => Math.min(...points.map((point) => point[k])));
    const high = [0, 1, 2].map((k) => Math.max(...points.map((point) => point[k])));
    const middle = low.map((value, k) => (value + high[k]) / 2);
    const size = Math.hypot(...low.map((value, k) => high[k] - value));
    this.home = { middle, direction, distance: (0.46 * size) / Math.tan((this.camera.fov * Math.PI) / 360) };
    this.reset();
  }

  reset() {
    if (this.works && this.home) this.look(this.home.direction, this.home.distance, this.home.middle);
  }

  /**
   * Looks along a direction at a point.
   * @param {Point} direction
   * @param {number} distance
   * @param {Point | null} [middle]
   */
  look(direction, distance, middle = null) {
    if (!this.works) return;
    if (middle) this.controls.target.fromArray(middle);
    const along = new THREE.Vector3().fromArray(direction).normalize();
    this.camera.position.copy(this.controls.target).addScaledVector(along, -distance);
    this.controls.update();
    this.draw();
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    /** @type {{ [key: string]: number[] | undefined }} */
    const turns = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const turn = turns[event.key];
    if (turn) {
      const step = Math.PI / 24;
      const level = Math.hypot(offset.x, offset.y);
      const height = Math.min(Math.max(Math.atan2(offset.z, level) + turn[1] * step, -1.5), 1.5);
      const round = Math.atan2(offset.y, offset.x) + turn[0] * step;
      const size = offset.length();
      offset
        .set(Math.cos(round) * Math.cos(height), Math.sin(round) * Math.cos(height), Math.sin(height))
        .multiplyScalar(size);
    } else if (event.key === '+' || event.key === '=') offset.multiplyScalar(0.85);
    else if (event.key === '-') offset.multiplyScalar(1 / 0.85);
    else if (event.key === '0') {
      this.reset();
      return;
    } else return;
    event.preventDefault();
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.draw();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.render();
  }

  /** Draws once before the next frame, however often it is asked. */
  draw() {
    if (!this.works || this.asked) return;
    this.asked = requestAnimationFrame(() => this.render());
  }

  render() {
    if (this.asked) cancelAnimationFrame(this.asked);
    this.asked = 0;
    this.lamp.position.copy(this.camera.position).add(new THREE.Vector3(0, 0, 0.8));
    this.lamp.target.position.copy(this.controls.target);
    this.renderer.render(this.world, this.camera);
    this.placeLabels();
  }

  placeLabels() {
    const { clientWidth: width, clientHeight: height } = this.element;
    /** @type {{ x: number, y: number, w: number, h: number }[]} */
    const taken = [];
    for (const { layer, element, at } of this.labels) {
      const place = at.clone().project(this.camera);
      const visible = this.group(layer).visible && place.z < 1 && Math.abs(place.x) < 1 && Math.abs(place.y) < 1;
      element.style.display = visible ? '' : 'none';
      if (!visible) continue;
      const [w, h] = [element.offsetWidth, element.offsetHeight];
      const x = Math.min(Math.max(((place.x + 1) / 2) * width + 10, 2), width - w - 2);
      let y = Math.min(Math.max(((1 - place.y) / 2) * height - h / 2, 2), height - h - 2);
      // Downwards until it covers none: what is below one may lie on another.
      const covered = () =>
        taken.find((box) => x < box.x + box.w && box.x < x + w && y < box.y + box.h && box.y < y + h);
      for (let box = covered(); box; box = covered()) y = box.y + box.h + 2;
      taken.push({ x, y, w, h });
      element.style.transform = `translate(${Math.round(x)}px, ${Math.round(y)}px)`;
    }
  }

  /** The picture for paper. */
  snapshot() {
    if (!this.works) return;
    this.render();
    const canvas = NB.el('canvas', null);
    const source = this.renderer.domElement;
    [canvas.width, canvas.height] = [source.width, source.height];
    const context = NB.context(canvas);
    context.drawImage(source, 0, 0);
    const scale = source.width / this.element.clientWidth;
    context.scale(scale, scale);
    context.font = '12px sans-serif';
    context.textBaseline = 'middle';
    for (const { element } of this.labels) {
      if (element.style.display === 'none') continue;
      const [x, y] = (element.style.transform.match(/[-\d.]+/g) || []).map(Number);
      const [w, h] = [element.offsetWidth || 100, element.offsetHeight || 18];
      context.fillStyle = 'rgba(255, 255, 255, 0.85)';
      context.fillRect(x, y, w, h);
      context.fillStyle = '#111';
      context.fillText(element.textContent, x + 4, y + h / 2);
    }
    this.image.src = canvas.toDataURL('image/png');
  }
}

/** As in the pictures: from the side of the robot that looks across to the goal, from above. */
NB.direction = ([x, y], target, axis) => {
  const ahead = [target[0] - x, target[1] - y];
  const size = Math.hypot(...ahead) || 1;
  const forward = [ahead[0] / size, ahead[1] / size];
  const across = [forward[1], -forward[0]];
  const along = axis[0] * forward[0] + axis[1] * forward[1] > 0.75 ? 0.45 : -0.45;
  return [-0.75 * across[0] + along * forward[0], -0.75 * across[1] + along * forward[1], -0.55];
};

/** A cone with a round cap about -z with its apex at the origin, as the hand's. */
NB.cone = (halfAngle, length) => {
  // Whole balls narrow down to a cone: a piece of a sphere and the mantle below it.
  const [around, rings] = [48, 8];
  const positions = [];
  /** @param {number} angle @param {number} step */
  const at = (angle, step) => {
    const turn = (2 * Math.PI * step) / around;
    return [
      length * Math.sin(angle) * Math.cos(turn),
      length * Math.sin(angle) * Math.sin(turn),
      -length * Math.cos(angle),
    ];
  };
  for (let step = 0; step < around; step++) {
    positions.push(0, 0, 0, ...at(halfAngle, step), ...at(halfAngle, step + 1));
    for (let ring = 0; ring < rings; ring++) {
      const [outer, inner] = [(halfAngle * (rings - ring)) / rings, (halfAngle * (rings - ring - 1)) / rings];
      positions.push(...at(outer, step), ...at(inner, step), ...at(outer, step + 1));
      positions.push(...at(outer, step + 1), ...at(inner, step), ...at(inner, step + 1));
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(positions), 3));
  geometry.computeVertexNormals();
  return geometry;
};
