//! The results as one self-contained page: no script, no resource from elsewhere.

mod evaluation;
mod markup;
mod numerical;
mod solutions;

use std::fmt::Write;

use super::PaperReport;
use quick_xml::escape::escape;

use needlebench_report::page::document::Document;

const STYLE: &str = include_str!("style.css");

/// The page. `pictures` are file names and PNG bytes, by configuration.
pub(super) fn page(report: &PaperReport, pictures: &[(String, Vec<u8>)]) -> String {
    let mut body = String::new();
    // Writing to a String cannot fail.
    let _ = write_body(&mut body, report, pictures);
    Document {
        title: &format!("{}: reproduced", report.paper.title),
        style: STYLE,
        body: &body,
        scripts: &[],
    }
    .html()
}

fn write_body(
    out: &mut String,
    report: &PaperReport,
    pictures: &[(String, Vec<u8>)],
) -> std::fmt::Result {
    out.write_str("<main>\n")?;
    head(out, report)?;
    solutions::table_3(out, report)?;
    solutions::equations(out, report)?;
    solutions::solver(out, report)?;
    evaluation::accuracy(out, report)?;
    evaluation::time(out, report)?;
    numerical::convergence(out, report)?;
    evaluation::free_space(out, report, pictures)?;
    provenance(out, report)?;
    out.write_str("</main>")
}

fn head(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    let (class, word) = if report.passes() {
        ("pass", "reproduced")
    } else {
        ("fail", "not reproduced")
    };
    writeln!(
        out,
        "<header><h1>{}: reproduced</h1><p class=\"soft\">{}. Recomputed by needlebench {}; every \
         number below comes from this run, but for the paper's own and the times of other solvers, which were recorded on another machine.</p><p><span class=\"verdict {class}\">{word}</span></p>",
        report.paper.title, report.paper.authors, report.provenance.version
    )?;
    out.write_str("<ul class=\"checks\">")?;
    for check in &report.checks {
        let (class, mark) = if check.pass {
            ("pass", "✓")
        } else {
            ("fail", "✗")
        };
        write!(
            out,
            "<li><span class=\"{class}\">{mark}</span> {} <span class=\"soft\">({})</span></li>",
            escape(check.name),
            escape(&check.detail)
        )?;
    }
    out.write_str(
        "</ul><nav><a href=\"#table3\">Table 3</a><a href=\"#equations\">Equations</a>\
         <a href=\"#solver\">Closed form as a whole</a><a href=\"#accuracy\">Accuracy</a>\
         <a href=\"#time\">Time</a><a href=\"#convergence\">Numerical method</a>\
         <a href=\"#figure6\">Figure 6</a><a href=\"#provenance\">Provenance</a></nav></header>\n",
    )
}

fn provenance(out: &mut String, report: &PaperReport) -> std::fmt::Result {
    let provenance = &report.provenance;
    writeln!(
        out,
        "<h2 id=\"provenance\">Provenance</h2><p>needlebench {} ({}), lock file \
         <code>{}</code>, random numbers from seed {}. Two runs of one build differ in their times \
         only.</p><div class=\"scroll\"><table><thead><tr><th>input</th><th class=\"left\">file</th>\
         <th class=\"left\">SHA-256</th></tr></thead><tbody>",
        escape(&provenance.version),
        escape(&provenance.git_revision),
        provenance.cargo_lock_sha256.get(..12).unwrap_or(""),
        provenance.seed
    )?;
    for input in &provenance.inputs {
        writeln!(
            out,
            "<tr><td>{}</td><td class=\"left\">{}</td><td class=\"left\"><code>{}</code></td></tr>",
            input.role,
            escape(&input.file),
            input.sha256
        )?;
    }
    out.write_str("</tbody></table></div>\n")
}
