//! SRDF files: the pairs of links that a planner was told not to check.
//!
//! Only `<disable_collisions link1 link2 reason>` is read; it is what MoveIt's setup assistant
//! writes after looking at random postures, and what is copied from robot to robot.

use std::ops::Range;
use std::path::Path;

use needlebench_cell::Cell;
use needlebench_input::{Finding, nearest_name, read_text};
use roxmltree::Node;

use crate::LinkMember;

/// A pair of links that an SRDF disables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DisabledPair {
    /// Names of the links, as the file has them.
    pub links: [String; 2],
    /// The reason as the file gives it: `Adjacent`, `Never`, `Always`, `Default`, `User` ...;
    /// empty if it gives none.
    pub reason: String,
    span: Range<usize>,
}

/// An SRDF.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Srdf {
    /// File as the user named it.
    pub file: String,
    /// Name of the robot that the file is for.
    pub robot: String,
    /// Its disabled pairs, in the file's order.
    pub disabled: Vec<DisabledPair>,
    text: String,
}

impl Srdf {
    /// Reads a file.
    ///
    /// # Errors
    /// A [`Finding`] if it cannot be read, is not XML, is no SRDF, or a pair lacks a link.
    pub fn load(path: &Path) -> Result<Self, Finding> {
        let file = path.display().to_string();
        let text = read_text(path).map_err(|error| {
            let hint = error.hint("the path is relative to the working directory");
            Finding::new(&file, format!("cannot read the SRDF: {error}")).hint(hint)
        })?;
        Self::parse(&file, &text)
    }

    /// Reads a text.
    ///
    /// # Errors
    /// As [`Srdf::load`].
    pub fn parse(file: &str, text: &str) -> Result<Self, Finding> {
        let document = roxmltree::Document::parse(text).map_err(|error| {
            let mut finding = Finding::new(file, format!("not well-formed XML: {error}"));
            finding.line = Some(error.pos().row as usize);
            finding.hint("an SRDF is an XML file whose root element is <robot>")
        })?;
        let root = document.root_element();
        let at = |node: Node<'_, '_>, message: String| {
            Finding::new(file, message).at(text, opening_tag(node))
        };
        if root.tag_name().name() != "robot" {
            let message = format!("the root element is <{}>", root.tag_name().name());
            return Err(at(root, message).hint("an SRDF's root element is <robot>"));
        }
        if let Some(link) = root.children().find(|node| node.has_tag_name("link")) {
            return Err(at(link, "this is a URDF, not an SRDF".to_owned())
                .hint("the SRDF is the file with <disable_collisions> elements"));
        }
        let disabled = root
            .children()
            .filter(|node| node.has_tag_name("disable_collisions"))
            .map(|node| {
                let link = |name: &str| {
                    node.attribute(name).map(str::to_owned).ok_or_else(|| {
                        at(node, format!("<disable_collisions> has no `{name}`"))
                            .hint("it requires link1, link2 and a reason")
                    })
                };
                Ok(DisabledPair {
                    links: [link("link1")?, link("link2")?],
                    reason: node.attribute("reason").unwrap_or_default().to_owned(),
                    span: opening_tag(node),
                })
            })
            .collect::<Result<_, Finding>>()?;
        Ok(Self {
            file: file.to_owned(),
            robot: root.attribute("name").unwrap_or_default().to_owned(),
            disabled,
            text: text.to_owned(),
        })
    }

    /// A finding at the place of a disabled pair.
    pub fn finding(&self, pair: &DisabledPair, message: impl Into<String>) -> Finding {
        Finding::new(&self.file, message)
            .at(&self.text, pair.span.clone())
            .key(format!("{} and {}", pair.links[0], pair.links[1]))
    }

    /// Bodies of the cell that a pair's links belong to. Names are those of the robot's URDF or of
    /// the cell's bodies; a link without geometry of its own, such as `tool0`, stands for the body
    /// that it is fixed to.
    ///
    /// # Errors
    /// A [`Finding`] that names an unknown link, with the nearest known name.
    pub fn bodies_of(
        &self,
        pair: &DisabledPair,
        cell: &Cell,
        members: &[LinkMember],
    ) -> Result<[usize; 2], Finding> {
        let body = |link: &String| {
            body_named(cell, members, link).ok_or_else(|| {
                let finding = self.finding(pair, format!("the robot has no link '{link}'"));
                let members = members.iter().map(|each| each.name.as_str());
                let bodies = cell.bodies.iter().map(|each| each.name.as_str());
                match nearest_name(link, members.chain(bodies)) {
                    Some(near) => finding.hint(format!("did you mean '{near}'?")),
                    None => finding.hint(format!(
                        "is this SRDF, for '{}', the right one for '{}'?",
                        self.robot, cell.robot.name
                    )),
                }
            })
        };
        Ok([body(&pair.links[0])?, body(&pair.links[1])?])
    }
}

/// Index of the body that a link of the arm's URDF belongs to, or that has the name itself.
fn body_named(cell: &Cell, members: &[LinkMember], link: &str) -> Option<usize> {
    let robot = &cell.robot;
    let owner = members.iter().find(|each| each.name == link);
    let name = match owner {
        Some(member) => match member.owner.checked_sub(1) {
            None => robot.base.name.as_str(),
            Some(index) => robot.links[index].name.as_str(),
        },
        None => link,
    };
    cell.bodies.iter().position(|body| body.name == name)
}

/// Bytes of an element's opening tag.
fn opening_tag(node: Node<'_, '_>) -> Range<usize> {
    let range = node.range();
    let text = &node.document().input_text()[range.clone()];
    let length = text.find('>').map_or(text.len(), |end| end + 1);
    range.start..range.start + length
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_read_with_their_reasons_and_the_rest_is_passed_over() {
        let text = r#"<?xml version="1.0"?>
<robot name="ur5">
  <group name="arm"><chain base_link="base_link" tip_link="tool0"/></group>
  <disable_collisions link1="a" link2="b" reason="Never"/>
  <disable_collisions link1="b" link2="c"/>
</robot>"#;
        let srdf = Srdf::parse("x.srdf", text).unwrap();
        assert_eq!(srdf.robot, "ur5");
        let read: Vec<_> = srdf
            .disabled
            .iter()
            .map(|pair| {
                (
                    pair.links[0].as_str(),
                    pair.links[1].as_str(),
                    &*pair.reason,
                )
            })
            .collect();
        assert_eq!(read, [("a", "b", "Never"), ("b", "c", "")]);
        assert_eq!(srdf.finding(&srdf.disabled[1], "x").line, Some(5));
    }

    #[test]
    fn what_is_no_srdf_is_said_to_be_none() {
        for (text, part) in [
            ("<robot", "well-formed"),
            ("<srdf/>", "<srdf>"),
            ("<robot><link name='a'/></robot>", "URDF"),
            ("<robot><disable_collisions link1='a'/></robot>", "link2"),
        ] {
            let finding = Srdf::parse("x.srdf", text).unwrap_err();
            assert!(finding.message.contains(part), "{finding}");
        }
    }
}
