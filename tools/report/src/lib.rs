//! Pages and figures of the host's tools: numbers as people read them, curves as small SVG that follows the reader's
//! colour scheme, pages without script or anything from elsewhere, and files that are written whole or not at all. What
//! a figure or a page says is its caller's.
//!
//! Data flows one way: samples are thinned and binned, drawn on axes in inks ([`figures`]), set beside text whose
//! numbers have the digits that matter ([`number`]) on one page ([`html`]), and written beside what was there before
//! ([`output`]).

pub mod figures;
pub mod html;
pub mod number;
pub mod output;
