//! A program's text as tokens with their places.

use crate::place::{Place, ScriptError};

/// A word of the language.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Kind<'a> {
    /// A name or a keyword.
    Word(&'a str),
    Number(f64),
    Text(&'a str),
    /// `p[`, the beginning of a pose.
    Pose,
    /// An operator or a bracket.
    Sign(&'static str),
    End,
}

impl Kind<'_> {
    /// As errors name it.
    pub fn in_words(&self) -> String {
        match self {
            Self::Word(word) => format!("`{}`", shortened(word)),
            Self::Number(number) => format!("the number {number}"),
            Self::Text(_) => "a string".to_owned(),
            Self::Pose => "`p[`".to_owned(),
            Self::Sign(sign) => format!("`{sign}`"),
            Self::End => "the end of the program".to_owned(),
        }
    }
}

/// A name as messages have it.
pub(crate) fn shortened(name: &str) -> String {
    const MOST: usize = 60;
    if name.chars().count() <= MOST {
        return name.to_owned();
    }
    let start: String = name.chars().take(MOST).collect();
    format!("{start}...")
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Token<'a> {
    pub kind: Kind<'a>,
    pub place: Place,
}

/// Most words of a program, so that its tree takes some 50 MB at most: assumed, as a controller's is not known.
const MOST_TOKENS: usize = 1 << 18;

/// Operators and brackets, longer ones first.
const SIGNS: [&str; 19] = [
    "==", "!=", "<=", ">=", "(", ")", "[", "]", ",", ":", "=", "<", ">", "+", "-", "*", "/", "%",
    ".",
];

/// All tokens of a text, the last one [`Kind::End`].
///
/// Line ends are white space; comments begin with `#`, program labels with `$`, and both end with the line.
pub(crate) fn tokens(text: &str) -> Result<Vec<Token<'_>>, ScriptError> {
    let mut lexer = Lexer {
        text,
        place: Place::START,
    };
    let mut found = Vec::new();
    loop {
        lexer.skip_space();
        let token = lexer.token()?;
        let is_last = token.kind == Kind::End;
        if found.len() >= MOST_TOKENS {
            let message = format!("the program has more than {MOST_TOKENS} words");
            return Err(ScriptError::new(token.place, message));
        }
        found.push(token);
        if is_last {
            return Ok(found);
        }
    }
}

struct Lexer<'a> {
    text: &'a str,
    place: Place,
}

impl<'a> Lexer<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.place.offset..]
    }

    fn next_char(&self) -> Option<char> {
        self.rest().chars().next()
    }

    /// Goes on by a number of bytes, which ends at a character.
    fn advance(&mut self, bytes: usize) -> &'a str {
        let passed = &self.rest()[..bytes];
        for (at, letter) in passed.char_indices() {
            // A carriage return alone ends a line too.
            let ends_line =
                letter == '\n' || letter == '\r' && !self.rest()[at + 1..].starts_with('\n');
            if ends_line {
                self.place.line += 1;
                self.place.column = 1;
            } else {
                self.place.column += 1;
            }
        }
        self.place.offset += bytes;
        passed
    }

    fn advance_while(&mut self, is_in: impl Fn(char) -> bool) -> &'a str {
        let rest = self.rest();
        let end = rest.find(|letter| !is_in(letter)).unwrap_or(rest.len());
        self.advance(end)
    }

    fn skip_space(&mut self) {
        loop {
            self.advance_while(|letter| letter.is_whitespace() || letter == '\u{feff}');
            if !self.rest().starts_with(['#', '$']) {
                return;
            }
            self.advance_while(|letter| letter != '\n' && letter != '\r');
        }
    }

    fn token(&mut self) -> Result<Token<'a>, ScriptError> {
        let place = self.place;
        let Some(letter) = self.next_char() else {
            return Ok(Token {
                kind: Kind::End,
                place,
            });
        };
        let rest = self.rest();
        let starts_number = letter.is_ascii_digit()
            || letter == '.' && rest[1..].starts_with(|next: char| next.is_ascii_digit());
        let kind = if is_name_start(letter) {
            let word = self.advance_while(is_name_part);
            if word == "p" && self.rest().starts_with('[') {
                self.advance(1);
                Kind::Pose
            } else {
                Kind::Word(word)
            }
        } else if starts_number {
            self.number()?
        } else if letter == '"' {
            self.string()?
        } else if let Some(sign) = SIGNS.iter().find(|sign| rest.starts_with(**sign)) {
            self.advance(sign.len());
            Kind::Sign(sign)
        } else {
            let message = format!("{letter:?} has no meaning in a program");
            let error = ScriptError::new(place, message);
            return Err(match letter {
                '{' | '}' => error.hint("is this a template? fill in its placeholders first"),
                '\'' => error.hint("strings are in double quotes"),
                ';' => error.hint("a statement ends where the next begins: leave it out"),
                _ => error,
            });
        };
        Ok(Token { kind, place })
    }

    fn number(&mut self) -> Result<Kind<'a>, ScriptError> {
        let place = self.place;
        let rest = self.rest().as_bytes();
        let digits = |from: usize| {
            let more = rest[from..].iter().take_while(|byte| byte.is_ascii_digit());
            from + more.count()
        };
        let mut end = digits(0);
        if rest.get(end) == Some(&b'.') {
            end = digits(end + 1);
        }
        if matches!(rest.get(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(rest.get(end + 1), Some(b'+' | b'-')));
            let exponent = digits(end + 1 + sign);
            if exponent > end + 1 + sign {
                end = exponent;
            }
        }
        let text = self.advance(end);
        if self.next_char().is_some_and(is_name_part) {
            let message = format!("a name begins right after the number {}", shortened(text));
            return Err(ScriptError::new(self.place, message));
        }
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(Kind::Number(number)),
            _ => {
                let message = format!("{} is no finite number", shortened(text));
                Err(ScriptError::new(place, message))
            }
        }
    }

    /// There are no escapes, and a string ends on its line.
    fn string(&mut self) -> Result<Kind<'a>, ScriptError> {
        let place = self.place;
        self.advance(1);
        let text = self.advance_while(|letter| !matches!(letter, '"' | '\n' | '\r'));
        if self.next_char() != Some('"') {
            return Err(ScriptError::new(
                place,
                "the string does not end on its line",
            ));
        }
        self.advance(1);
        Ok(Kind::Text(text))
    }
}

fn is_name_start(letter: char) -> bool {
    letter.is_ascii_alphabetic() || letter == '_'
}

fn is_name_part(letter: char) -> bool {
    letter.is_ascii_alphanumeric() || letter == '_'
}
