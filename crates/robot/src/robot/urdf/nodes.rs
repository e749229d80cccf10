//! Elements of a URDF's XML that are the format's own.

use std::ops::Range;

use roxmltree::Node;

pub(super) fn tag<'a>(node: Node<'a, '_>) -> &'a str {
    node.tag_name().name()
}

pub(super) fn child<'a, 'd>(node: Node<'a, 'd>, name: &str) -> Option<Node<'a, 'd>> {
    own_children(node).find(|inner| tag(*inner) == name)
}

/// Elements that are the format's own, not of another namespace.
pub(super) fn own_children<'a, 'd>(node: Node<'a, 'd>) -> impl Iterator<Item = Node<'a, 'd>> {
    node.children()
        .filter(|inner| inner.is_element() && is_own(*inner))
}

pub(super) fn is_own(node: Node<'_, '_>) -> bool {
    let home = node.document().root_element().tag_name().namespace();
    node.tag_name().namespace() == home
}

/// Bytes of an element's opening tag: where a caret should stand.
pub(super) fn opening_tag(node: Node<'_, '_>) -> Range<usize> {
    let range = node.range();
    let text = &node.document().input_text()[range.clone()];
    let length = text.find('>').map_or(text.len(), |end| end + 1);
    range.start..range.start + length
}
