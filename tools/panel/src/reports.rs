//! Reports that the server has made for its pages, each at a path of its own; no I/O.
//!
//! A report brings styles within, which the policy of the page forbids: it is answered with a policy of its own, in a
//! sandbox without scripts, and shown in a frame.

use serde_json::Value;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// Reports that are kept; the oldest makes room.
pub const KEPT: usize = 16;
/// Policy of a report: its own styles and pictures, nothing else, in a frame of the page alone.
pub const POLICY: &str = "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; \
                          form-action 'none'; frame-ancestors 'self'";
const PATH: &str = "/report/";

#[derive(Debug, Default)]
struct Kept {
    last: u64,
    reports: VecDeque<(u64, Arc<str>)>,
}

/// Reports of all joints.
#[derive(Debug, Default)]
pub struct Reports(Mutex<Kept>);

impl Reports {
    /// Keeps a report; its path.
    pub fn keep(&self, html: &str) -> String {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.last += 1;
        let number = kept.last;
        kept.reports.push_back((number, html.into()));
        if kept.reports.len() > KEPT {
            kept.reports.pop_front();
        }
        format!("{PATH}{number}")
    }

    /// The report with this very path.
    pub fn find(&self, path: &str) -> Option<Arc<str>> {
        let number: u64 = path.strip_prefix(PATH)?.parse().ok()?;
        let kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let found = kept.reports.iter().find(|(at, _)| *at == number && path == format!("{PATH}{number}"));
        found.map(|(_, html)| Arc::clone(html))
    }

    /// Keeps those of a page's files that are pages themselves, and tells their paths with them.
    pub fn keep_of(&self, files: &mut Value) {
        for file in files.as_array_mut().into_iter().flatten() {
            let is_page = file["name"].as_str().is_some_and(|name| name.ends_with(".html"));
            if let Some(html) = file["text"].as_str().filter(|_| is_page) {
                file["path"] = self.keep(html).into();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn sixteen_reports_are_kept_and_found_by_their_very_path() {
        let reports = Reports::default();
        let paths: Vec<String> = (0..=KEPT).map(|n| reports.keep(&n.to_string())).collect();
        assert_eq!(reports.find(&paths[0]), None);
        assert_eq!(reports.find(&paths[1]).as_deref(), Some("1"));
        assert_eq!(reports.find(&paths[KEPT]).as_deref(), Some("16"));
        for path in ["/report/", "/report/18", "/report/+17", "/report/017", "/report/17/", "/report/../panel.css"] {
            assert_eq!(reports.find(path), None, "{path}");
        }
    }

    #[test]
    fn pages_among_files_get_a_path_and_others_none() {
        let reports = Reports::default();
        let mut files = json!([{ "name": "report.html", "text": "<p>" }, { "name": "a.toml", "text": "x" }]);
        reports.keep_of(&mut files);
        assert_eq!(files[0]["path"], "/report/1");
        assert!(files[1].get("path").is_none() && reports.find("/report/1").is_some());
    }
}
