//! Small pieces of markup.

use crate::paper::plot::escaped;

/// A formula in the notation of the equations' texts: `_x`, `^x`, `_{..}`, `^{..}`.
pub(super) fn formula(text: &str) -> String {
    let mut html = String::new();
    let mut characters = text.chars().peekable();
    while let Some(character) = characters.next() {
        let tag = match character {
            '_' => "sub",
            '^' => "sup",
            other => {
                html.push_str(&escaped(&other.to_string()));
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
        html.extend(["<", tag, ">", &escaped(&inside), "</", tag, ">"]);
    }
    html
}

/// Base 64 of RFC 4648, for data addresses.
pub(super) fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let [a, b, c] = [0, 1, 2].map(|i| u32::from(chunk.get(i).copied().unwrap_or(0)));
        let group = a << 16 | b << 8 | c;
        for place in 0..4 {
            if place <= chunk.len() {
                let index = (group >> (18 - 6 * place)) & 63;
                text.push(char::from(ALPHABET[index as usize]));
            } else {
                text.push('=');
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_pads_as_the_standard_says() {
        // Test vectors of RFC 4648, section 10.
        assert_eq!(base64(b""), "");
        assert_eq!(base64(b"f"), "Zg==");
        assert_eq!(base64(b"fo"), "Zm8=");
        assert_eq!(base64(b"foobar"), "Zm9vYmFy");
    }

    #[test]
    fn formulas_have_sub_and_superscripts_and_no_markup_of_their_own() {
        assert_eq!(
            formula("q_{234} < C_3^2"),
            "q<sub>234</sub> &lt; C<sub>3</sub><sup>2</sup>"
        );
    }
}
