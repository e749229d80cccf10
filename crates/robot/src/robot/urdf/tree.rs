//! Whether links and joints form one tree.

use std::collections::{BTreeMap, BTreeSet};

use super::Urdf;
use needlebench_input::{Finding, nearest_name};

impl Urdf {
    /// # Errors
    /// What keeps the links from being one tree.
    pub(super) fn check_tree(&self) -> Result<(), Finding> {
        if self.links.is_empty() {
            return Err(Finding::new(&self.file, "it has no <link>"));
        }
        let mut seen = BTreeSet::new();
        for link in &self.links {
            if !seen.insert(link.name.as_str()) {
                return Err(self.finding(&link.span, format!("duplicate link '{}'", link.name)));
            }
        }
        let mut parents: BTreeMap<&str, &str> = BTreeMap::new();
        let mut joint_names = BTreeSet::new();
        for joint in &self.joints {
            if !joint_names.insert(joint.name.as_str()) {
                let message = format!("duplicate joint '{}'", joint.name);
                return Err(self
                    .finding(&joint.span, message)
                    .hint("every joint needs a name of its own"));
            }
            for (role, name) in [("parent", &joint.parent), ("child", &joint.child)] {
                if !seen.contains(name.as_str()) {
                    let message = format!(
                        "joint '{}' names the {role} link '{name}', which does not exist",
                        joint.name
                    );
                    let finding = self.finding(&joint.span, message);
                    return Err(match nearest_name(name, seen.iter().copied()) {
                        Some(near) => finding.hint(format!("did you mean '{near}'?")),
                        None => finding,
                    });
                }
            }
            if let Some(other) = parents.insert(&joint.child, &joint.name) {
                return Err(self.finding(
                    &joint.span,
                    format!(
                        "link '{}' is the child of two joints, '{other}' and '{}'",
                        joint.child, joint.name
                    ),
                ));
            }
        }
        // With one parent at most per link, a link that never meets a root is on a cycle.
        for link in &self.links {
            let mut at = link.name.as_str();
            for _ in 0..=self.links.len() {
                match self.joint_above(at) {
                    Some(joint) => at = &joint.parent,
                    None => break,
                }
            }
            if self.joint_above(at).is_some() {
                return Err(self
                    .finding(
                        &link.span,
                        format!("the links form a cycle through link '{}'", link.name),
                    )
                    .key(format!("link '{}'", link.name))
                    .hint("a URDF is a tree: one of the joints has the wrong <parent>"));
            }
        }
        let roots: Vec<&str> = self
            .links
            .iter()
            .filter(|link| self.joint_above(&link.name).is_none())
            .map(|link| link.name.as_str())
            .collect();
        if roots.len() > 1 {
            return Err(Finding::new(
                &self.file,
                format!(
                    "it has {} root links ({}), a URDF has one",
                    roots.len(),
                    roots.join(", ")
                ),
            )
            .hint("join them with a <joint>"));
        }
        Ok(())
    }
}
