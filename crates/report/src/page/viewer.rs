//! Pages that draw themselves from a payload.

use quick_xml::escape::escape;
use serde_json::Value;

use super::document::Document;
use super::pack::{Pack, deflated};
use super::shared::{CORE, NUMBER, THREE, VIEW};

const STYLE: &str = concat!(
    include_str!("assets/page.css"),
    include_str!("assets/explore.css")
);
const PLOT: &str = include_str!("assets/plot.js");
const SVG: &str = include_str!("assets/svg.js");

/// What a page says before its scripts run, and which script is its own.
pub(super) struct Viewer<'a> {
    /// Kind of the page, before the name in its title: `run`, `roll map`, `study` or `search`.
    pub kind: &'static str,
    /// Name of the scenario or study.
    pub name: &'a str,
    /// Its description.
    pub description: &'a str,
    /// The page's own script.
    pub script: &'static str,
    /// The page's own style, after that of all pages.
    pub style: &'static str,
}

impl Viewer<'_> {
    /// The whole file.
    pub fn html(&self, pack: Pack, document: &Value) -> String {
        let body = format!(
            "<header class=\"top\"><h1>{}</h1><p>{}</p></header>\n\
             <main id=\"app\"><p id=\"loading\">Loading ...</p>\n\
             <noscript><p>This page needs JavaScript, which is switched off. The same \
             results are in the JSON file beside it.</p></noscript></main>\n\
             <script type=\"application/octet-stream\" id=\"payload\">{}</script>\n\
             <!-- three.js, MIT licence: a script once inflated -->\n\
             <script type=\"application/octet-stream\" id=\"three\">{}</script>",
            escape(self.name),
            escape(self.description),
            pack.payload(document),
            deflated(THREE.as_bytes()),
        );
        Document {
            title: &format!("{}: {} - needlebench", self.kind, self.name),
            style: &format!("{STYLE}{}", self.style),
            body: &body,
            scripts: &[CORE, NUMBER, VIEW, PLOT, SVG, self.script],
        }
        .html()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn names_and_descriptions_cannot_become_markup() {
        let attack = "</script><img src=x onerror=\"alert('1')\">&amp;";
        let page = Viewer {
            kind: "run",
            name: attack,
            description: attack,
            script: "",
            style: "",
        };
        let html = page.html(Pack::default(), &json!({"name": attack}));
        assert!(!html.contains("<img"));
        assert!(html.contains(
            "<h1>&lt;/script&gt;&lt;img src=x onerror=&quot;alert(&apos;1&apos;)&quot;&gt;&amp;amp;</h1>"
        ));
        // The payload, the library and the six scripts, opened and closed.
        assert_eq!(html.matches("<script").count(), 8);
        assert_eq!(html.matches("</script>").count(), 8);
    }

    #[test]
    fn no_script_can_close_itself_or_reach_out() {
        for script in [THREE, CORE, NUMBER, VIEW, PLOT, SVG] {
            assert!(!script.to_lowercase().contains("</script"));
            assert!(!script.to_lowercase().contains("<!--"));
        }
        for script in [CORE, NUMBER, VIEW, PLOT, SVG] {
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
