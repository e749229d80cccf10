//! Silhouettes as rows of bits: filled, eroded and dilated by discs a word at a time.

/// A slice of bits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bits {
    width: usize,
    height: usize,
    words: usize,
    rows: Vec<u64>,
}

/// Half widths of a disc's rows, from its middle row outwards.
pub fn disc(radius_rows: f64, radius_columns: f64) -> Vec<usize> {
    (0..=radius_rows as usize)
        .map(|dy| {
            let share = dy as f64 / radius_rows.max(1e-9);
            (radius_columns * (1.0 - share * share).max(0.0).sqrt()) as usize
        })
        .collect()
}

impl Bits {
    /// Of this size, none set.
    pub fn new(width: usize, height: usize) -> Self {
        let words = width.div_ceil(64);
        Self {
            width,
            height,
            words,
            rows: vec![0; words * height],
        }
    }

    /// Sets a bit.
    pub fn set(&mut self, x: usize, y: usize) {
        self.rows[y * self.words + x / 64] |= 1 << (x % 64);
    }

    /// Whether a bit is set.
    #[cfg(test)]
    pub fn get(&self, x: usize, y: usize) -> bool {
        self.rows[y * self.words + x / 64] >> (x % 64) & 1 == 1
    }

    fn row(&self, y: usize) -> &[u64] {
        &self.rows[y * self.words..(y + 1) * self.words]
    }

    /// The bits beyond the width cleared.
    fn trimmed(mut self) -> Self {
        let spare = self.words * 64 - self.width;
        if spare > 0 {
            for y in 0..self.height {
                self.rows[(y + 1) * self.words - 1] &= u64::MAX >> spare;
            }
        }
        self
    }

    /// What is not set.
    pub fn inverted(&self) -> Self {
        let rows = self.rows.iter().map(|word| !word).collect();
        Self { rows, ..*self }.trimmed()
    }

    /// What is set here and not there.
    pub fn without(&self, other: &Self) -> Self {
        let rows = self
            .rows
            .iter()
            .zip(&other.rows)
            .map(|(a, b)| a & !b)
            .collect();
        Self { rows, ..*self }
    }

    /// Everything within a disc of what is set; nothing comes in over the border.
    pub fn dilated(&self, disc: &[usize]) -> Self {
        let mut out = Self::new(self.width, self.height);
        let mut wide = vec![0; self.words];
        for y in 0..self.height {
            if self.row(y).iter().all(|&word| word == 0) {
                continue;
            }
            for (dy, &half) in disc.iter().enumerate().rev() {
                // From the narrowest row to the widest, each grown from the one before.
                if dy + 1 == disc.len() {
                    wide.copy_from_slice(self.row(y));
                    widen(&mut wide, half);
                } else {
                    widen(&mut wide, half - disc[dy + 1]);
                }
                for to in [y.checked_sub(dy), Some(y + dy)].into_iter().flatten() {
                    if to < self.height {
                        let start = to * self.words;
                        for (word, add) in out.rows[start..start + self.words].iter_mut().zip(&wide)
                        {
                            *word |= add;
                        }
                    }
                }
            }
        }
        out.trimmed()
    }

    /// What has a disc's radius around it; beyond the border all counts as set.
    pub fn eroded(&self, disc: &[usize]) -> Self {
        self.inverted().dilated(disc).inverted()
    }

    /// With everything set that has no way to the border along rows and columns.
    pub fn filled(&self) -> Self {
        let air = self.inverted();
        let mut runs: Vec<(usize, Run)> = Vec::new();
        let mut groups = Groups::default();
        let mut before = 0..0;
        for y in 0..self.height {
            let start = runs.len();
            for run in air.runs(y) {
                let border =
                    y == 0 || y + 1 == self.height || run.from == 0 || run.to == self.width;
                let own = groups.push();
                if border {
                    groups.join(own, OUTSIDE);
                }
                for index in before.clone() {
                    if run.touches(&runs[index].1) {
                        groups.join(own, index + 1);
                    }
                }
                runs.push((y, run));
            }
            before = start..runs.len();
        }
        let mut filled = Self::new(self.width, self.height);
        filled.rows.fill(u64::MAX);
        for (index, (y, run)) in runs.iter().enumerate() {
            if groups.root(index + 1) == groups.root(OUTSIDE) {
                for x in run.from..run.to {
                    filled.rows[y * self.words + x / 64] &= !(1 << (x % 64));
                }
            }
        }
        filled.trimmed()
    }

    /// Stretches of set bits of a row, from left to right.
    pub fn runs(&self, y: usize) -> Vec<Run> {
        let mut runs = Vec::new();
        let mut x = 0;
        while let Some(from) = self.next(y, x, true) {
            let to = self.next(y, from, false).unwrap_or(self.width);
            runs.push(Run { from, to });
            x = to;
        }
        runs
    }

    /// The first bit from `x` on that is set, or that is not.
    fn next(&self, y: usize, x: usize, set: bool) -> Option<usize> {
        let mut x = x;
        while x < self.width {
            let word = self.rows[y * self.words + x / 64];
            let word = (if set { word } else { !word }) >> (x % 64);
            if word != 0 {
                let found = x + word.trailing_zeros() as usize;
                return (found < self.width).then_some(found);
            }
            x = (x / 64 + 1) * 64;
        }
        None
    }
}

/// Set bits from one column up to another, which is not one of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Run {
    /// First column.
    pub from: usize,
    /// One past the last.
    pub to: usize,
}

impl Run {
    /// Whether two runs of neighbouring rows share a column.
    pub fn touches(&self, other: &Self) -> bool {
        self.from < other.to && other.from < self.to
    }
}

/// Every bit within `by` columns of a set one set.
fn widen(row: &mut [u64], by: usize) {
    let mut left = by;
    // Set stretches double: a shift by at most the width that is there leaves no hole.
    let mut width = 1;
    while left > 0 {
        let step = left.min(width).min(63);
        let mut carry = 0;
        let mut grown: Vec<u64> = row
            .iter()
            .map(|&word| {
                let up = (word << step) | carry;
                carry = word >> (64 - step);
                word | up
            })
            .collect();
        carry = 0;
        for (word, &old) in grown.iter_mut().zip(row.iter()).rev() {
            *word |= (old >> step) | carry;
            carry = old << (64 - step);
        }
        row.copy_from_slice(&grown);
        left -= step;
        width += 2 * step;
    }
}

/// Group of what touches the border.
const OUTSIDE: usize = 0;

/// Disjoint sets.
#[derive(Debug)]
pub struct Groups(Vec<usize>);

impl Default for Groups {
    /// With one set, number 0.
    fn default() -> Self {
        Self(vec![0])
    }
}

impl Groups {
    /// A new set; its number.
    pub fn push(&mut self) -> usize {
        self.0.push(self.0.len());
        self.0.len() - 1
    }

    /// The least member of a set.
    pub fn root(&mut self, mut of: usize) -> usize {
        while self.0[of] != of {
            self.0[of] = self.0[self.0[of]];
            of = self.0[of];
        }
        of
    }

    /// Makes two sets one.
    pub fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b)] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use needlebench_numerics::random::SplitMix64;

    use super::*;

    fn random_bits(width: usize, height: usize, of: u32, seed: u64) -> Bits {
        let mut random = SplitMix64::new(seed);
        let mut bits = Bits::new(width, height);
        for y in 0..height {
            for x in 0..width {
                if random.below(100) < of {
                    bits.set(x, y);
                }
            }
        }
        bits
    }

    #[test]
    fn dilating_is_what_it_says() {
        for (width, radius) in [(150, 5.7), (64, 2.2), (33, 1.0), (200, 30.0)] {
            let bits = random_bits(width, 40, 1, 3);
            let disc = disc(radius, radius);
            let dilated = bits.dilated(&disc);
            for y in 0..40_usize {
                for x in 0..width {
                    let wanted = (0..40_usize).any(|v| {
                        let dy = y.abs_diff(v);
                        dy < disc.len()
                            && (0..width).any(|u| bits.get(u, v) && u.abs_diff(x) <= disc[dy])
                    });
                    assert_eq!(dilated.get(x, y), wanted, "{x} {y} of {width}");
                }
            }
            assert_eq!(bits.inverted().eroded(&disc), dilated.inverted());
        }
    }

    #[test]
    fn filling_leaves_what_has_a_way_out() {
        let mut bits = Bits::new(70, 20);
        for x in 5..66 {
            for y in 3..17 {
                let wall = x == 5 || x == 65 || y == 3 || y == 16;
                let door = x == 5 && y == 9;
                let inner = (30..=40).contains(&x)
                    && (6..=12).contains(&y)
                    && !((31..40).contains(&x) && (7..12).contains(&y));
                if (wall && !door) || inner {
                    bits.set(x, y);
                }
            }
        }
        let filled = bits.filled();
        assert!(filled.get(35, 9), "a closed room");
        assert!(!filled.get(20, 9), "a room with a door");
        bits.set(5, 9);
        let filled = bits.filled();
        assert!((6..65).all(|x| filled.get(x, 9)) && !filled.get(0, 9) && !filled.get(69, 0));
    }
}
