// The room in three dimensions: patient, robot in the chosen configuration, needle, and its motion.
'use strict';

class Room {
  /** @param {PlanDocument} page @param {CaseFacts} facts */
  constructor(page, facts) {
    this.page = page;
    this.facts = facts;
    this.view = new View(page.scene, 'Room with patient and robot');
    this.known = facts.robot_is_unknown === null;
    this.playing = 0;
    this.place = facts.world_from_phantom && NB.matrix(facts.world_from_phantom);
    if (!this.view.works) return;
    /** @type {ArmView} */
    this.arm = this.view.arm('arm');
    this.view.show('corridor', false);
    this.arm.layer('collision', false);
    this.arm.layer('corridor', false);
    this.pose(page.start);
    for (const lesion of facts.lesions)
      this.view.ball('lesions', this.world(lesion.center_m), 0.5 * (lesion.diameter_m || 0.01), [0.8, 0.47, 0.65, 1]);
    for (const marker of facts.markers)
      this.view.ball(
        `marker ${marker.name}`,
        this.world(marker.center_m),
        0.5 * marker.diameter_m,
        [0.34, 0.71, 0.91, 1],
      );
    if (!this.known) {
      this.arm.show(false);
      for (const part of ['robot', 'mount']) this.view.show(part, false);
    }
    this.home();
  }

  /**
   * A place of ct in the world.
   * @param {Point} ct
   */
  world(ct) {
    const phantom = PLAN.add(ct, this.facts.phantom_origin_m, -1);
    return this.place ? new THREE.Vector3().fromArray(phantom).applyMatrix4(this.place).toArray() : phantom;
  }

  /** @param {RouteAnswer | null} [route] */
  home(route = null) {
    if (!this.view.works || !this.place) return;
    const middle = route
      ? route.target_m
      : PLAN.add(
          this.facts.first_voxel_m,
          this.facts.size.map((count, axis) => (count * this.facts.spacing_m[axis]) / 2),
        );
    const at = this.world(middle);
    const near = [-0.2, 0.2].flatMap((x) =>
      [-0.2, 0.2].flatMap((y) => [-0.2, 0.2].map((z) => PLAN.add(at, [x, y, z]))),
    );
    const base = this.page.scene.chain.base;
    this.view.frame(this.known ? [...NB.aboutBase(base, 0.55), ...near] : near, NB.direction(base, at, [0, 0, -1]));
  }

  /** @param {number[] | null} joints */
  pose(joints) {
    if (this.view.works && joints) {
      this.arm.pose(this.page.scene.chain, joints);
      this.view.draw();
    }
  }

  /** @param {RouteAnswer | null} route */
  needle(route) {
    if (!this.view.works) return;
    this.view.empty('needle');
    if (route) {
      const [entry, target] = [route.entry_m, route.target_m].map((place) => this.world(place));
      const radius = Math.max(this.facts.needle_diameter_m / 2, 0.0008);
      this.view.rod('needle', entry, target, radius, [0.94, 0.89, 0.26, 1], true);
      this.view.ball('needle', target, 0.0025, [0.9, 0.62, 0, 1], true);
      this.view.ball('needle', entry, 0.0025, [0.34, 0.71, 0.91, 1], true);
    }
    this.view.draw();
  }

  /** @param {string} name @param {boolean} visible */
  marker(name, visible) {
    if (this.view.works) this.view.show(`marker ${name}`, visible);
  }

  /**
   * Plays a motion; `told(time, whole)` follows it.
   * @param {MotionAnswer} motion
   * @param {(time: number, whole: number) => void} told
   */
  play(motion, told) {
    this.stop();
    if (!this.view.works || !motion.time_s.length) return;
    const began = performance.now();
    const last = motion.time_s.length - 1;
    const frame = () => {
      const time = Math.min((performance.now() - began) / 1e3, motion.time_s[last]);
      this.pose(PLAN.posture(motion, time));
      told(time, motion.time_s[last]);
      this.playing = time < motion.time_s[last] ? requestAnimationFrame(frame) : 0;
    };
    frame();
  }

  stop() {
    if (this.playing) cancelAnimationFrame(this.playing);
    this.playing = 0;
  }
}

/** Joints at a time, between postures. */
PLAN.posture = ({ time_s: times, joints_rad: joints }, time) => {
  let next = times.findIndex((each) => each >= time);
  if (next < 0) next = times.length - 1;
  if (next === 0) return joints[0];
  const share = (time - times[next - 1]) / (times[next] - times[next - 1] || 1);
  return joints[next].map((value, joint) => joints[next - 1][joint] + share * (value - joints[next - 1][joint]));
};
