//! Sets of voxels, a bit each.

/// Voxels of a grid, a bit each: an eightieth of a byte map's traffic for what looks at whole volumes.
///
/// A row of voxels along i starts with a word of its own; bits past its end are never set.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mask {
    size: [usize; 3],
    words_per_row: usize,
    words: Vec<u64>,
}

/// First and last voxel of a box along each axis, both inside.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct IndexBox {
    /// First voxel.
    pub first: [usize; 3],
    /// Last voxel.
    pub last: [usize; 3],
}

impl IndexBox {
    /// The whole of a grid.
    pub fn whole(size: [usize; 3]) -> Self {
        Self {
            first: [0; 3],
            last: size.map(|n| n - 1),
        }
    }

    /// Voxels along each axis.
    pub fn size(&self) -> [usize; 3] {
        [0, 1, 2].map(|axis| self.last[axis] - self.first[axis] + 1)
    }

    /// Wider by so many voxels along each axis, as far as the grid goes.
    #[must_use]
    pub fn widened(&self, by: [usize; 3], size: [usize; 3]) -> Self {
        Self {
            first: [0, 1, 2].map(|axis| self.first[axis].saturating_sub(by[axis])),
            last: [0, 1, 2].map(|axis| (self.last[axis] + by[axis]).min(size[axis] - 1)),
        }
    }

    /// The least box around this one and another one.
    #[must_use]
    pub fn joined(&self, other: &Self) -> Self {
        Self {
            first: [0, 1, 2].map(|axis| self.first[axis].min(other.first[axis])),
            last: [0, 1, 2].map(|axis| self.last[axis].max(other.last[axis])),
        }
    }

    /// What this one has in common with one that it meets.
    #[must_use]
    pub fn common(&self, other: &Self) -> Self {
        Self {
            first: [0, 1, 2].map(|axis| self.first[axis].max(other.first[axis])),
            last: [0, 1, 2].map(|axis| self.last[axis].min(other.last[axis])),
        }
    }

    /// Whether a voxel is inside.
    pub fn contains(&self, voxel: [usize; 3]) -> bool {
        (0..3).all(|axis| (self.first[axis]..=self.last[axis]).contains(&voxel[axis]))
    }
}

/// Eight bytes of 0 or 1 as eight bits, the first one lowest.
fn pack(bytes: [u8; 8]) -> u64 {
    u64::from_le_bytes(bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56
}

/// Bits of the values that are wanted, of a row.
pub(crate) fn pack_row<T: Copy>(row: &[T], out: &mut [u64], wanted: impl Fn(T) -> bool) {
    let (blocks, rest) = row.as_chunks::<64>();
    for (block, word) in blocks.iter().zip(out.iter_mut()) {
        let mut bytes = [0; 64];
        for (byte, &value) in bytes.iter_mut().zip(block) {
            *byte = u8::from(wanted(value));
        }
        let (eights, _) = bytes.as_chunks::<8>();
        *word = (0..8).fold(0, |word, at| word | pack(eights[at]) << (8 * at));
    }
    if let Some(last) = out.get_mut(blocks.len()) {
        *last = rest.iter().enumerate().fold(0, |word, (bit, &value)| {
            word | u64::from(wanted(value)) << bit
        });
    }
}

impl Mask {
    /// No voxel of a grid.
    pub fn empty(size: [usize; 3]) -> Self {
        let words_per_row = size[0].div_ceil(64);
        Self {
            size,
            words_per_row,
            words: vec![0; words_per_row * size[1] * size[2]],
        }
    }

    /// Voxels whose value is wanted; values in the order of [`needlebench_volume::VoxelGrid::offset`].
    pub fn of<T: Copy>(size: [usize; 3], values: &[T], wanted: impl Fn(T) -> bool) -> Self {
        Self::of_box(size, values, &IndexBox::whole(size), wanted)
    }

    /// The same of a box of the grid, as a mask of the box.
    pub(crate) fn of_box<T: Copy>(
        size: [usize; 3],
        values: &[T],
        within: &IndexBox,
        wanted: impl Fn(T) -> bool,
    ) -> Self {
        let mut mask = Self::empty(within.size());
        let [i, _, _] = within.first;
        let [columns, rows, slices] = mask.size;
        for (j, k) in (0..slices).flat_map(|k| (0..rows).map(move |j| (j, k))) {
            let from = ((k + within.first[2]) * size[1] + j + within.first[1]) * size[0] + i;
            pack_row(&values[from..from + columns], mask.row_mut(j, k), &wanted);
        }
        mask
    }

    /// Columns, rows, slices.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    /// Words of the row (j, k).
    pub fn row(&self, j: usize, k: usize) -> &[u64] {
        let from = (k * self.size[1] + j) * self.words_per_row;
        &self.words[from..from + self.words_per_row]
    }

    /// The same, to be changed; bits past the end of the row have to stay 0.
    pub(crate) fn row_mut(&mut self, j: usize, k: usize) -> &mut [u64] {
        let from = (k * self.size[1] + j) * self.words_per_row;
        &mut self.words[from..from + self.words_per_row]
    }

    /// Words of a row.
    pub(crate) fn words_per_row(&self) -> usize {
        self.words_per_row
    }

    /// Bits of a row's last word that stand for voxels.
    pub(crate) fn last_word(&self) -> u64 {
        u64::MAX >> (64 * self.words_per_row - self.size[0])
    }

    /// Whether a voxel is in it.
    pub fn get(&self, [i, j, k]: [usize; 3]) -> bool {
        self.row(j, k)[i / 64] >> (i % 64) & 1 == 1
    }

    /// Puts a voxel in.
    pub fn insert(&mut self, [i, j, k]: [usize; 3]) {
        self.row_mut(j, k)[i / 64] |= 1 << (i % 64);
    }

    /// Puts the voxels `from..to` of a row in.
    pub(crate) fn insert_run(&mut self, [from, to]: [usize; 2], j: usize, k: usize) {
        if from >= to {
            return;
        }
        let row = self.row_mut(j, k);
        let (first, last) = (from / 64, (to - 1) / 64);
        let low = u64::MAX << (from % 64);
        let high = u64::MAX >> (63 - (to - 1) % 64);
        if first == last {
            row[first] |= low & high;
        } else {
            row[first] |= low;
            row[first + 1..last].fill(u64::MAX);
            row[last] |= high;
        }
    }

    /// Number of voxels.
    pub fn count(&self) -> usize {
        self.words
            .iter()
            .map(|word| word.count_ones() as usize)
            .sum()
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.words.iter().all(|&word| word == 0)
    }

    /// Leaves those that another one of the same grid has too.
    pub fn intersect(&mut self, other: &Self) {
        self.combine(other, |mine, theirs| mine & theirs);
    }

    /// Adds those of another one of the same grid.
    pub fn unite(&mut self, other: &Self) {
        self.combine(other, |mine, theirs| mine | theirs);
    }

    /// Takes away those of another one of the same grid.
    pub fn subtract(&mut self, other: &Self) {
        self.combine(other, |mine, theirs| mine & !theirs);
    }

    fn combine(&mut self, other: &Self, how: impl Fn(u64, u64) -> u64) {
        assert_eq!(self.size, other.size, "masks of one grid");
        for (mine, &theirs) in self.words.iter_mut().zip(&other.words) {
            *mine = how(*mine, theirs);
        }
    }

    /// All voxels that are not in it.
    #[must_use]
    pub(crate) fn complement(&self) -> Self {
        let mut other = self.clone();
        let last = self.last_word();
        for row in other.words.chunks_exact_mut(self.words_per_row) {
            for word in row.iter_mut() {
                *word = !*word;
            }
            row[self.words_per_row - 1] &= last;
        }
        other
    }

    /// The least box around its voxels; none if it has none.
    pub fn bounds(&self) -> Option<IndexBox> {
        let mut columns = vec![0; self.words_per_row];
        let mut first = [usize::MAX; 3];
        let mut last = [0; 3];
        for k in 0..self.size[2] {
            for j in 0..self.size[1] {
                let row = self.row(j, k);
                if row.iter().all(|&word| word == 0) {
                    continue;
                }
                for (all, &word) in columns.iter_mut().zip(row) {
                    *all |= word;
                }
                first = [0, first[1].min(j), first[2].min(k)];
                last = [0, last[1].max(j), last[2].max(k)];
            }
        }
        let mut set = set_bits(&columns);
        first[0] = set.next()?;
        last[0] = set.last().unwrap_or(first[0]);
        Some(IndexBox { first, last })
    }

    /// The part within a box, as a mask of the box.
    #[must_use]
    pub(crate) fn cropped(&self, within: &IndexBox) -> Self {
        let mut cropped = Self::empty(within.size());
        let (skip, shift) = (within.first[0] / 64, within.first[0] % 64);
        let last = cropped.last_word();
        for (k, from_k) in (within.first[2]..=within.last[2]).enumerate() {
            for (j, from_j) in (within.first[1]..=within.last[1]).enumerate() {
                let from = self.row(from_j, from_k);
                let to = cropped.row_mut(j, k);
                for (at, word) in to.iter_mut().enumerate() {
                    let low = from.get(skip + at).map_or(0, |word| word >> shift);
                    let high = match (shift, from.get(skip + at + 1)) {
                        (0, _) | (_, None) => 0,
                        (_, Some(next)) => next << (64 - shift),
                    };
                    *word = low | high;
                }
                if let Some(word) = to.last_mut() {
                    *word &= last;
                }
            }
        }
        cropped
    }

    /// Adds the voxels of a mask of a box of this grid.
    pub(crate) fn unite_within(&mut self, within: &IndexBox, part: &Self) {
        for (k, to_k) in (within.first[2]..=within.last[2]).enumerate() {
            for (j, to_j) in (within.first[1]..=within.last[1]).enumerate() {
                for [from, to] in runs(part.row(j, k), part.size[0]) {
                    let run = [from, to].map(|i| i + within.first[0]);
                    self.insert_run(run, to_j, to_k);
                }
            }
        }
    }

    /// Its voxels, in the order of the data.
    pub fn voxels(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        let [_, rows, slices] = self.size;
        (0..slices)
            .flat_map(move |k| (0..rows).map(move |j| (j, k)))
            .flat_map(move |(j, k)| set_bits(self.row(j, k)).map(move |i| [i, j, k]))
    }

    /// Runs of its voxels along i in the row (j, k), `from..to`, in order.
    pub fn runs(&self, j: usize, k: usize) -> impl Iterator<Item = [usize; 2]> + '_ {
        runs(self.row(j, k), self.size[0])
    }
}

/// Numbers of the bits that are set, in order.
pub(crate) fn set_bits(words: &[u64]) -> impl Iterator<Item = usize> + '_ {
    words.iter().enumerate().flat_map(|(at, &word)| {
        std::iter::successors((word != 0).then_some(word), |word| {
            let rest = word & (word - 1);
            (rest != 0).then_some(rest)
        })
        .map(move |word| 64 * at + word.trailing_zeros() as usize)
    })
}

/// Runs of set bits among the first `length`, `from..to`, in order.
fn runs(words: &[u64], length: usize) -> impl Iterator<Item = [usize; 2]> + '_ {
    // Where the next bit of a kind is, at or after `from`.
    let next = move |from: usize, flip: u64| {
        let mut at = from / 64;
        let mut word = (words.get(at)? ^ flip) & (u64::MAX << (from % 64));
        while word == 0 {
            at += 1;
            word = words.get(at)? ^ flip;
        }
        Some(64 * at + word.trailing_zeros() as usize)
    };
    let mut done = 0;
    std::iter::from_fn(move || {
        let from = next(done, 0)?;
        let to = next(from, u64::MAX).unwrap_or(length).min(length);
        done = to;
        Some([from, to])
    })
}

#[cfg(test)]
mod tests {
    use needlebench_numerics::random::SplitMix64;

    use super::*;

    fn random_values(size: [usize; 3], seed: u64) -> Vec<i16> {
        let mut random = SplitMix64::new(seed);
        (0..size.iter().product())
            .map(|_| if random.below(3) == 0 { 100 } else { -100 })
            .collect()
    }

    #[test]
    fn bits_are_those_of_the_values() {
        for nx in [1, 7, 63, 64, 65, 130, 192] {
            let size = [nx, 3, 2];
            let values = random_values(size, nx as u64);
            let mask = Mask::of(size, &values, |value| value > 0);
            let mut by_runs = Mask::empty(size);
            let mut count = 0;
            for k in 0..2 {
                for j in 0..3 {
                    for run in mask.runs(j, k) {
                        by_runs.insert_run(run, j, k);
                    }
                    for i in 0..nx {
                        let wanted = values[(k * 3 + j) * nx + i] > 0;
                        assert_eq!(mask.get([i, j, k]), wanted);
                        count += usize::from(wanted);
                    }
                }
            }
            assert_eq!(mask, by_runs);
            assert_eq!(mask.count(), count);
            assert_eq!(
                mask.complement().count(),
                size.iter().product::<usize>() - count
            );
            assert_eq!(mask.complement().complement(), mask);
            assert_eq!(mask.voxels().count(), count);
        }
    }

    #[test]
    fn crop_and_paste_give_the_box_back() {
        let size = [150, 9, 7];
        let mask = Mask::of(size, &random_values(size, 5), |value| value > 0);
        let within = IndexBox {
            first: [13, 2, 1],
            last: [140, 7, 6],
        };
        let cropped = mask.cropped(&within);
        let mut pasted = Mask::empty(size);
        pasted.unite_within(&within, &cropped);
        for k in 0..7 {
            for j in 0..9 {
                for i in 0..150 {
                    let inside = within.contains([i, j, k]);
                    assert_eq!(pasted.get([i, j, k]), inside && mask.get([i, j, k]));
                }
            }
        }
        assert_eq!(cropped.count(), pasted.count());
    }

    #[test]
    fn bounds_hold_all_voxels_and_no_more() {
        let mut mask = Mask::empty([100, 10, 10]);
        assert_eq!(mask.bounds(), None);
        mask.insert([70, 3, 9]);
        mask.insert([5, 4, 2]);
        let bounds = IndexBox {
            first: [5, 3, 2],
            last: [70, 4, 9],
        };
        assert_eq!(mask.bounds(), Some(bounds));
    }
}
