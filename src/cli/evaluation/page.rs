//! Results as one HTML page that loads nothing: sortable tables, and pictures with a slider between any two.

use super::view_pictures::ShownView;
use strivec_format::escape::escaped;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
/// Pictures of fewer columns are enlarged to this width, in pixels of the page.
const LEAST_WIDTH: u32 = 400;

/// A page before its texts are escaped.
pub(crate) struct Page {
    pub(crate) title: String,
    /// (name, value) pairs below the title.
    pub(crate) facts: Vec<(String, String)>,
    pub(crate) tables: Vec<PageTable>,
    pub(crate) views: Vec<ShownView>,
}

/// A table; its first column has names, the others numbers.
pub(crate) struct PageTable {
    pub(crate) heading: String,
    pub(crate) columns: Vec<String>,
    pub(crate) rows: Vec<Vec<TableCell>>,
}

/// A text and the number that it is sorted by.
pub(crate) struct TableCell {
    text: String,
    value: Option<f64>,
}

impl TableCell {
    /// A name.
    pub(crate) fn name(text: impl Into<String>) -> Self {
        Self { text: text.into(), value: None }
    }

    /// `value`, shown as `text`. Without a value it is sorted first.
    pub(crate) fn number(value: Option<f64>, text: String) -> Self {
        Self { text, value: Some(value.unwrap_or(f64::NEG_INFINITY)) }
    }

    fn html(&self) -> String {
        let value = self.value.map_or_else(String::new, |value| {
            let value = match value {
                f64::INFINITY => "Infinity".to_owned(),
                f64::NEG_INFINITY => "-Infinity".to_owned(),
                value => value.to_string(),
            };
            format!(" data-value=\"{value}\"")
        });
        format!("<td{value}>{}</td>", html(&self.text))
    }
}

/// `text` in HTML, in an element or an attribute in quotes, with its unsafe characters visible.
fn html(text: &str) -> String {
    let escapes = [('&', "&amp;"), ('<', "&lt;"), ('>', "&gt;"), ('"', "&quot;"), ('\'', "&#39;")];
    escapes.iter().fold(escaped(text), |text, (character, entity)| text.replace(*character, entity))
}

impl Page {
    /// The page's text.
    pub(super) fn html(&self) -> String {
        let title = html(&self.title);
        // The policy keeps the page from loading anything, whatever it holds.
        let mut page = format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; \
             style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n\
             <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n<dl>\n"
        );
        for (name, value) in &self.facts {
            page += &format!("<dt>{}</dt><dd>{}</dd>\n", html(name), html(value));
        }
        page += "</dl>\n";
        self.tables.iter().for_each(|table| page += &table.html());
        if !self.views.is_empty() {
            page += "<h2>Pictures</h2>\n<p>Errors: the largest difference of a pixel's channels, from black (none) to light \
                     yellow (0.2 and above).</p>\n<div class=\"choice\"></div>\n";
            self.views.iter().for_each(|view| page += &view_html(view));
        }
        page + &format!("<script>\n{SCRIPT}</script>\n</body>\n</html>\n")
    }
}

impl PageTable {
    fn html(&self) -> String {
        let headings: String =
            self.columns.iter().map(|column| format!("<th scope=\"col\">{}</th>", html(column))).collect();
        let row = |row: &Vec<TableCell>| format!("<tr>{}</tr>\n", row.iter().map(TableCell::html).collect::<String>());
        format!(
            "<h2>{}</h2>\n<div class=\"scroll\"><table>\n<thead><tr>{headings}</tr></thead>\n\
             <tbody>\n{}</tbody>\n</table></div>\n",
            html(&self.heading),
            self.rows.iter().map(row).collect::<String>()
        )
    }
}

fn view_html(view: &ShownView) -> String {
    let [width, height] = view.size;
    let shown_width = width.max(LEAST_WIDTH);
    let class = if shown_width > width { "stage small" } else { "stage" };
    let picture = |(label, uri): &(String, String)| {
        format!("<img alt=\"{}\" width=\"{width}\" height=\"{height}\" src=\"{uri}\">\n", html(label))
    };
    format!(
        "<figure style=\"--width: {shown_width}px; --shape: {width} / {height}\">\n<figcaption>{}</figcaption>\n\
         <div class=\"{class}\">\n{}</div>\n</figure>\n",
        html(&[std::slice::from_ref(&view.name), &view.psnr].concat().join(" · ")),
        view.pictures.iter().map(picture).collect::<String>()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_escaped_and_nothing_is_loaded() {
        let evil = "</title><script>alert('1')</script>\"onload=\u{202e}&";
        let page = Page {
            title: evil.into(),
            facts: vec![(evil.into(), evil.into())],
            tables: vec![PageTable {
                heading: evil.into(),
                columns: vec![evil.into(), evil.into()],
                rows: vec![vec![TableCell::name(evil), TableCell::number(Some(f64::INFINITY), evil.into())]],
            }],
            views: vec![ShownView {
                index: 0,
                name: evil.into(),
                psnr: vec!["30.00 dB".into()],
                size: [10, 20],
                pictures: vec![(evil.into(), "data:image/png;base64,AA==".into())],
            }],
        };
        let text = page.html();
        let shown = "&lt;/title&gt;&lt;script&gt;alert(&#39;1&#39;)&lt;/script&gt;&quot;onload=\\u{202e}&amp;";
        assert_eq!(text.matches(shown).count(), 11, "{text}");
        assert!(!text.contains(evil) && text.matches("<script").count() == 1);
        assert!(!text.contains("://") && !text.contains("url("), "the page refers to another file");
        assert!(text.contains("data-value=\"Infinity\"") && text.contains("--shape: 10 / 20"));
    }
}
