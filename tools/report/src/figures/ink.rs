//! The colours of the figures by what they mean, in a light and a dark version; host.
//!
//! The hues are those of Okabe and Ito (Color Universal Design, 2008), which people with colour-blindness can tell
//! apart, made lighter for dark paper. Where the curves of the physical model and of the network lie close, they also
//! differ in their dashes, so that a print in grey can be read. A figure names inks by CSS class; only the style sheet
//! knows colours.

use plotters::style::RGBColor;

/// Meaning of a mark in a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ink {
    /// Letters.
    Text,
    /// Axes, ticks and the identity line.
    Axis,
    /// Grid lines.
    Grid,
    /// Measured samples.
    Measured,
    /// The rigid body alone: nothing is compensated.
    Nothing,
    /// The physical friction model.
    Physical,
    /// A curve of the physical friction model that others lie close to: dashed.
    PhysicalCurve,
    /// Physical friction and network.
    Network,
    /// Training data, and the seeds that were not chosen.
    Train,
    /// Validation data.
    Validation,
    /// A point to look at.
    Mark,
}

/// Ink, class, colour on white paper, colour on dark paper, dashes in tenths of a pixel.
const INKS: [(Ink, &str, &str, &str, &str); 11] = [
    (Ink::Text, "text", "#1b1f24", "#e6e9ee", ""),
    (Ink::Axis, "axis", "#6a737d", "#9aa4af", ""),
    (Ink::Grid, "grid", "#e4e7eb", "#30363d", ""),
    (Ink::Measured, "measured", "#7a828c", "#a3acb6", ""),
    (Ink::Nothing, "nothing", "#d55e00", "#f0894a", ""),
    (Ink::Physical, "physical", "#0072b2", "#56b4e9", ""),
    (Ink::PhysicalCurve, "physical-curve", "#0072b2", "#56b4e9", "90 40"),
    (Ink::Network, "network", "#009e73", "#2fcf9f", ""),
    (Ink::Train, "train", "#56a0d3", "#56b4e9", ""),
    (Ink::Validation, "validation", "#d55e00", "#f0894a", ""),
    (Ink::Mark, "mark", "#b0307a", "#e48fc0", ""),
];

/// Paper of a figure file on its own, light and dark.
const PAPER: (&str, &str) = ("#ffffff", "#161b22");

impl Ink {
    /// The ink as the colour that plotters carries to the backend: its number, not its looks.
    pub const fn colour(self) -> RGBColor {
        RGBColor(self as u8, 0, 0)
    }

    /// The class of the ink that [`Ink::colour`] made this colour from.
    pub fn class(colour: (u8, u8, u8)) -> &'static str {
        INKS.iter().find(|(ink, ..)| *ink as u8 == colour.0).map_or("text", |(_, class, ..)| class)
    }
}

/// Style sheet of all figures: one rule to stroke (`l-`) and one to fill (`f-`) with each ink. Dark paper is for
/// screens only, a print is always light.
pub fn style_sheet() -> String {
    let mut light = String::from(
        ".figure text{font-family:system-ui,-apple-system,\"Segoe UI\",Roboto,\"Helvetica Neue\",Arial,sans-serif}\n\
         .figure polyline{stroke-linejoin:round;stroke-linecap:round}\n",
    );
    let mut dark = String::new();
    for (_, class, on_white, on_dark, dashes) in INKS {
        light += &format!(".l-{class}{{stroke:{on_white};fill:none}}.f-{class}{{fill:{on_white}}}\n");
        dark += &format!(".l-{class}{{stroke:{on_dark}}}.f-{class}{{fill:{on_dark}}}\n");
        if !dashes.is_empty() {
            light += &format!("polyline.l-{class}{{stroke-dasharray:{dashes};stroke-linecap:butt}}\n");
        }
    }
    light += &format!(".paper{{fill:{}}}\n", PAPER.0);
    dark += &format!(".paper{{fill:{}}}\n", PAPER.1);
    format!("{light}@media screen and (prefers-color-scheme:dark){{\n{dark}}}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ink_comes_back_from_its_colour() {
        for (place, (ink, class, ..)) in INKS.into_iter().enumerate() {
            let RGBColor(r, g, b) = ink.colour();
            assert_eq!((ink as usize, Ink::class((r, g, b))), (place, class));
        }
    }
}
