//! The page itself. Nothing in it is of a patient.

use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use needlebench_report::page::shared;

const HTML: &str = include_str!("assets/index.html");
const STYLE: &str = include_str!("assets/view.css");
const API: &str = include_str!("assets/api.js");
const VOLUME: &str = include_str!("assets/volume.js");
const SLICES: &str = include_str!("assets/slices.js");
const ROOM: &str = include_str!("assets/room.js");
const ENTRIES: &str = include_str!("assets/entries.js");
const PEOPLE: &str = include_str!("assets/people.js");
const ROUTES: &str = include_str!("assets/routes.js");
const SIMULATION: &str = include_str!("assets/simulation.js");
const PLANNER: &str = include_str!("assets/planner.js");

/// The page connects only to this server, runs only its own scripts, and cannot be framed.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; \
     connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// A report contains its scripts; it makes no requests.
pub(crate) const REPORT_POLICY: &str = "default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval'; \
     style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// A file of the page; none of another name.
pub fn file(name: &str) -> Option<Response> {
    let (kind, text) = match name {
        "index.html" => ("text/html; charset=utf-8", HTML.to_owned()),
        "view.css" => (
            "text/css; charset=utf-8",
            format!("{}{STYLE}", shared::STYLE),
        ),
        "three.js" => (SCRIPT, shared::THREE.to_owned()),
        "shared.js" => (
            SCRIPT,
            [shared::CORE, shared::NUMBER, shared::VIEW].join("\n"),
        ),
        "view.js" => (
            SCRIPT,
            [
                API, VOLUME, SLICES, ROOM, ENTRIES, PEOPLE, ROUTES, SIMULATION, PLANNER,
            ]
            .join("\n"),
        ),
        "icon.svg" => ("image/svg+xml", include_str!("assets/icon.svg").to_owned()),
        _ => return None,
    };
    Some(([(header::CONTENT_TYPE, kind)], text).into_response())
}

const SCRIPT: &str = "text/javascript; charset=utf-8";

/// What every answer has.
pub(crate) fn guarded(mut response: Response) -> Response {
    let headers = response.headers_mut();
    let mut put = |name, value| {
        headers
            .entry(name)
            .or_insert(HeaderValue::from_static(value));
    };
    put(header::CONTENT_SECURITY_POLICY, POLICY);
    put(header::X_CONTENT_TYPE_OPTIONS, "nosniff");
    put(header::REFERRER_POLICY, "no-referrer");
    put(header::CACHE_CONTROL, "no-store");
    put(header::X_FRAME_OPTIONS, "DENY");
    put(
        header::HeaderName::from_static("cross-origin-resource-policy"),
        "same-origin",
    );
    put(
        header::HeaderName::from_static("cross-origin-opener-policy"),
        "same-origin",
    );
    response
}
