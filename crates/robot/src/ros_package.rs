//! The package of ROS that a file is in.

use std::path::{Path, PathBuf};

use needlebench_input::read_text;

/// The package that a file is in: the nearest folder above it with a `package.xml` that gives a name, and that name.
pub fn package_of(file: &Path) -> Option<(String, PathBuf)> {
    let file = file.canonicalize().ok()?;
    file.ancestors().skip(1).find_map(|folder| {
        let text = read_text(&folder.join("package.xml")).ok()?;
        Some((name_in(&text)?, folder.to_owned()))
    })
}

fn name_in(text: &str) -> Option<String> {
    let document = roxmltree::Document::parse(text).ok()?;
    let root = document.root_element();
    let name = root.children().find(|node| node.has_tag_name("name"))?;
    let name = name.text()?.trim();
    (root.has_tag_name("package") && !name.is_empty()).then(|| name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_package_above_a_file_is_its_package() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("workspace/arm/urdf/inc");
        std::fs::create_dir_all(&inner).unwrap();
        let file = inner.join("arm.xacro");
        std::fs::write(&file, "").unwrap();
        let manifest = |folder: &str, text: &str| {
            std::fs::write(inner.join(folder).join("package.xml"), text).unwrap();
        };
        // Neither is a package: one has another root, one has no name.
        manifest(".", "<robot><name>inc</name></robot>");
        manifest("..", "<package format=\"3\"><version>1</version></package>");
        assert_eq!(package_of(&file), None);
        let comment = "<?xml version=\"1.0\"?><!-- <name>no</name> -->";
        let text = format!("{comment}<package><name> arm_description\n</name></package>");
        manifest("../..", &text);
        manifest("../../..", "<package><name>above</name></package>");
        let (name, found) = package_of(&file).unwrap();
        assert_eq!(name, "arm_description");
        assert_eq!(found, inner.join("../..").canonicalize().unwrap());
        assert_eq!(package_of(&inner.join("none.xacro")), None);
    }
}
