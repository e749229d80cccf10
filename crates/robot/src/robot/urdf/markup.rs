//! The markup of a URDF: where everything stands, what is missing, and what nobody would read.

use needlebench_input::schema::written;
use needlebench_input::{Finding, nearest_name};
use roxmltree::Node;

use super::nodes::{child, is_own, opening_tag, own_children, tag};
use super::values::{JointValues, LinkValues, MaterialValues};
use super::vocabulary::{
    Attribute, Count, Form, Kind, NEEDLE_GUIDE_TAG, Plausible, QUATERNION, ROBOT,
};
use super::{JOINT_TYPES, NeedleGuide};

/// Likeness from which on an unknown name is taken for a known one misspelt, where other programs may
/// put names of their own.
const MISSPELT: f64 = 0.85;

/// Most attributes of an element: those of one are compared with one another, in time that grows with their square.
const MOST_ATTRIBUTES: usize = 64;

/// What a URDF says, checked.
#[derive(Debug, Default)]
pub(super) struct Markup {
    /// Empty if it has none.
    pub name: String,
    /// The links in the file's order.
    pub links: Vec<LinkValues>,
    /// The joints in the file's order.
    pub joints: Vec<JointValues>,
    /// Materials that links share, by their names.
    pub materials: Vec<MaterialValues>,
    /// needlebench's own element.
    pub needle_guide: Option<NeedleGuide>,
    /// What was passed over and may matter.
    pub notes: Vec<String>,
}

/// Reads the markup of a URDF and checks every element and attribute that stands for something.
///
/// # Errors
/// What is wrong with the first that is, with its line.
pub(super) fn read_markup(file: &str, text: &str) -> Result<Markup, Finding> {
    let document = roxmltree::Document::parse(text).map_err(|error| {
        let line = error.pos().row as usize;
        let mut finding = Finding::new(file, format!("not well-formed XML: {error}"));
        finding.line = Some(line);
        finding.hint("a URDF is an XML file whose root element is <robot>")
    })?;
    let root = document.root_element();
    let mut reader = Reader {
        file,
        text,
        markup: Markup::default(),
    };
    if tag(root) != "robot" {
        return Err(reader
            .finding(root, format!("the root element is <{}>", tag(root)))
            .hint("a URDF's root element is <robot>"));
    }
    if let Some(node) = root.descendants().find(is_xacro) {
        return Err(reader
            .finding(node, "this is a xacro file, not a URDF")
            .hint(
                "expand it first: xacro FILE > robot.urdf; ROS 2's description of UR arms by xacro ur.urdf.xacro \
                 name:=ur ur_type:=ur10e > robot.urdf",
            ));
    }
    reader.check(root, &ROBOT)?;
    for node in own_children(root) {
        match tag(node) {
            "link" => reader.markup.links.push(LinkValues::of(node)),
            "joint" => {
                reader.check_joint_type(node)?;
                reader.markup.joints.push(JointValues::of(node));
            }
            "material" => reader.markup.materials.push(MaterialValues::of(node)),
            NEEDLE_GUIDE_TAG => reader.markup.needle_guide = Some(reader.needle_guide(node)?),
            _ => {}
        }
    }
    root.attribute("name")
        .unwrap_or_default()
        .clone_into(&mut reader.markup.name);
    Ok(reader.markup)
}

struct Reader<'a> {
    file: &'a str,
    text: &'a str,
    markup: Markup,
}

impl Reader<'_> {
    fn finding(&self, node: Node<'_, '_>, message: impl Into<String>) -> Finding {
        Finding::new(self.file, message).at(self.text, opening_tag(node))
    }

    /// Checks an element and all below it.
    fn check(&mut self, node: Node<'_, '_>, kind: &'static Kind) -> Result<(), Finding> {
        let attributes = node.attributes().len();
        if attributes > MOST_ATTRIBUTES {
            let message = format!(
                "{} has {attributes} attributes, more than {MOST_ATTRIBUTES}",
                label(node)
            );
            return Err(self.finding(node, message));
        }
        for attribute in node.attributes().filter(|each| each.namespace().is_none()) {
            let known = kind.attributes.iter().map(|each| each.name);
            if !known.clone().any(|name| name == attribute.name()) {
                let name = attribute.name();
                let message = format!("{} has the unknown attribute `{name}`", label(node));
                self.refuse_or_note(node, kind, name, known, message, |near| format!("`{near}`"))?;
            }
        }
        for attribute in kind.attributes {
            self.check_attribute(node, attribute)?;
        }
        if tag(node) == "origin" {
            self.check_orientation(node)?;
        }
        for inner in node.children().filter(Node::is_element) {
            let name = tag(inner);
            if !is_own(inner) || kind.passed_over.contains(&name) {
                continue;
            }
            if name == "inertial" {
                self.note_half_inertial(node, inner);
            }
            if let Some(known) = kind.children.iter().find(|each| each.tag == name) {
                if known.count != Count::Many && child(node, name) != Some(inner) {
                    let message = format!("{} has <{name}> twice", label(node));
                    return Err(self.finding(inner, message));
                }
                self.check(inner, known.kind)?;
                continue;
            }
            if tag(node) == "geometry" {
                return Err(self
                    .finding(inner, format!("<{name}> is not a geometry"))
                    .hint("box, cylinder, sphere or mesh"));
            }
            let known = kind.children.iter().map(|each| each.tag);
            let message = format!("{} has the unknown element <{name}>", label(node));
            self.refuse_or_note(inner, kind, name, known, message, |near| {
                format!("<{near}>")
            })?;
        }
        for known in kind.children {
            if known.count == Count::One && child(node, known.tag).is_none() {
                let message = format!("{} has no <{}>", label(node), known.tag);
                return Err(self.finding(node, message));
            }
        }
        if tag(node) == "geometry" {
            let mut shapes = own_children(node);
            if shapes.next().is_none() {
                return Err(self.finding(node, "<geometry> is empty"));
            }
            if let Some(second) = shapes.next() {
                return Err(self
                    .finding(second, "<geometry> has more than one shape")
                    .hint("give each shape a <collision> or <visual> of its own"));
            }
        }
        Ok(())
    }

    /// A mass without moments is a point's; moments without a mass are ignored.
    fn note_half_inertial(&mut self, link: Node<'_, '_>, inertial: Node<'_, '_>) {
        let what = match ["mass", "inertia"].map(|tag| child(inertial, tag).is_some()) {
            [true, true] => return,
            [true, false] => "has no <inertia>: it is a point mass",
            [false, _] => "has no <mass> and is ignored",
        };
        let line = self.finding(inertial, "").line;
        let line = line.map_or(String::new(), |line| format!(":{line}"));
        let note = format!(
            "{}{line}: the <inertial> of {} {what}",
            self.file,
            label(link)
        );
        self.markup.notes.push(note);
    }

    /// Refuses what looks like a slip, and notes what may be another program's; `name` stands in
    /// `node` or is its tag.
    fn refuse_or_note(
        &mut self,
        node: Node<'_, '_>,
        kind: &Kind,
        name: &str,
        known: impl Iterator<Item = &'static str> + Clone,
        message: String,
        quoted: impl Fn(&str) -> String,
    ) -> Result<(), Finding> {
        let like = known
            .clone()
            .any(|each| strsim::jaro_winkler(name, each) > MISSPELT);
        if kind.open && !like {
            let place = self.finding(node, "").line;
            let line = place.map_or(String::new(), |line| format!(":{line}"));
            let note = format!("{}{line}: {message}, which is ignored", self.file);
            self.markup.notes.push(note);
            return Ok(());
        }
        let names: Vec<String> = known.clone().map(&quoted).collect();
        let hint = match nearest_name(name, known) {
            Some(near) => format!("did you mean {}?", quoted(near)),
            None if names.is_empty() => "no attribute or element is allowed here".to_owned(),
            None => format!("known: {}", names.join(", ")),
        };
        Err(self.finding(node, message).hint(hint))
    }

    fn check_attribute(&self, node: Node<'_, '_>, attribute: &Attribute) -> Result<(), Finding> {
        let name = attribute.name;
        let Some(text) = node.attribute(name) else {
            return if attribute.required {
                Err(self.finding(node, format!("<{}> has no `{name}`", tag(node))))
            } else {
                Ok(())
            };
        };
        match attribute.form {
            Form::Text => Ok(()),
            Form::Number => self.numbers(node, name, text, 1),
            Form::Numbers(count) => self.numbers(node, name, text, count),
            Form::Plausible(count, range) => {
                self.numbers(node, name, text, count)?;
                self.plausible(node, name, text, range)
            }
        }
    }

    fn numbers(
        &self,
        node: Node<'_, '_>,
        name: &str,
        text: &str,
        count: usize,
    ) -> Result<(), Finding> {
        let bad = |why: String| {
            let message = format!("`{name}=\"{text}\"` of <{}> {why}", tag(node));
            Err(self.finding(node, message))
        };
        let mut words = text.split_whitespace();
        for _ in 0..count {
            let Some(word) = words.next() else {
                return bad(format!("needs {count} numbers"));
            };
            match word.parse::<f64>() {
                Err(_) => return bad(format!("has '{word}', which is not a number")),
                Ok(number) if !number.is_finite() => {
                    return bad(format!("has {word}, which is not finite"));
                }
                Ok(_) => {}
            }
        }
        if words.next().is_some() {
            return bad(format!("has more than {count} numbers"));
        }
        Ok(())
    }

    /// Refuses numbers that no robot has.
    fn plausible(
        &self,
        node: Node<'_, '_>,
        name: &str,
        text: &str,
        range: &Plausible,
    ) -> Result<(), Finding> {
        let holds = |word: &&str| {
            let number = word.parse::<f64>();
            number.is_ok_and(|number| (range.least..=range.most).contains(&number))
        };
        let Some(word) = text.split_whitespace().find(|word| !holds(word)) else {
            return Ok(());
        };
        if range.least > 0.0 && word.parse::<f64>().is_ok_and(|number| number <= 0.0) {
            let message = format!(
                "`{name}` of <{}> is {word}, but must be positive",
                tag(node)
            );
            return Err(self.finding(node, message));
        }
        let space = if range.unit.is_empty() { "" } else { " " };
        let of = node
            .ancestors()
            .find(|above| matches!(tag(*above), "joint" | "link"));
        let of = of.map(label);
        let place = of.as_ref().map_or(String::new(), |of| format!(" of {of}"));
        let finding = self.finding(
            node,
            format!(
                "`{name}` of <{}>{place} has {word}{space}{}, outside {} to {}",
                tag(node),
                range.unit,
                written(range.least),
                written(range.most)
            ),
        );
        let finding = finding.hint(range.hint);
        Err(match of {
            Some(of) => finding.key(of),
            None => finding,
        })
    }

    /// Programs drop a quaternion in silence where the file is of version 1.0.
    fn check_orientation(&self, origin: Node<'_, '_>) -> Result<(), Finding> {
        if origin.attribute(QUATERNION).is_none() {
            return Ok(());
        }
        if origin.attribute("rpy").is_some() {
            let message = format!("<origin> has both `rpy` and `{QUATERNION}`");
            return Err(self.finding(origin, message).hint("keep one of them"));
        }
        let version = origin.document().root_element().attribute("version");
        let version = version.and_then(|text| text.trim().parse::<f64>().ok());
        if version.unwrap_or(1.0) > 1.0 {
            return Ok(());
        }
        let message = format!("`{QUATERNION}` is not part of URDF 1.0");
        Err(self
            .finding(origin, message)
            .hint("write <robot version=\"1.1\">, or give `rpy`"))
    }

    fn check_joint_type(&self, node: Node<'_, '_>) -> Result<(), Finding> {
        let kind = node.attribute("type").unwrap_or_default();
        if JOINT_TYPES.contains(&kind) {
            return Ok(());
        }
        let finding = self.finding(
            node,
            format!("{} has the unknown type '{kind}'", label(node)),
        );
        Err(finding.hint(match nearest_name(kind, JOINT_TYPES) {
            Some(near) => format!("did you mean '{near}'?"),
            None => JOINT_TYPES.join(", "),
        }))
    }

    /// The element, whose attributes have been checked.
    fn needle_guide(&self, node: Node<'_, '_>) -> Result<NeedleGuide, Finding> {
        let number = |name| {
            let text = node.attribute(name).unwrap_or_default();
            text.trim().parse().unwrap_or(f64::NAN)
        };
        let gauge = node.attribute("needle_gauge").unwrap_or_default();
        Ok(NeedleGuide {
            bore_mm: number("bore_mm"),
            guide_length_mm: number("guide_length_mm"),
            needle_gauge: gauge.parse().map_err(|_| {
                self.finding(
                    node,
                    format!("`needle_gauge=\"{gauge}\"` is not a whole number"),
                )
            })?,
            needle_od_mm: number("needle_od_mm"),
            needle_length_mm: number("needle_length_mm"),
        })
    }
}

/// An element of xacro's namespace, or one with an unexpanded attribute. A file that xacro wrote
/// declares the namespace too, and comments may hold anything.
fn is_xacro(node: &Node<'_, '_>) -> bool {
    let namespace = node.tag_name().namespace().unwrap_or_default();
    namespace.ends_with("xacro")
        || node
            .attributes()
            .any(|attribute| attribute.value().contains("${"))
}

/// An element in messages: `joint 'elbow_joint'`, `<origin>`.
fn label(node: Node<'_, '_>) -> String {
    match (tag(node), node.attribute("name")) {
        (tag @ ("joint" | "link"), Some(name)) => format!("{tag} '{name}'"),
        (tag, _) => format!("<{tag}>"),
    }
}
