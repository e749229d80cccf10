//! Fewer triangles for a closed manifold, by collapsing edges.
//!
//! Quadrics after Garland and Heckbert, *Surface simplification using quadric error metrics*, 1997. An edge collapses
//! only if its ends have exactly two neighbours in common (the link condition of Dey and others, 1999), so that the
//! mesh stays a manifold of the same topology, and if no triangle turns over or becomes a sliver. Edges are taken in
//! passes of rising cost, and within a pass as they lie in the mesh and in memory, rather than from a queue: a tenth of
//! the time, and the same on every machine.

use nalgebra::{Point3, Vector3};
use needlebench_geometry::TriangleMesh;

use crate::spacing::whole;

/// Weight of staying where an edge is, relative to the planes' : decides where they do not.
const KEEP: f64 = 1e-3;

/// Cosine of the angle by which a collapse may turn a triangle, at most.
const TURN: f64 = 0.3;

/// Area of a triangle over its longest edge squared, at least: a height of a fiftieth.
const SLIVER: f64 = 0.02;

/// Share of the triangles that are to go in one pass.
const PASS: f64 = 0.35;

/// Passes that take hardly anything end it.
const STALLED: usize = 3;

/// Removes triangles until at most `target` are left, as long as no vertex leaves its planes by more than `error_m` on
/// average.
pub(crate) fn simplify(mesh: &TriangleMesh, target: usize, error_m: f64) -> TriangleMesh {
    let mut work = Collapse::new(mesh, error_m);
    let mut stalled = 0;
    while work.alive > target && stalled < STALLED {
        let before = work.alive;
        work.pass(target);
        // The last few of many may need many passes.
        stalled = if before - work.alive < before / 100 {
            stalled + 1
        } else {
            0
        };
    }
    work.finish()
}

/// Sum of squared distances from planes, as a quadratic form, and the planes' weight.
#[derive(Debug, Clone, Copy, Default)]
struct Quadric {
    /// xx, xy, xz, yy, yz, zz.
    a: [f64; 6],
    b: Vector3<f64>,
    c: f64,
    weight: f64,
}

impl Quadric {
    fn of_plane(normal: &Vector3<f64>, point: &Vector3<f64>, weight: f64) -> Self {
        let d = -normal.dot(point);
        let n = normal * weight;
        Self {
            a: [
                n.x * normal.x,
                n.x * normal.y,
                n.x * normal.z,
                n.y * normal.y,
                n.y * normal.z,
                n.z * normal.z,
            ],
            b: n * d,
            c: weight * d * d,
            weight,
        }
    }

    fn add(&mut self, other: &Self) {
        for (mine, theirs) in self.a.iter_mut().zip(other.a) {
            *mine += theirs;
        }
        self.b += other.b;
        self.c += other.c;
        self.weight += other.weight;
    }

    fn at(&self, p: &Vector3<f64>) -> f64 {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let q = Vector3::new(
            xx * p.x + xy * p.y + xz * p.z,
            xy * p.x + yy * p.y + yz * p.z,
            xz * p.x + yz * p.y + zz * p.z,
        );
        p.dot(&q) + 2.0 * self.b.dot(p) + self.c
    }

    /// Where it is least, held near a point where the planes leave it open.
    fn least_near(&self, near: &Vector3<f64>) -> Vector3<f64> {
        let keep = KEEP * self.weight;
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let [xx, yy, zz] = [xx + keep, yy + keep, zz + keep];
        // Cramer's rule.
        let [a, b, c] = [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy];
        let [d, e, f] = [xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy];
        let determinant = xx * a + xy * b + xz * c;
        if determinant <= 0.0 {
            return *near;
        }
        let r = near * keep - self.b;
        let place = Vector3::new(
            a * r.x + b * r.y + c * r.z,
            b * r.x + d * r.y + e * r.z,
            c * r.x + e * r.y + f * r.z,
        );
        place / determinant
    }
}

/// An edge that may collapse.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    cost: f32,
    edge: [u32; 2],
}

struct Collapse {
    /// In millimetres from `origin`: about 1, as quadrics like it.
    at: Vec<Vector3<f64>>,
    quadrics: Vec<Quadric>,
    triangles: Vec<[u32; 3]>,
    dead: Vec<bool>,
    alive: usize,
    /// Where the triangles of each vertex are in `uses`, and how many; dead ones are among them.
    used: Vec<[u32; 2]>,
    uses: Vec<u32>,
    /// Numbers of marks that a vertex has been given, to find what two rings share.
    marks: Vec<u32>,
    mark: u32,
    /// Pass in which a vertex last changed.
    changed: Vec<u32>,
    pass: u32,
    origin: Point3<f64>,
    most_mean_square: f64,
}

const MM: f64 = 1e3;

impl Collapse {
    fn new(mesh: &TriangleMesh, error_m: f64) -> Self {
        let origin = mesh
            .vertices_m
            .first()
            .copied()
            .unwrap_or_else(Point3::origin);
        let at: Vec<Vector3<f64>> = mesh.vertices_m.iter().map(|v| (v - origin) * MM).collect();
        let mut quadrics = vec![Quadric::default(); at.len()];
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|vertex| at[vertex as usize]);
            let normal = (b - a).cross(&(c - a));
            let doubled = normal.norm();
            if doubled > 0.0 {
                let plane = Quadric::of_plane(&(normal / doubled), &a, doubled);
                for &vertex in triangle {
                    quadrics[vertex as usize].add(&plane);
                }
            }
        }
        let count = at.len();
        Self {
            at,
            quadrics,
            triangles: mesh.triangles.clone(),
            dead: vec![false; mesh.triangles.len()],
            alive: mesh.triangles.len(),
            used: vec![[0; 2]; count],
            uses: Vec::new(),
            marks: vec![0; count],
            mark: 0,
            changed: vec![0; count],
            pass: 0,
            origin,
            most_mean_square: (error_m * MM).powi(2),
        }
    }

    /// Leaves dead triangles out and lists the triangles of every vertex anew.
    fn tidy(&mut self) {
        let mut kept = 0;
        for at in 0..self.triangles.len() {
            if !self.dead[at] {
                self.triangles[kept] = self.triangles[at];
                kept += 1;
            }
        }
        self.triangles.truncate(kept);
        self.dead.clear();
        self.dead.resize(kept, false);
        self.used.fill([0; 2]);
        for &vertex in self.triangles.iter().flatten() {
            self.used[vertex as usize][1] += 1;
        }
        let mut start = 0;
        for used in &mut self.used {
            used[0] = start;
            start += used[1];
            used[1] = 0;
        }
        self.uses.clear();
        self.uses.resize(3 * kept, 0);
        for (number, triangle) in (0_u32..).zip(&self.triangles) {
            for &vertex in triangle {
                let used = &mut self.used[vertex as usize];
                self.uses[(used[0] + used[1]) as usize] = number;
                used[1] += 1;
            }
        }
    }

    fn pass(&mut self, target: usize) {
        self.tidy();
        self.pass += 1;
        let candidates = self.candidates();
        // An edge takes two triangles with it; some will be refused.
        let wanted = self.alive - target.max(whole(self.alive as f64 * (1.0 - PASS)));
        let taken = (wanted * 3 / 4).clamp(1, candidates.len().max(1));
        let most = highest_of_lowest(&candidates, taken);
        for Candidate { edge: [a, b], cost } in candidates {
            if cost > most {
                continue;
            }
            if self.alive <= target {
                return;
            }
            let [a, b] = [a as usize, b as usize];
            if self.quadrics[a].weight < 0.0 || self.quadrics[b].weight < 0.0 {
                continue;
            }
            let moved = self.changed[a] == self.pass || self.changed[b] == self.pass;
            let (cost, place, allowed) = self.cost([a, b]);
            if allowed && (!moved || cost <= most) {
                self.try_collapse([a, b], &place);
            }
        }
    }

    /// Each edge once, with what its collapse costs.
    fn candidates(&self) -> Vec<Candidate> {
        let mut found = Vec::with_capacity(self.triangles.len() * 3 / 2);
        for &[a, b, c] in &self.triangles {
            for [from, to] in [[a, b], [b, c], [c, a]] {
                // Every edge runs both ways.
                if from < to {
                    let (cost, _, allowed) = self.cost([from as usize, to as usize]);
                    if allowed {
                        found.push(Candidate {
                            cost,
                            edge: [from, to],
                        });
                    }
                }
            }
        }
        found
    }

    fn cost(&self, [a, b]: [usize; 2]) -> (f32, Vector3<f64>, bool) {
        let mut quadric = self.quadrics[a];
        quadric.add(&self.quadrics[b]);
        let middle = 0.5 * (self.at[a] + self.at[b]);
        let place = quadric.least_near(&middle);
        let error = quadric.at(&place).max(0.0);
        let keep = KEEP * quadric.weight * (self.at[a] - self.at[b]).norm_squared();
        let allowed = error <= self.most_mean_square * quadric.weight;
        #[expect(
            clippy::cast_possible_truncation,
            reason = "an order is wanted, not a value"
        )]
        let cost = (error + KEEP * keep) as f32;
        (cost, place, allowed)
    }

    fn triangles_of(&self, vertex: usize) -> impl Iterator<Item = u32> + '_ {
        let [start, count] = self.used[vertex];
        self.uses[start as usize..(start + count) as usize]
            .iter()
            .copied()
            .filter(|&triangle| !self.dead[triangle as usize])
    }

    fn try_collapse(&mut self, [a, b]: [usize; 2], place: &Vector3<f64>) {
        if !self.keeps_topology([a, b]) || !self.keeps_shape([a, b], place) {
            return;
        }
        let start = number(self.uses.len());
        for vertex in [a, b] {
            let [from, count] = self.used[vertex];
            for at in from..from + count {
                let triangle = self.uses[at as usize];
                if self.dead[triangle as usize] {
                    continue;
                }
                let corners = &mut self.triangles[triangle as usize];
                let has = |vertex: usize| corners.contains(&number(vertex));
                if has(a) && has(b) {
                    self.dead[triangle as usize] = true;
                    self.alive -= 1;
                    continue;
                }
                for corner in corners {
                    if *corner as usize == b {
                        *corner = number(a);
                    }
                }
                self.uses.push(triangle);
            }
        }
        self.used[a] = [start, number(self.uses.len()) - start];
        self.at[a] = *place;
        let other = self.quadrics[b];
        self.quadrics[a].add(&other);
        // Gone.
        self.quadrics[b].weight = -1.0;
        self.changed[a] = self.pass;
    }

    /// Whether the ends have two neighbours in common, no more, and these keep three triangles.
    fn keeps_topology(&mut self, [a, b]: [usize; 2]) -> bool {
        self.mark += 2;
        let (of_a, shared) = (self.mark, self.mark + 1);
        let [start, count] = self.used[a];
        for at in start..start + count {
            let triangle = self.uses[at as usize] as usize;
            if !self.dead[triangle] {
                for vertex in self.triangles[triangle] {
                    self.marks[vertex as usize] = of_a;
                }
            }
        }
        if self.marks[b] != of_a {
            return false;
        }
        self.marks[a] = 0;
        self.marks[b] = 0;
        let mut in_common = [0; 2];
        let mut count_in_common = 0;
        let [start, count] = self.used[b];
        for at in start..start + count {
            let triangle = self.uses[at as usize] as usize;
            if self.dead[triangle] {
                continue;
            }
            for vertex in self.triangles[triangle] {
                let vertex = vertex as usize;
                if self.marks[vertex] == of_a {
                    self.marks[vertex] = shared;
                    if count_in_common == 2 {
                        return false;
                    }
                    in_common[count_in_common] = vertex;
                    count_in_common += 1;
                }
            }
        }
        count_in_common == 2
            && in_common
                .iter()
                .all(|&vertex| self.triangles_of(vertex).count() > 3)
    }

    /// Whether no triangle turns over or becomes a sliver.
    fn keeps_shape(&self, [a, b]: [usize; 2], place: &Vector3<f64>) -> bool {
        [[a, b], [b, a]].into_iter().all(|[vertex, other]| {
            self.triangles_of(vertex).all(|triangle| {
                let corners = self.triangles[triangle as usize].map(|corner| corner as usize);
                if corners.contains(&other) {
                    return true;
                }
                let before = corners.map(|corner| self.at[corner]);
                let after = corners.map(|corner| {
                    if corner == vertex {
                        *place
                    } else {
                        self.at[corner]
                    }
                });
                let [old, new] = [before, after].map(|[p, q, r]| (q - p).cross(&(r - p)));
                let [p, q, r] = after;
                let longest = (q - p)
                    .norm_squared()
                    .max((r - q).norm_squared())
                    .max((p - r).norm_squared());
                let [area, before] = [new, old].map(|doubled| doubled.norm_squared());
                // What was a sliver already may stay one.
                let thin = area < (2.0 * SLIVER * longest).powi(2) && area < before;
                let along = new.dot(&old);
                !thin && along > 0.0 && along * along > TURN * TURN * area * before
            })
        })
    }

    fn finish(mut self) -> TriangleMesh {
        self.tidy();
        let mut numbers = vec![u32::MAX; self.at.len()];
        let mut vertices_m = Vec::new();
        for corner in self.triangles.iter_mut().flatten() {
            let vertex = *corner as usize;
            if numbers[vertex] == u32::MAX {
                numbers[vertex] = number(vertices_m.len());
                vertices_m.push(self.origin + self.at[vertex] / MM);
            }
            *corner = numbers[vertex];
        }
        TriangleMesh {
            vertices_m,
            triangles: self.triangles,
        }
    }
}

/// The highest cost of so many candidates that cost least.
fn highest_of_lowest(candidates: &[Candidate], count: usize) -> f32 {
    let mut costs: Vec<f32> = candidates.iter().map(|candidate| candidate.cost).collect();
    if count >= costs.len() {
        return f32::INFINITY;
    }
    *costs.select_nth_unstable_by(count, f32::total_cmp).1
}

fn number(index: usize) -> u32 {
    u32::try_from(index).expect("a mesh has fewer than 4 billion corners")
}
