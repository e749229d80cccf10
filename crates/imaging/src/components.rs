//! Connected components of a mask.
//!
//! Rows are taken as runs of voxels, and runs that touch are joined in a forest: work goes with the number of runs,
//! not of voxels.

use crate::mask::{IndexBox, Mask};

/// Which voxels touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Connectivity {
    /// Those that share a face: 6 neighbours.
    Faces,
    /// Those that share a corner: 26 neighbours.
    Corners,
}

/// Voxels of one row that follow each other, `from..to`, and the component that they are of.
#[derive(Debug, Clone, Copy)]
struct Run {
    from: u32,
    to: u32,
    /// While they are joined: a run that stands above this one. Then: the component.
    part: u32,
}

/// A connected component.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Component {
    /// Number of voxels.
    pub voxels: usize,
    /// The least box around it.
    pub bounds: IndexBox,
    /// Sum of its voxels' indices along each axis.
    index_sums: [u64; 3],
}

impl Component {
    /// Mean of its voxels' indices.
    pub fn centroid(&self) -> [f64; 3] {
        self.index_sums.map(|sum| sum as f64 / self.voxels as f64)
    }
}

/// Connected components of a mask, in the order of their first voxels in the data.
#[derive(Debug, Clone)]
pub struct Components {
    size: [usize; 3],
    runs: Vec<Run>,
    /// The first run of each row, and the end of the last one.
    row_starts: Vec<u32>,
    parts: Vec<Component>,
}

impl Components {
    /// Of a mask.
    pub fn of(mask: &Mask, connectivity: Connectivity) -> Self {
        let size = mask.size();
        let mut forest = Self {
            size,
            runs: Vec::new(),
            row_starts: Vec::with_capacity(size[1] * size[2] + 1),
            parts: Vec::new(),
        };
        for k in 0..size[2] {
            for j in 0..size[1] {
                forest.row_starts.push(number(forest.runs.len()));
                for [from, to] in mask.runs(j, k) {
                    let part = number(forest.runs.len());
                    let [from, to] = [number(from), number(to)];
                    forest.runs.push(Run { from, to, part });
                }
                forest.join_row([j, k], connectivity);
            }
        }
        forest.row_starts.push(number(forest.runs.len()));
        forest.number_parts();
        forest
    }

    /// Joins the runs of the last row with those of its neighbours before it.
    fn join_row(&mut self, [j, k]: [usize; 2], connectivity: Connectivity) {
        let rows = self.size[1];
        let (slack, neighbours): (u32, &[[isize; 2]]) = match connectivity {
            Connectivity::Faces => (0, &[[-1, 0], [0, -1]]),
            Connectivity::Corners => (1, &[[-1, 0], [-1, -1], [0, -1], [1, -1]]),
        };
        for &[dj, dk] in neighbours {
            let row = j.checked_add_signed(dj).filter(|&j| j < rows);
            if let Some((j, k)) = row.zip(k.checked_add_signed(dk)) {
                self.join_with(k * rows + j, slack);
            }
        }
    }

    fn join_with(&mut self, row: usize, slack: u32) {
        let mut other = self.row_starts[row] as usize;
        let others = self.row_starts[row + 1] as usize;
        let mut mine = *self.row_starts.last().unwrap_or(&0) as usize;
        while mine < self.runs.len() && other < others {
            let (a, b) = (self.runs[mine], self.runs[other]);
            if a.from < b.to + slack && b.from < a.to + slack {
                let (root, below) = (self.root(other), self.root(mine));
                let [root, below] = [root.min(below), root.max(below)];
                self.runs[below as usize].part = root;
            }
            if a.to < b.to {
                mine += 1;
            } else {
                other += 1;
            }
        }
    }

    fn root(&mut self, run: usize) -> u32 {
        let mut run = number(run);
        loop {
            let above = self.runs[run as usize].part;
            if above == run {
                return run;
            }
            let next = self.runs[above as usize].part;
            self.runs[run as usize].part = next;
            run = next;
        }
    }

    /// Every run is below one before it: one pass in order puts the component's number in place.
    fn number_parts(&mut self) {
        let rows = self.size[1];
        for row in 0..self.row_starts.len() - 1 {
            let [j, k] = [row % rows, row / rows];
            for at in self.row_starts[row] as usize..self.row_starts[row + 1] as usize {
                let Run { from, to, part } = self.runs[at];
                let is_root = part as usize == at;
                let part = if is_root {
                    self.parts.push(Component {
                        voxels: 0,
                        bounds: IndexBox {
                            first: [usize::MAX; 3],
                            last: [0; 3],
                        },
                        index_sums: [0; 3],
                    });
                    self.parts.len() - 1
                } else {
                    self.runs[part as usize].part as usize
                };
                self.runs[at].part = number(part);
                self.parts[part].add(from as usize, to as usize, j, k);
            }
        }
    }

    /// The components.
    pub fn parts(&self) -> &[Component] {
        &self.parts
    }

    /// Number of the largest one; of equals the first.
    pub fn largest(&self) -> Option<usize> {
        (0..self.parts.len())
            .rev()
            .max_by_key(|&part| self.parts[part].voxels)
    }

    /// Number of the component that a voxel is of, if it is of one.
    pub(crate) fn part_at(&self, [i, j, k]: [usize; 3]) -> Option<usize> {
        let row = k * self.size[1] + j;
        let runs = &self.runs[self.row_starts[row] as usize..self.row_starts[row + 1] as usize];
        let at = runs.partition_point(|run| run.to as usize <= i);
        let run = runs.get(at).filter(|run| run.from as usize <= i)?;
        Some(run.part as usize)
    }

    /// Runs as `(part, from..to, j, k)`, in the order of the data.
    pub fn runs(&self) -> impl Iterator<Item = (usize, [usize; 2], usize, usize)> + '_ {
        let rows = self.size[1];
        self.row_starts
            .windows(2)
            .enumerate()
            .flat_map(move |(row, ends)| {
                self.runs[ends[0] as usize..ends[1] as usize]
                    .iter()
                    .map(move |run| {
                        let part = run.part as usize;
                        (
                            part,
                            [run.from, run.to].map(|i| i as usize),
                            row % rows,
                            row / rows,
                        )
                    })
            })
    }

    /// Voxels of the components that are wanted.
    pub fn mask_of(&self, wanted: impl Fn(usize) -> bool) -> Mask {
        let wanted: Vec<bool> = (0..self.parts.len()).map(wanted).collect();
        let mut mask = Mask::empty(self.size);
        for (part, run, j, k) in self.runs() {
            if wanted[part] {
                mask.insert_run(run, j, k);
            }
        }
        mask
    }
}

impl Component {
    fn add(&mut self, from: usize, to: usize, j: usize, k: usize) {
        let length = to - from;
        self.voxels += length;
        let [first, last] = [[from, j, k], [to - 1, j, k]];
        for axis in 0..3 {
            self.bounds.first[axis] = self.bounds.first[axis].min(first[axis]);
            self.bounds.last[axis] = self.bounds.last[axis].max(last[axis]);
        }
        let sum = length * (from + to - 1) / 2;
        for (total, more) in self
            .index_sums
            .iter_mut()
            .zip([sum, j * length, k * length])
        {
            *total += more as u64;
        }
    }
}

/// Indices along an axis and numbers of runs. More than 4 billion runs would take 50 GB.
fn number(index: usize) -> u32 {
    u32::try_from(index).expect("runs and voxels of a row fit in 32 bits")
}

#[cfg(test)]
mod tests {
    use needlebench_numerics::random::SplitMix64;

    use super::*;

    /// Component numbers by flooding from every voxel in the order of the data.
    fn flooded(mask: &Mask, connectivity: Connectivity) -> Vec<Option<usize>> {
        let [nx, ny, nz] = mask.size();
        let mut parts = vec![None; nx * ny * nz];
        let mut count = 0;
        for start in mask.voxels() {
            let offset = |[i, j, k]: [usize; 3]| (k * ny + j) * nx + i;
            if parts[offset(start)].is_some() {
                continue;
            }
            parts[offset(start)] = Some(count);
            let mut stack = vec![start];
            while let Some(at) = stack.pop() {
                for step in 0..27_usize {
                    let step = [step % 3, step / 3 % 3, step / 9];
                    let axes = step.iter().filter(|&&s| s != 1).count();
                    let touches = match connectivity {
                        Connectivity::Faces => axes == 1,
                        Connectivity::Corners => axes > 0,
                    };
                    let next = [0, 1, 2].map(|axis| (at[axis] + step[axis]).wrapping_sub(1));
                    let inside = next[0] < nx && next[1] < ny && next[2] < nz;
                    if touches && inside && mask.get(next) && parts[offset(next)].is_none() {
                        parts[offset(next)] = Some(count);
                        stack.push(next);
                    }
                }
            }
            count += 1;
        }
        parts
    }

    #[test]
    fn components_are_those_of_flooding() {
        let mut random = SplitMix64::new(3);
        for (case, connectivity) in [Connectivity::Faces, Connectivity::Corners]
            .into_iter()
            .flat_map(|each| (0..12).map(move |case| (case, each)))
        {
            let size = [1 + 9 * case, 1 + case % 7, 1 + case % 5];
            let density = 1 + random.below(6);
            let values: Vec<u8> = (0..size.iter().product())
                .map(|_| u8::from(random.below(10) < density))
                .collect();
            let mask = Mask::of(size, &values, |value| value == 1);
            let components = Components::of(&mask, connectivity);
            let by_flood = flooded(&mask, connectivity);
            let mut at = 0;
            for k in 0..size[2] {
                for j in 0..size[1] {
                    for i in 0..size[0] {
                        assert_eq!(components.part_at([i, j, k]), by_flood[at], "{size:?}");
                        at += 1;
                    }
                }
            }
            for (part, component) in components.parts().iter().enumerate() {
                let alone = components.mask_of(|each| each == part);
                assert_eq!(component.voxels, alone.count());
                assert_eq!(Some(component.bounds), alone.bounds());
            }
        }
    }

    #[test]
    fn an_empty_mask_has_none() {
        let components = Components::of(&Mask::empty([70, 2, 3]), Connectivity::Faces);
        assert!(components.parts().is_empty());
        assert_eq!(components.largest(), None);
    }
}
