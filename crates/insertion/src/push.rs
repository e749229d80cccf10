//! How tissue pushes a needle sideways.

use crate::insertion::{Insertion, Slip};
use crate::layers::Layers;

impl Insertion {
    /// What the springs of the tissues push the needle with, lateral to the guide's axis, N: what the guide holds it with the
    /// other way, but for the force across the tip. `slip` is what has moved since the needle was inserted.
    ///
    /// Accuracy: 0.1 % (`tests::a_guide_holds_what_tissue_pushes`).
    pub fn pushed_n(&self, layers: &Layers, slip: Option<Slip>) -> [f64; 2] {
        let nodes = self.depths_m.windows(2).enumerate();
        let mut pushed_n = [0.0; 2];
        let mut ends = layers.all().iter().zip(layers.ends_m()).peekable();
        for (index, depths_m) in nodes {
            let middle_m = 0.5 * (depths_m[0] + depths_m[1]);
            while ends.next_if(|(_, end_m)| **end_m < middle_m).is_some() {}
            let Some((layer, _)) = ends.peek() else {
                break;
            };
            let moved_m = slip
                .filter(|slip| middle_m > slip.from_m)
                .map_or([0.0; 2], |slip| slip.by_m);
            let stiffness_n_m = layer.stiffness_n_m2 * (depths_m[1] - depths_m[0]);
            for (plane, pushed_n) in pushed_n.iter_mut().enumerate() {
                let off_m = |node: usize| self.path_m[node][plane] - self.shape_m[node][plane];
                let middle_off_m = 0.5 * (off_m(index) + off_m(index + 1));
                *pushed_n += stiffness_n_m * (middle_off_m + moved_m[plane]);
            }
        }
        pushed_n
    }
}
