//! The HTML around a payload.

use serde_json::Value;

use super::pack::Pack;

const STYLE: &str = include_str!("assets/page.css");
const THREE: &str = include_str!("assets/three.bundle.js");
const CORE: &str = include_str!("assets/core.js");
const VIEW: &str = include_str!("assets/view.js");
const PLOT: &str = include_str!("assets/plot.js");

/// What a page says before its scripts run, and which script is its own.
pub(super) struct Page<'a> {
    /// `run`, `atlas` or `study`.
    pub kind: &'static str,
    /// Name of the scenario or study.
    pub name: &'a str,
    /// Its description.
    pub description: &'a str,
    /// The page's own script.
    pub script: &'static str,
}

impl Page<'_> {
    /// The whole file.
    pub fn html(&self, pack: Pack, document: &Value) -> String {
        let title = escaped(&format!("{}: {} - needlebench", self.kind, self.name));
        let name = escaped(self.name);
        let description = escaped(self.description);
        let payload = pack.payload(document);
        let script = self.script;
        // `connect-src` falls back to none: the page cannot ask anybody for anything.
        format!(
            "<!DOCTYPE html>\n\
             <html lang=\"en\">\n\
             <head>\n\
             <meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src \
             'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:\">\n\
             <title>{title}</title>\n\
             <style>\n{STYLE}</style>\n\
             </head>\n\
             <body>\n\
             <header class=\"top\"><h1>{name}</h1><p>{description}</p></header>\n\
             <main id=\"app\"><p id=\"loading\">Loading ...</p>\n\
             <noscript><p>This page draws its contents with JavaScript, which is switched off. The same \
             results are in the JSON file beside it.</p></noscript></main>\n\
             <script type=\"application/octet-stream\" id=\"payload\">{payload}</script>\n\
             <script>\n{THREE}</script>\n\
             <script>\n{CORE}</script>\n\
             <script>\n{VIEW}</script>\n\
             <script>\n{PLOT}</script>\n\
             <script>\n{script}</script>\n\
             </body>\n\
             </html>\n"
        )
    }
}

/// Text as text: no markup, in elements and in quoted attributes.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            _ => out.push(character),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn names_and_descriptions_cannot_become_markup() {
        let attack = "</script><img src=x onerror=\"alert('1')\">&amp;";
        let page = Page {
            kind: "run",
            name: attack,
            description: attack,
            script: "",
        };
        let html = page.html(Pack::default(), &json!({"name": attack}));
        assert!(!html.contains("<img"));
        assert!(html.contains(
            "<h1>&lt;/script&gt;&lt;img src=x onerror=&quot;alert(&#39;1&#39;)&quot;&gt;&amp;amp;</h1>"
        ));
        // The payload and the five scripts, opened and closed.
        assert_eq!(html.matches("<script").count(), 6);
        assert_eq!(html.matches("</script>").count(), 6);
    }

    #[test]
    fn no_script_can_close_itself_or_reach_out() {
        for script in [THREE, CORE, VIEW, PLOT] {
            assert!(!script.to_lowercase().contains("</script"));
            assert!(!script.to_lowercase().contains("<!--"));
        }
        for script in [CORE, VIEW, PLOT] {
            for name in [
                "innerHTML",
                "outerHTML",
                "insertAdjacentHTML",
                "document.write",
                "eval(",
                "fetch(",
            ] {
                assert!(!script.contains(name), "{name}");
            }
        }
    }
}
