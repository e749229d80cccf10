//! Small pieces of markup.

use quick_xml::escape::escape;

/// A formula in the notation of the equations' texts: `_x`, `^x`, `_{..}`, `^{..}`.
pub(super) fn formula(text: &str) -> String {
    let mut html = String::new();
    let mut characters = text.chars().peekable();
    while let Some(character) = characters.next() {
        let tag = match character {
            '_' => "sub",
            '^' => "sup",
            other => {
                html.push_str(&escape(other.to_string()));
                continue;
            }
        };
        let mut inside = String::new();
        if characters.next_if_eq(&'{').is_some() {
            for each in characters.by_ref().take_while(|each| *each != '}') {
                inside.push(each);
            }
        } else {
            inside.extend(characters.next());
        }
        html.extend(["<", tag, ">", &escape(&inside), "</", tag, ">"]);
    }
    html
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_have_sub_and_superscripts_and_no_markup_of_their_own() {
        assert_eq!(
            formula("q_{234} < C_3^2"),
            "q<sub>234</sub> &lt; C<sub>3</sub><sup>2</sup>"
        );
    }
}
