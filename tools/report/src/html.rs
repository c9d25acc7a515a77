//! A page that needs nothing but itself: style sheet and figures are inside, there is no script; host.
//!
//! All text goes through maud, which escapes it.

use crate::figures::{Figure, style_sheet};
use maud::{DOCTYPE, Markup, PreEscaped, html};

const PAGE_STYLE: &str = include_str!("page.css");

/// A page that needs nothing but itself.
pub fn document(title: &str, body: &Markup) -> String {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                style { (PreEscaped(PAGE_STYLE)) (PreEscaped(style_sheet())) }
            }
            body { (body) }
        }
    }
    .into_string()
}

/// Figures side by side where there is room.
pub fn gallery(figures: &[&Figure]) -> Markup {
    html! {
        div.gallery {
            @for figure in figures {
                figure id={ "figure-" (figure.name) } class=[figure.wide.then_some("wide")] {
                    h3 { (figure.title) }
                    div.scroll aria-label=(figure.title) { (PreEscaped(&figure.svg)) }
                    figcaption { (figure.caption) }
                }
            }
        }
    }
}
