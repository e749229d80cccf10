//! What a needle keeps away from, and what it is said to cross.

use std::sync::OnceLock;

use needlebench_geometry::{PreparedSolids, Solid};

use super::{PhantomPart, Tissue};

/// Bones, vessels, organs and fissures of a phantom, made ready for many needles.
#[derive(Debug, Clone)]
pub struct RouteObstacles {
    /// In the phantom frame, in the order of `parts`.
    pub solids: PreparedSolids,
    /// What each is.
    pub parts: Vec<RouteObstacle>,
}

/// One of them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RouteObstacle {
    /// Name of the part.
    pub name: String,
    /// Bone, vessel, organ or fissure.
    pub tissue: Tissue,
    /// The structure that it is a piece of.
    pub organ: Option<String>,
}

impl RouteObstacle {
    /// Whether a name means it: of its tissue, of the structure that it belongs to, or its own.
    pub fn is_called(&self, name: &str) -> bool {
        self.name == name || self.organ.as_deref() == Some(name) || self.tissue.to_string() == name
    }
}

/// Made when they are first asked for, and once for all that share the phantom.
///
/// They say nothing that the parts do not say, and so all are equal.
#[derive(Debug, Clone, Default)]
pub(super) struct OnDemand(OnceLock<RouteObstacles>);

impl PartialEq for OnDemand {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl OnDemand {
    /// Those of these parts. Lesions, markers and the skin are none.
    pub fn of(&self, parts: &[PhantomPart]) -> &RouteObstacles {
        self.0.get_or_init(|| {
            let obstacles = parts.iter().filter(|part| {
                matches!(
                    part.tissue,
                    Tissue::Bone | Tissue::Vessel | Tissue::Organ | Tissue::Fissure
                )
            });
            let solids: Vec<Solid> = obstacles.clone().map(|part| part.solid.clone()).collect();
            let parts = obstacles.map(|part| RouteObstacle {
                name: part.solid.name.clone(),
                tissue: part.tissue,
                organ: part.organ.clone(),
            });
            RouteObstacles {
                solids: PreparedSolids::new(&solids),
                parts: parts.collect(),
            }
        })
    }
}
