//! Answers with a status and a sentence.

use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::json;

use crate::live::Refusal;

/// What went wrong, for the page to say.
#[derive(Debug)]
pub struct Problem {
    status: StatusCode,
    body: serde_json::Value,
}

impl Problem {
    /// A sentence.
    pub fn new(status: StatusCode, message: impl Into<String>) -> Self {
        let message: String = message.into();
        Self {
            status,
            body: json!({"error": message}),
        }
    }

    /// With what to do about it.
    pub fn hint(mut self, hint: &str) -> Self {
        self.body["hint"] = json!(hint);
        self
    }

    /// With something more to know.
    pub fn with<T: Serialize>(mut self, key: &str, value: &T) -> Self {
        self.body[key] = serde_json::to_value(value).unwrap_or_default();
        self
    }
}

impl From<Refusal> for Problem {
    fn from(refusal: Refusal) -> Self {
        let problem = Self::new(StatusCode::UNPROCESSABLE_ENTITY, refusal.message);
        match refusal.hint {
            Some(hint) => problem.hint(&hint),
            None => problem,
        }
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        (self.status, json_response(&self.body)).into_response()
    }
}

/// A value as JSON.
pub(crate) fn json_response<T: Serialize>(value: &T) -> Response {
    match serde_json::to_vec(value) {
        Ok(bytes) => ([(header::CONTENT_TYPE, "application/json")], bytes).into_response(),
        Err(error) => (StatusCode::INTERNAL_SERVER_ERROR, error.to_string()).into_response(),
    }
}
