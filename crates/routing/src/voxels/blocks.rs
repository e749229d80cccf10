//! Where in the voxels the body is at all, coarsely: rays skip what cannot have what they look for.

use needlebench_parallel::in_parts;

/// Voxels along each side of a block.
pub(super) const BLOCK: usize = 8;

/// Of the body, or not, as bits: what is beside the body is outside of it, too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BodySide {
    Outside = 1,
    Body = 2,
    Beside = 4,
}

/// Blocks of voxels, and which sides of the body each has voxels of.
#[derive(Debug)]
pub(super) struct Blocks {
    pub size: [usize; 3],
    /// Bits of [`BodySide`].
    sides: Vec<u8>,
    /// The sides of each class.
    sides_of: [u8; 256],
}

impl Blocks {
    /// Of a box of classes, each of which has sides.
    pub fn of(
        voxels: &[u8],
        [nx, ny, nz]: [usize; 3],
        of_class: impl Fn(u8) -> u8,
        threads: usize,
    ) -> Self {
        let size = [nx, ny, nz].map(|count| count.div_ceil(BLOCK));
        let sides_of: [u8; 256] =
            std::array::from_fn(|class| u8::try_from(class).map_or(0, &of_class));
        let layer = size[0] * size[1];
        let mut sides = vec![0; layer * size[2]];
        let of_layer = |(): &mut (), part: usize, sides: &mut [u8]| {
            for k in part * BLOCK..((part + 1) * BLOCK).min(nz) {
                for j in 0..ny {
                    let row = &voxels[(k * ny + j) * nx..][..nx];
                    let sides = &mut sides[j / BLOCK * size[0]..];
                    for (block, voxels) in sides.iter_mut().zip(row.chunks(BLOCK)) {
                        for &class in voxels {
                            *block |= sides_of[usize::from(class)];
                        }
                    }
                }
            }
        };
        in_parts(threads, &mut sides, layer, || (), of_layer);
        Self {
            size,
            sides,
            sides_of,
        }
    }

    /// Whether a class has a side.
    #[inline]
    pub fn is(&self, class: u8, side: BodySide) -> bool {
        self.sides_of[usize::from(class)] & side as u8 != 0
    }

    /// Whether a block has a voxel of a side.
    pub fn has(&self, [i, j, k]: [usize; 3], side: BodySide) -> bool {
        self.sides[(k * self.size[1] + j) * self.size[0] + i] & side as u8 != 0
    }
}
