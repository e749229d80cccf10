//! Text in columns: what parts the cells of a line, and what stands in them.
//!
//! Cells are parts of the line that they come from, so that messages can point at them; and a line is by itself, so that
//! a quote that nobody closes costs that line alone.

/// What parts the cells of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Separator {
    /// `;`
    Semicolon,
    /// A tab.
    Tab,
    /// `,`
    Comma,
    /// Any number of blanks.
    Blanks,
}

impl Separator {
    /// That of a header: a semicolon, a tab or a comma, whichever of these in this order is in it; else blanks.
    pub fn of_header(header: &str) -> Self {
        [Self::Semicolon, Self::Tab, Self::Comma]
            .into_iter()
            .find(|each| each.letter().is_some_and(|letter| header.contains(letter)))
            .unwrap_or(Self::Blanks)
    }

    fn letter(self) -> Option<char> {
        match self {
            Self::Semicolon => Some(';'),
            Self::Tab => Some('\t'),
            Self::Comma => Some(','),
            Self::Blanks => None,
        }
    }

    /// For people: "values are separated by ...".
    pub fn words(self) -> &'static str {
        match self {
            Self::Semicolon => "semicolons",
            Self::Tab => "tabs",
            Self::Comma => "commas",
            Self::Blanks => "blanks",
        }
    }

    /// Whether numbers may have a comma for a point.
    pub fn allows_decimal_comma(self) -> bool {
        self != Self::Comma
    }

    /// The number in a cell; not a number where it is empty, `none` or `null`. `None` for what is none.
    pub fn number(self, cell: &str) -> Option<f64> {
        match cell.parse() {
            Ok(value) => Some(value),
            Err(_) if cell.is_empty() => Some(f64::NAN),
            Err(_) if self.allows_decimal_comma() && cell.contains(',') => {
                cell.replace(',', ".").parse().ok()
            }
            Err(_) if cell.eq_ignore_ascii_case("none") || cell.eq_ignore_ascii_case("null") => {
                Some(f64::NAN)
            }
            Err(_) => None,
        }
    }

    /// Cells of a line, without blanks and quotes around them. What stands in quotes is one cell.
    pub fn cells(self, line: &str) -> impl Iterator<Item = &str> {
        let has_quotes = line.contains('"');
        let mut is_quoted = false;
        let parts = move |letter: char| {
            is_quoted ^= has_quotes && letter == '"';
            let parts = match self.letter() {
                Some(separator) => letter == separator,
                None => letter.is_whitespace(),
            };
            parts && !is_quoted
        };
        line.split(parts)
            // Blanks side by side have nothing between them.
            .filter(move |cell| self != Self::Blanks || !cell.is_empty())
            .map(|cell| cell.trim_matches(|letter: char| letter.is_whitespace() || letter == '"'))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(line: &str) -> Vec<&str> {
        Separator::of_header(line).cells(line).collect()
    }

    #[test]
    fn the_separator_is_the_first_of_its_kind_in_the_header() {
        assert_eq!(cells("a;b,c\td"), ["a", "b,c\td"]);
        assert_eq!(cells("a\tb,c"), ["a", "b,c"]);
        assert_eq!(cells(" a , b,,c,"), ["a", "b", "", "c", ""]);
        assert_eq!(cells("  a  b\tc "), ["a  b", "c"]);
        assert_eq!(cells("  a  b c "), ["a", "b", "c"]);
        assert_eq!(cells(""), [""; 0]);
    }

    #[test]
    fn a_comma_is_a_decimal_comma_where_commas_part_nothing() {
        assert_eq!(Separator::Semicolon.number("-1,5"), Some(-1.5));
        assert_eq!(Separator::Comma.number("-1,5"), None);
        assert_eq!(Separator::Comma.number("2.5e-3"), Some(2.5e-3));
        assert!(Separator::Tab.number("").is_some_and(f64::is_nan));
        assert!(Separator::Tab.number("NULL").is_some_and(f64::is_nan));
        assert_eq!(Separator::Tab.number("1,2,3"), None);
    }

    #[test]
    fn what_stands_in_quotes_is_one_cell_and_ends_with_its_line() {
        assert_eq!(cells("P1; \"a;b\" ;2"), ["P1", "a;b", "2"]);
        assert_eq!(cells("\"a b\" c"), ["a b", "c"]);
        assert_eq!(cells("a;\"b;c"), ["a", "b;c"]);
    }
}
