//! HTML around contents: one builder for all pages.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use quick_xml::escape::escape;

/// A self-contained page that can reach no other file.
#[derive(Debug, Clone)]
pub struct Document<'a> {
    /// Title, as text.
    pub title: &'a str,
    /// Style sheet.
    pub style: &'a str,
    /// What the body holds, as markup.
    pub body: &'a str,
    /// Scripts, in the order in which they run.
    pub scripts: &'a [&'a str],
}

impl Document<'_> {
    /// The whole file.
    pub fn html(&self) -> String {
        // `connect-src` falls back to none: the page can make no requests.
        let may_run = if self.scripts.is_empty() {
            ""
        } else {
            // Nor can it make code of texts; WebAssembly, which a page may bring along, is none.
            "script-src 'unsafe-inline' 'wasm-unsafe-eval'; "
        };
        let mut out = format!(
            "<!DOCTYPE html>\n\
             <html lang=\"en\">\n\
             <head>\n\
             <meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; {may_run}\
             style-src 'unsafe-inline'; img-src data: blob:\">\n\
             <title>{}</title>\n\
             <style>\n{}</style>\n\
             </head>\n\
             <body>\n\
             {}\n",
            escape(self.title),
            self.style,
            self.body
        );
        for script in self.scripts {
            out.extend(["<script>\n", script, "</script>\n"]);
        }
        out.push_str("</body>\n</html>\n");
        out
    }
}

/// Bytes as characters that are none of markup.
pub fn base64(bytes: &[u8]) -> String {
    STANDARD.encode(bytes)
}

/// An address that holds a PNG picture itself.
pub fn png_address(bytes: &[u8]) -> String {
    format!("data:image/png;base64,{}", base64(bytes))
}
