//! Access control: only pages of this server that have its token.

use std::fmt::Write as _;

use axum::http::{HeaderMap, HeaderValue, StatusCode, header};

use crate::answer::Problem;

/// A random word of 128 bits.
#[derive(Clone)]
pub struct Token(String);

impl Token {
    /// A new one.
    ///
    /// # Errors
    /// A machine without random numbers.
    pub fn new() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; 16];
        getrandom::fill(&mut bytes)?;
        let mut text = String::with_capacity(32);
        for byte in bytes {
            let _ = write!(text, "{byte:02x}");
        }
        Ok(Self(text))
    }

    /// As text.
    pub fn text(&self) -> &str {
        &self.0
    }

    /// Whether it is the same, in a time that tells nothing of how far it is.
    pub fn is(&self, other: &str) -> bool {
        let pairs = self.0.bytes().zip(other.bytes());
        let differ = pairs.fold(0, |differ, (a, b)| differ | (a ^ b));
        other.len() == self.0.len() && differ == 0
    }
}

/// The names that this server has.
#[derive(Debug, Clone)]
pub struct Hosts([String; 2]);

impl Hosts {
    /// At a port.
    pub fn new(port: u16) -> Self {
        Self([format!("127.0.0.1:{port}"), format!("localhost:{port}")])
    }

    /// Rejects requests by another host name (DNS rebinding) or from another origin.
    ///
    /// # Errors
    /// 403 with a sentence.
    pub fn check(&self, headers: &HeaderMap) -> Result<(), Problem> {
        let mut hosts = headers.get_all(header::HOST).iter();
        let host = hosts.next().and_then(|value| value.to_str().ok());
        let is_own = |name: &str| self.0.iter().any(|own| own == name);
        if !host.is_some_and(is_own) || hosts.next().is_some() {
            return Err(forbidden("this server answers only at its own address"));
        }
        for origin in headers.get_all(header::ORIGIN) {
            let origin = origin
                .to_str()
                .ok()
                .and_then(|text| text.strip_prefix("http://"));
            if !origin.is_some_and(is_own) {
                return Err(forbidden("requests from other origins are not allowed"));
            }
        }
        let site = headers.get("sec-fetch-site").map(HeaderValue::as_bytes);
        match site {
            None | Some(b"same-origin" | b"none") => Ok(()),
            Some(_) => Err(forbidden("requests from other origins are not allowed")),
        }
    }
}

fn forbidden(message: &str) -> Problem {
    Problem::new(StatusCode::FORBIDDEN, message)
}

/// Rejects requests without the token.
///
/// # Errors
/// 401 with a sentence.
pub(crate) fn check_token(headers: &HeaderMap, token: &Token) -> Result<(), Problem> {
    let given = headers.get(header::AUTHORIZATION);
    let given = given.and_then(|value| value.to_str().ok());
    let given = given.and_then(|text| text.strip_prefix("Bearer "));
    if given.is_some_and(|given| token.is(given)) {
        Ok(())
    } else {
        Err(
            Problem::new(StatusCode::UNAUTHORIZED, "the token is missing or wrong")
                .hint("open the address that `needlebench view` prints"),
        )
    }
}

/// Name of the cookie that lets a browser open results, which a link cannot give a token.
pub(crate) const COOKIE: &str = "needlebench_results";

/// Rejects requests without the cookie.
///
/// # Errors
/// 401 with a sentence.
pub(crate) fn check_cookie(headers: &HeaderMap, token: &Token) -> Result<(), Problem> {
    let cookies = headers.get_all(header::COOKIE).iter();
    let cookies = cookies.filter_map(|value| value.to_str().ok());
    let mut pairs = cookies
        .flat_map(|text| text.split(';'))
        .filter_map(|pair| pair.trim().split_once('='));
    if pairs.any(|(name, value)| name == COOKIE && token.is(value)) {
        Ok(())
    } else {
        Err(Problem::new(
            StatusCode::UNAUTHORIZED,
            "open results from the planning page",
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(all: &[(&'static str, &str)]) -> HeaderMap {
        let mut headers = HeaderMap::new();
        for (name, value) in all {
            headers.append(*name, value.parse().unwrap());
        }
        headers
    }

    #[test]
    fn own_names_alone_are_let_in() {
        let hosts = Hosts::new(4711);
        for right in [
            &[("host", "127.0.0.1:4711")][..],
            &[
                ("host", "localhost:4711"),
                ("origin", "http://localhost:4711"),
            ],
            &[
                ("host", "localhost:4711"),
                ("sec-fetch-site", "same-origin"),
            ],
        ] {
            assert!(hosts.check(&headers(right)).is_ok(), "{right:?}");
        }
        for wrong in [
            &[][..],
            &[("host", "evil.example:4711")],
            &[("host", "127.0.0.1")],
            &[("host", "127.0.0.1:4712")],
            &[("host", "127.0.0.1:4711"), ("host", "evil.example")],
            &[
                ("host", "127.0.0.1:4711"),
                ("origin", "http://evil.example"),
            ],
            &[("host", "127.0.0.1:4711"), ("origin", "null")],
            &[
                ("host", "127.0.0.1:4711"),
                ("origin", "https://127.0.0.1:4711"),
            ],
            &[("host", "127.0.0.1:4711"), ("sec-fetch-site", "cross-site")],
            &[("host", "127.0.0.1:4711"), ("sec-fetch-site", "same-site")],
        ] {
            assert!(hosts.check(&headers(wrong)).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn tokens_are_long_and_differ() {
        let [a, b] = [Token::new().unwrap(), Token::new().unwrap()];
        assert_eq!(a.text().len(), 32);
        assert!(a.is(a.text()) && !a.is(b.text()) && !a.is("") && !a.is(&a.text()[1..]));
        let with = |text: String| headers(&[("authorization", text.as_str())]);
        assert!(check_token(&with(format!("Bearer {}", a.text())), &a).is_ok());
        assert!(check_token(&with(a.text().to_owned()), &a).is_err());
        assert!(check_token(&headers(&[]), &a).is_err());
    }
}
