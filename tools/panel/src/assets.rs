//! The files of the page: a table that is fixed when this program is built. A path that is not in it is not found;
//! nothing is read from a disk.

/// A file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Asset {
    /// Path of the request.
    pub path: &'static str,
    /// Content type.
    pub kind: &'static str,
    /// Content.
    pub text: &'static str,
}

/// Content type of a page.
pub const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

/// All files.
pub const ASSETS: [Asset; 11] = [
    Asset { path: "/", kind: HTML, text: include_str!("../assets/index.html") },
    Asset { path: "/panel.css", kind: CSS, text: include_str!("../assets/panel.css") },
    Asset { path: "/commissioning.js", kind: SCRIPT, text: include_str!("../assets/commissioning.js") },
    Asset { path: "/joint.js", kind: SCRIPT, text: include_str!("../assets/joint.js") },
    Asset { path: "/led.js", kind: SCRIPT, text: include_str!("../assets/led.js") },
    Asset { path: "/plot.js", kind: SCRIPT, text: include_str!("../assets/plot.js") },
    Asset { path: "/retraining.js", kind: SCRIPT, text: include_str!("../assets/retraining.js") },
    Asset { path: "/robot.js", kind: SCRIPT, text: include_str!("../assets/robot.js") },
    Asset { path: "/side.js", kind: SCRIPT, text: include_str!("../assets/side.js") },
    Asset { path: "/tables.js", kind: SCRIPT, text: include_str!("../assets/tables.js") },
    Asset { path: "/panel.js", kind: SCRIPT, text: include_str!("../assets/panel.js") },
];

/// Headers of every answer: nothing but this server's own files and its WebSocket, in no frame, kept nowhere. A report
/// has a policy of its own.
pub const HEADERS: [(&str, &str); 5] = [
    (
        "content-security-policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; frame-src 'self'; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-resource-policy", "same-origin"),
    ("cache-control", "no-store"),
];

/// The file with this very path.
pub fn find(path: &str) -> Option<&'static Asset> {
    ASSETS.iter().find(|asset| asset.path == path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_names_no_file_but_those_of_the_table_and_no_other_host() {
        let Some(page) = find("/") else { panic!("no page") };
        for attribute in ["src=\"", "href=\""] {
            for rest in page.text.split(attribute).skip(1) {
                let name = rest.split('"').next().unwrap_or_default();
                assert!(name.starts_with('#') || find(name).is_some(), "{name}");
            }
        }
        let mut ids = page.text.split(" id=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect::<Vec<_>>();
        ids.sort_unstable();
        assert!(ids.windows(2).all(|pair| pair[0] != pair[1]), "an id stands twice: {ids:?}");
        for asset in ASSETS {
            assert!(!asset.text.contains("http:") && !asset.text.contains("https:"), "{}", asset.path);
            // Content from a joint is text, never markup.
            assert!(!asset.text.contains("innerHTML") && !asset.text.contains("eval("), "{}", asset.path);
        }
    }
}
