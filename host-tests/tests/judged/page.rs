//! docs/judging-joints.md: the published figures, and their margin.

use host_tests::in_the_loop::median;
use plant::JointParameters;

/// The page.
pub const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/judging-joints.md");
/// Largest departure from a published figure, as a fraction of it; networks depend on the last bit of a sum.
pub const MARGIN: f64 = 0.2;
/// And at least so much of it, in its own unit.
pub const LEAST: f64 = 0.3;
/// Torque error with compensation over that without, at the most: a tenth more is noise of where friction is small.
const HARM: f64 = 1.1;

/// Gear of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Gear(String);

impl Gear {
    /// The gear of a joint in words.
    pub fn of(joint: &JointParameters) -> Self {
        let inertia = joint.load.total_inertia();
        Self(match joint.transmission {
            None => "rigid".to_owned(),
            Some(gear) if gear.backlash > 0.0 => format!("backlash {:.1} mrad", 1e3 * gear.backlash),
            Some(gear) => format!("elastic, {:.0} Hz", (gear.stiffness / inertia).sqrt() / std::f64::consts::TAU),
        })
    }
}

/// A joint's figures: torque errors, % of the motor's torque (001 eq. 11), without compensation and with it, and with
/// adaptation where there are three.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Number of the joint.
    pub seed: u64,
    /// Gear.
    pub gear: Gear,
    /// Moves.
    pub moves: [f64; 3],
    /// Slow reversals.
    pub reversals: [f64; 3],
    /// RMS of the position error in slow reversals, mrad.
    pub tracking: [f64; 2],
    /// Friction left in torque mode, %: led by a hand, and moved by a command that tells its offset.
    pub torque_mode: [f64; 2],
    /// Moves that begin at 0 °C.
    pub cold: [f64; 2],
    /// Moves that begin at 60 °C.
    pub hot: [f64; 2],
    /// Moves of a joint that is 25 K warmer than its board believes.
    pub restarted: [f64; 2],
}

impl Row {
    /// Groups of figures with the name of their column, in the order of the page.
    fn groups(&self) -> [(&'static str, &[f64]); 7] {
        [
            ("moves", &self.moves),
            ("slow reversals", &self.reversals),
            ("position error, mrad", &self.tracking),
            ("torque mode, hand and command", &self.torque_mode),
            ("from 0 °C", &self.cold),
            ("from 60 °C", &self.hot),
            ("restarted warm", &self.restarted),
        ]
    }

    /// Figures that are not as published.
    pub fn differences(&self, published: &[Self]) -> Vec<String> {
        let Some(expected) = published.iter().find(|row| row.seed == self.seed) else {
            return vec![format!("joint {} is not on the page", self.seed)];
        };
        let groups = self.groups().into_iter().zip(expected.groups());
        let values = groups.flat_map(|((name, found), (_, expected))| {
            found.iter().zip(expected).map(move |(found, expected)| (name, *found, *expected))
        });
        let off = values.filter(|(_, found, expected)| (found - expected).abs() > (MARGIN * expected).max(LEAST));
        off.map(|(name, found, expected)| format!("joint {}, {name}: {found:.2}, published {expected:.2}", self.seed))
            .collect()
    }

    /// Motions on which compensation does harm.
    pub fn harmed(&self) -> impl Iterator<Item = String> {
        let groups = self.groups().into_iter().filter(|(name, _)| !name.starts_with("torque mode"));
        let harmed = groups.filter(|(_, figures)| figures[1..].iter().any(|with| *with > HARM * figures[0]));
        harmed.map(|(name, figures)| format!("joint {}, {name}: {figures:.2?}", self.seed))
    }

    fn line(&self) -> String {
        let cell = |figures: &[f64]| figures.iter().map(|figure| format!("{figure:.1}")).collect::<Vec<_>>().join(", ");
        let cells: Vec<String> = self.groups().iter().map(|(_, figures)| cell(figures)).collect();
        format!("| {} | {} | {} |\n", self.seed, self.gear.0, cells.join(" | "))
    }

    fn parse(line: &str) -> Option<Self> {
        let cells: Vec<&str> = line.trim().trim_matches('|').split('|').map(str::trim).collect();
        let [seed, gear, figures @ ..] = cells.as_slice() else { return None };
        let seed = seed.parse().ok()?;
        let numbers: Option<Vec<Vec<f64>>> =
            figures.iter().map(|cell| cell.split(", ").map(|figure| figure.parse().ok()).collect()).collect();
        let numbers = numbers?;
        let [moves, reversals, tracking, torque_mode, cold, hot, restarted] = numbers.as_slice() else { return None };
        let two = |figures: &[f64]| figures.try_into().ok();
        Some(Self {
            seed,
            gear: Gear((*gear).to_owned()),
            moves: moves.as_slice().try_into().ok()?,
            reversals: reversals.as_slice().try_into().ok()?,
            tracking: two(tracking)?,
            torque_mode: two(torque_mode)?,
            cold: two(cold)?,
            hot: two(hot)?,
            restarted: two(restarted)?,
        })
    }
}

/// Rows of the page.
pub fn read(text: &str) -> Result<Vec<Row>, String> {
    let lines = text.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| joint"));
    lines.map(|line| Row::parse(line).ok_or_else(|| format!("no row: {line}"))).collect()
}

/// Median and worst of a column.
fn both(rows: &[Row], figure: impl Fn(&Row) -> f64) -> String {
    let values: Vec<f64> = rows.iter().map(|row| rounded(figure(row))).collect();
    format!("{:.1} % (worst {:.1} %)", median(values.clone()), values.into_iter().fold(0.0, f64::max))
}

/// As printed.
fn rounded(figure: f64) -> f64 {
    (10.0 * figure).round() / 10.0
}

/// The page with these rows.
pub fn document(rows: &[Row]) -> String {
    let gains = rows.iter().map(|row| rounded(row.tracking[0]) / rounded(row.tracking[1])).collect();
    let summary = format!(
        "In moves {} of the motor's torque is missing with the image, {} without it; in slow reversals {} and {}, and their\n\
         position error falls {:.1} times in the median (by the figures as printed). With adaptation it is {} and {}.\n\
         From 0 °C {}, from 60 °C {}, and {}\n\
         where the board does not know that the joint is warm. No figure is more than a tenth worse than without compensation;\n\
         the test asserts that of each.\n",
        both(rows, |row| row.moves[1]),
        both(rows, |row| row.moves[0]),
        both(rows, |row| row.reversals[1]),
        both(rows, |row| row.reversals[0]),
        median(gains),
        both(rows, |row| row.moves[2]),
        both(rows, |row| row.reversals[2]),
        both(rows, |row| row.cold[1]),
        both(rows, |row| row.hot[1]),
        both(rows, |row| row.restarted[1]),
    );
    let lines: String = rows.iter().map(Row::line).collect();
    include_str!("judging-joints.md.in").replace("SUMMARY\n", &summary).replace("ROWS\n", &lines)
}
