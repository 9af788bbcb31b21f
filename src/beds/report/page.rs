//! An HTML page with all results. A browser can open it without a network.

use std::fmt::Write;
use std::path::Path;

use super::centres;
use super::figures::Figure;
use super::measured::Measured;
use super::picture::picture;
use crate::beds::folder::cannot_write;
use crate::error::Error;
use crate::files::run_file::{RunFile, State};
use crate::math::digits::short;
use crate::scene::caveats::caveats;

const STYLE: &str = "\
body{font:15px/1.5 system-ui,sans-serif;color:#222;margin:0 auto;padding:1rem 1.5rem;max-width:1240px}
h1{font-size:1.5rem;margin:0 0 .2rem}h2{font-size:1.15rem;margin:1.6rem 0 .5rem}
.top{display:flex;flex-wrap:wrap;gap:2rem;align-items:flex-start}
table{border-collapse:collapse}\
td{padding:.15rem 1.2rem .15rem 0;vertical-align:top;border-bottom:1px solid #eee}
.figures{display:grid;grid-template-columns:repeat(auto-fit,minmax(420px,1fr));gap:1rem}
.run{columns:2 420px}.run tr{break-inside:avoid}
figure{margin:0}svg{max-width:100%;height:auto}\
pre{background:#f6f6f6;padding:.8rem;overflow:auto;font-size:13px}";

/// Writes the page into `folder`; returns its name.
pub fn write(
    folder: &Path,
    run_file: &RunFile,
    measured: &Measured,
    state: &State,
    figures: &[Figure],
) -> Result<String, Error> {
    let run = run_file.path().file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
          <meta name=\"viewport\" content=\"width=device-width\">\n\
          <title>{0}</title>\n<style>\n{STYLE}\n</style>\n\
          </head>\n<body>\n<h1>{0}</h1>\n\
          <p>Frame {1} of {2}, t = {3} s, {4} spheres{5}. Measured in {6}.</p>\n\
         <div class=\"top\">\n",
        escaped(&run),
        measured.last().frame,
        run_file.frames,
        measured.last().time,
        run_file.count,
        if run_file.completed { "" } else { "; the run is not complete" },
        escaped(&measured.region_words),
    );
    if let Some(svg) = picture(&run_file.scene, &centres(state), state.sizes(&run_file.scene)) {
        let _ = writeln!(page, "{svg}");
    }
    let found = measured.findings();
    page.push_str(&table(found.iter().map(|(name, value)| (name.to_string(), value.clone()))));
    page.push_str("</div>\n<h2>What the model does</h2>\n<ul>\n");
    for caveat in caveats(&run_file.scene) {
        let _ = writeln!(page, "<li>{}</li>", escaped(&caveat));
    }
    page.push_str("</ul>\n<h2>Figures</h2>\n<div class=\"figures\">\n");
    for figure in figures {
        let path = folder.join(&figure.file);
        let svg = std::fs::read_to_string(&path).map_err(|why| cannot_write(&path, why))?;
        let _ = writeln!(
            page,
            "<figure role=\"img\" aria-label=\"{}\">{}</figure>",
            escaped(figure.caption),
            svg.trim_start_matches("<?xml version=\"1.0\"?>").trim()
        );
    }
    page.push_str("</div>\n<h2>Run</h2>\n<div class=\"run\">\n");
    page.push_str(&table(run_file.facts()?.into_iter().map(|(name, value)| (name, brief(value)))));
    let _ = write!(
        page,
        "</div>\n<h2>Scene</h2>\n<pre>{}</pre>\n</body>\n</html>\n",
        escaped(run_file.scene.resolved().trim())
    );
    let path = folder.join("report.html");
    std::fs::write(&path, page).map_err(|why| cannot_write(&path, why))?;
    Ok("report.html".to_owned())
}

fn table(rows: impl Iterator<Item = (String, String)>) -> String {
    let rows = rows
        .map(|(name, value)| format!("<tr><td>{}</td><td>{}</td></tr>\n", escaped(&name), escaped(&value)));
    format!("<table>\n{}</table>\n", rows.collect::<String>())
}

/// A number with a long fraction gets fewer digits. Any other text stays as it is.
fn brief(value: String) -> String {
    match value.parse::<f64>() {
        Ok(number) if value.contains('.') && value.len() > 8 && number.is_finite() => short(number),
        _ => value,
    }
}

/// The text with the special characters of HTML escaped.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_fractions_are_shortened_and_words_are_not() {
        let shown =
            ["0.5081463480000002", "3964", "0.1.0", "12e34.5f", "0.1"].map(|text| brief(text.to_owned()));
        assert_eq!(shown[1..], ["3964", "0.1.0", "12e34.5f", "0.1"]);
        assert!(shown[0].starts_with("0.508146") && shown[0].len() < 10, "{}", shown[0]);
    }

    #[test]
    fn text_stays_text() {
        assert_eq!(escaped("<b> & \"c\""), "&lt;b&gt; &amp; &quot;c&quot;");
        let rows = [("a<b".to_owned(), "1".to_owned())];
        assert_eq!(table(rows.into_iter()), "<table>\n<tr><td>a&lt;b</td><td>1</td></tr>\n</table>\n");
    }
}
