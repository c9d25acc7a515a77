//! Terms and identifiable numbers of the physical friction model, a table each; host.
//!
//! The model itself (`friction_model`) has fields; identification, reports and bounds need to speak of "the third
//! harmonic of the positive direction" as a value. The names and symbols are those of the design's friction formula.
//!
//! A new term is a row of both tables. From a parameter's row follow its index, its texts and its place in the image;
//! from a term's row whether it is considered, the column that stands for it, and its bounds.

use friction_compensation::friction::maxwell_slip::ELEMENTS;
use friction_compensation::friction::physical;
use friction_compensation::friction::ripple::RIPPLES;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Number of odd position harmonics in each direction (003 eq. 5).
pub const HARMONICS: usize = 5;

/// Texts and place in the image of a parameter.
struct Texts {
    /// `{n}` stands for the number, 1-based.
    symbol: &'static str,
    /// As in the symbol, and `{odd}` for the odd number of a harmonic.
    name: &'static str,
    /// `{position}` and `{effort}` stand for those of the data set.
    unit: &'static str,
    /// Coefficient of a parameter set in the image; that of the first one of several.
    coefficient: Option<usize>,
}

/// The place of a coefficient among [`Coefficients`](physical::Coefficients); a name that is none does not compile.
pub const fn place(coefficient: &str) -> usize {
    let (mut place, wanted) = (0, coefficient.as_bytes());
    while place < physical::Coefficients::COUNT {
        let name = physical::Coefficients::NAMES[place].as_bytes();
        let mut equal = 0;
        while equal < wanted.len() && equal < name.len() && wanted[equal] == name[equal] {
            equal += 1;
        }
        if equal == wanted.len() && equal == name.len() {
            return place;
        }
        place += 1;
    }
    panic!("no coefficient of the image has this name")
}

/// Makes [`FrictionParameter`] from a table in the order of the index. Rows of a block come once for each number below
/// the block's, all rows of one number before those of the next: symbol, name, unit, coefficient in the image.
macro_rules! parameters {
    ($([$count:expr] { $(
        $(#[$doc:meta])* $name:ident $(($n:ident))?: $symbol:literal, $text:literal, $unit:literal $(, $coefficient:ident)?;
    )* })*) => {
        /// One identifiable number of the friction model.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum FrictionParameter {
            $($($(#[$doc])* $name $((parameters!(@number $n)))?,)*)*
        }

        /// Rows of the table.
        enum Row { $($($name,)*)* }

        const ROWS: usize = [$($(stringify!($name),)*)*].len();

        /// Rows of each block, and how many times they come.
        const BLOCKS: &[(usize, usize)] = &[$(([$(stringify!($name)),*].len(), $count)),*];

        impl FrictionParameter {
            /// Row and number.
            const fn row(self) -> (usize, usize) {
                match self {
                    $($(Self::$name $(($n))? => (Row::$name as usize, 0 $(+ $n)?),)*)*
                }
            }

            const fn texts(self) -> Texts {
                match self {
                    $($(Self::$name { .. } => Texts {
                        symbol: $symbol,
                        name: $text,
                        unit: $unit,
                        coefficient: parameters!(@place $($coefficient)?),
                    },)*)*
                }
            }

            /// All parameters in the order of their index.
            pub fn all() -> [Self; Self::COUNT] {
                let mut all = Vec::with_capacity(Self::COUNT);
                $(for _n in 0..$count {
                    all.extend([$(Self::$name $((parameters!(@value $n _n)))?),*]);
                })*
                std::array::from_fn(|i| all[i])
            }
        }
    };
    (@number $n:ident) => { usize };
    (@value $n:ident $value:expr) => { $value };
    (@place) => { None };
    (@place $coefficient:ident) => { Some(const { place(stringify!($coefficient)) }) };
}

parameters! {
    [1] {
        /// Constant offset.
        Offset: "c_0", "offset", "{effort}", constant;
        /// Slope of the friction over position.
        PositionSlope: "c_q", "position slope", "{effort}/{position}", position;
        /// Slope of the friction over temperature.
        TemperatureSlope: "c_T", "temperature slope", "{effort}/K", temperature;
        /// Slope of the friction over the theoretical torque.
        LoadSlope: "c_tau", "load slope", "1", load;
        /// Viscous coefficient. A motor's back-EMF is proportional to velocity too and is contained in it.
        Viscous: "f_v", "viscous coefficient", "{effort} s/{position}", viscous;
        /// Relative change of the viscous coefficient with temperature.
        ViscousTemperature: "k_v", "viscous temperature coefficient", "1/K", viscous_temperature;
        /// Coefficient of v |v|.
        Quadratic: "f_2", "quadratic coefficient", "{effort} s^2/{position}^2", quadratic;
        /// Coulomb friction at positive velocity.
        CoulombPositive: "F_c+", "Coulomb friction, positive direction", "{effort}", coulomb_positive;
        /// Coulomb friction at negative velocity.
        CoulombNegative: "F_c-", "Coulomb friction, negative direction", "{effort}", coulomb_negative;
        /// Relative change of the Coulomb friction with temperature.
        CoulombTemperature: "k_c", "Coulomb temperature coefficient", "1/K", coulomb_temperature;
        /// Relative change of the Coulomb friction with the magnitude of the theoretical torque.
        CoulombLoad: "k_l", "Coulomb load coefficient", "1/{effort}", coulomb_load;
        /// Inverse of the Coulomb velocity.
        CoulombSlope: "1/v_c", "Coulomb slope", "s/{position}", coulomb_slope;
        /// Breakaway friction at positive velocity.
        BreakawayPositive: "F_brk+", "breakaway friction, positive direction", "{effort}", breakaway_positive;
        /// Breakaway friction at negative velocity.
        BreakawayNegative: "F_brk-", "breakaway friction, negative direction", "{effort}", breakaway_negative;
        /// Inverse of the Stribeck velocity.
        StribeckSlope: "1/v_st", "Stribeck slope", "s/{position}", stribeck_slope;
        /// Amplitude of the hysteresis.
        Hysteresis: "b_h", "hysteresis amplitude", "{effort}", hysteresis;
        /// Steepness of the hysteresis over velocity.
        HysteresisVelocitySlope: "s", "hysteresis velocity slope", "s/{position}", hysteresis_velocity_slope;
        /// Width of the hysteresis.
        HysteresisWidth: "z", "hysteresis width", "1", hysteresis_width;
        /// Angular frequency of the first position harmonic.
        HarmonicFrequency: "h", "harmonic frequency", "rad/{position}", harmonic_frequency;
        /// Inertia of the rotor.
        RotorInertia: "I_a", "rotor inertia", "{effort} s^2/{position}", rotor_inertia;
    }
    [HARMONICS] {
        /// Amplitude of a position harmonic at positive velocity; 0-based: n stands for the (2 n + 1)-th multiple.
        HarmonicPositive(n): "b_{n}+", "position harmonic {odd}, positive direction", "{effort}", harmonic_positive_1;
    }
    [HARMONICS] {
        /// Amplitude of a position harmonic at negative velocity, numbered alike.
        HarmonicNegative(n): "b_{n}-", "position harmonic {odd}, negative direction", "{effort}", harmonic_negative_1;
    }
    [1] {
        /// Half the difference of the viscous coefficients of both directions.
        ViscousAsymmetry: "f_a", "viscous asymmetry", "{effort} s/{position}", viscous_asymmetry;
        /// Velocity weakening at positive velocity: breakaway over Coulomb friction, less one.
        WeakeningPositive: "w+", "velocity weakening, positive direction", "1", weakening_positive;
        /// Velocity weakening at negative velocity.
        WeakeningNegative: "w-", "velocity weakening, negative direction", "1", weakening_negative;
        /// Inverse of the velocity over which dry friction weakens.
        WeakeningSlope: "1/v_w", "weakening slope", "s/{position}", weakening_slope;
    }
    [ELEMENTS] {
        /// Torque of a pre-sliding element while it slips; 0-based.
        Element(n): "L_{n}", "pre-sliding friction, element {n}", "{effort}";
    }
    [RIPPLES] {
        /// Sine of a ripple of the Coulomb friction; 0-based.
        RippleLevelSine(n): "A_{n}", "ripple {n} of the Coulomb friction, sine", "{effort}";
        /// Cosine of it.
        RippleLevelCosine(n): "B_{n}", "ripple {n} of the Coulomb friction, cosine", "{effort}";
        /// Sine of a ripple whatever the direction; 0-based.
        RippleTorqueSine(n): "C_{n}", "ripple {n} of both directions, sine", "{effort}";
        /// Cosine of it.
        RippleTorqueCosine(n): "D_{n}", "ripple {n} of both directions, cosine", "{effort}";
    }
    [1] {
        /// Part of the dry friction that is lost while the joint that shares the drive leads.
        Relief: "r", "relief by the joint that shares the drive", "1";
    }
}

/// The index of each row's first parameter, and the step to its next.
const PLACES: [(usize, usize); ROWS] = {
    let mut places = [(0, 0); ROWS];
    let (mut block, mut row, mut first) = (0, 0, 0);
    while block < BLOCKS.len() {
        let (rows, count) = BLOCKS[block];
        let mut within = 0;
        while within < rows {
            places[row] = (first + within, rows);
            (row, within) = (row + 1, within + 1);
        }
        (first, block) = (first + rows * count, block + 1);
    }
    places
};

/// Units of a data set's position and effort, in which those of all parameters are expressed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Units {
    /// Unit of position: rad or m.
    pub position: String,
    /// Unit of effort: Nm, N, A or V.
    pub effort: String,
}

impl Default for Units {
    fn default() -> Self {
        Self { position: "rad".into(), effort: "Nm".into() }
    }
}

impl FrictionParameter {
    /// Number of different parameters.
    pub const COUNT: usize = {
        let (mut count, mut block) = (0, 0);
        while block < BLOCKS.len() {
            (count, block) = (count + BLOCKS[block].0 * BLOCKS[block].1, block + 1);
        }
        count
    };

    /// Position in a table of all parameters, 0..COUNT.
    pub const fn index(self) -> usize {
        let (row, n) = self.row();
        PLACES[row].0 + PLACES[row].1 * n
    }

    /// Symbol in the design's formula.
    pub fn symbol(self) -> String {
        self.numbered(self.texts().symbol)
    }

    /// Unit, from those of the data set.
    pub fn unit(self, units: &Units) -> String {
        self.texts().unit.replace("{effort}", &units.effort).replace("{position}", &units.position)
    }

    /// Place among the [`Coefficients`](physical::Coefficients) of a parameter set in the image.
    pub fn coefficient(self) -> Option<usize> {
        self.texts().coefficient.map(|first| first + self.row().1)
    }

    fn numbered(self, text: &str) -> String {
        let (_, n) = self.row();
        text.replace("{n}", &(n + 1).to_string()).replace("{odd}", &(2 * n + 1).to_string())
    }
}

/// The parameter's name in the field's words.
impl fmt::Display for FrictionParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.numbered(self.texts().name))
    }
}

/// Data by which the `full` model considers a term.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Considered {
    /// Any.
    Always,
    /// None: the term is a preset's.
    Never,
    /// Those of a joint whose rigid part has no inertia.
    WithoutRigidInertia,
    /// Motion that covers the position range both ways.
    PositionsCovered,
    /// Train samples that cover enough temperatures.
    TemperaturesCovered,
    /// Those for whose pre-sliding elements distances were chosen.
    ElementsChosen,
    /// Those for which the frequencies of at least so many ripples were chosen.
    RipplesChosen(usize),
    /// Those in which each of two joints that share a drive leads.
    BothLead,
}

/// Role of a column in the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The model is linear in it.
    Coefficient,
    /// Factor of a coefficient: linear while that is held.
    Factor,
    /// Searched as it is.
    Shape,
    /// Searched as a logarithm.
    Slope,
}

/// Bounds of a term's column; their numbers follow from the train rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bounds {
    /// None.
    Free,
    /// Not negative.
    Positive,
    /// Change of a friction over the temperatures.
    OverTemperatures,
    /// Change of a friction over the loads.
    OverLoads,
    /// Part of a friction that another joint takes off.
    OfRelief,
}

/// Facts about a term: when it is considered, and which column stands for it.
#[derive(Clone, Copy, Debug)]
pub struct Facts {
    /// Data by which it is considered.
    pub considered: Considered,
    /// Term without which it means nothing.
    pub beside: Option<Term>,
    /// Parameter whose column the term adds; none where it adds several.
    pub size: Option<FrictionParameter>,
    /// Role and bounds of that column, where it is the term's only one and the parameter's only one.
    pub column: Option<(Role, Bounds)>,
}

const fn considered(considered: Considered) -> Facts {
    Facts { considered, beside: None, size: None, column: None }
}

impl Facts {
    const fn beside(self, term: Term) -> Self {
        Self { beside: Some(term), ..self }
    }

    const fn size(self, parameter: FrictionParameter) -> Self {
        Self { size: Some(parameter), ..self }
    }

    const fn column(self, parameter: FrictionParameter, role: Role, bounds: Bounds) -> Self {
        Self { column: Some((role, bounds)), ..self.size(parameter) }
    }
}

/// Makes [`Term`] from a table in the order of the formula.
macro_rules! terms {
    ($($(#[$doc:meta])* $term:ident = $facts:expr;)*) => {
        /// One summand, or one factor, of the friction formula that can be on or off.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(rename_all = "kebab-case")]
        pub enum Term { $($(#[$doc])* $term,)* }

        impl Term {
            /// All terms, in the order of the formula.
            pub const ALL: [Self; [$(stringify!($term)),*].len()] = [$(Self::$term),*];

            /// Facts about the term.
            pub const fn facts(self) -> Facts {
                use self::{Bounds::*, Considered::*, FrictionParameter as P, Role::*};
                match self { $(Self::$term => $facts,)* }
            }
        }
    };
}

terms! {
    /// c0.
    Constant = considered(Always).column(P::Offset, Coefficient, Free);
    /// c_q q.
    Position = considered(Always).column(P::PositionSlope, Coefficient, Free);
    /// c_T th.
    Temperature = considered(TemperaturesCovered).column(P::TemperatureSlope, Coefficient, Free);
    /// c_tau tau_t.
    Load = considered(Never).column(P::LoadSlope, Coefficient, Free);
    /// f_v v.
    Viscous = considered(Always).column(P::Viscous, Coefficient, Positive);
    /// The factor k_v th of the viscous friction.
    ViscousTemperature = considered(TemperaturesCovered).column(P::ViscousTemperature, Factor, OverTemperatures);
    /// f_2 v |v|.
    Quadratic = considered(Always).column(P::Quadratic, Coefficient, Free);
    /// F_c tanh(v / v_c).
    Coulomb = considered(Always);
    /// The factor k_c th of the Coulomb friction.
    CoulombTemperature =
        considered(TemperaturesCovered).beside(Term::Coulomb).column(P::CoulombTemperature, Factor, OverTemperatures);
    /// The factor k_l |tau_t| of the Coulomb friction.
    CoulombLoad = considered(Always).beside(Term::Coulomb).column(P::CoulombLoad, Factor, OverLoads);
    /// The Stribeck peak.
    Stribeck = considered(Always).beside(Term::Coulomb).size(P::BreakawayPositive);
    /// The hysteresis over velocity and acceleration.
    Hysteresis = considered(Always).size(P::Hysteresis);
    /// The position harmonics.
    Harmonics = considered(PositionsCovered);
    /// I_a a.
    RotorInertia = considered(WithoutRigidInertia).column(P::RotorInertia, Coefficient, Positive);
    /// f_a |v|: half the difference of the viscous friction of both directions.
    ViscousAsymmetry = considered(Always).column(P::ViscousAsymmetry, Coefficient, Free);
    /// Factor of dry friction that falls with speed.
    VelocityWeakening = considered(Always).beside(Term::Coulomb).size(P::WeakeningPositive);
    /// The Maxwell-slip elements.
    PreSliding = considered(ElementsChosen).beside(Term::Coulomb);
    /// The first ripple over the position.
    Ripple = considered(RipplesChosen(1)).beside(Term::Coulomb);
    /// The second ripple over the position.
    SecondRipple = considered(RipplesChosen(2)).beside(Term::Coulomb);
    /// The relief of dry friction while the joint that shares the drive leads.
    Relief = considered(BothLead).beside(Term::Coulomb).column(P::Relief, Factor, OfRelief);
}

impl Term {
    /// The terms that each parameter set of an image has for itself; of the others, elements and ripples are common to
    /// all sets, and the relief is the difference between two.
    pub const OF_A_SET: usize = physical::Terms::COUNT;
}

/// A set of terms; written to files as the list of their names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "Vec<Term>", into = "Vec<Term>")]
pub struct Terms(u32);

impl Terms {
    /// The set of the given terms.
    pub fn of(terms: &[Term]) -> Self {
        terms.iter().fold(Self::default(), |set, &term| set.with(term))
    }

    /// True when the term is on.
    pub const fn contains(self, term: Term) -> bool {
        self.0 & (1 << term as u32) != 0
    }

    /// The set with the term on.
    pub const fn with(self, term: Term) -> Self {
        Self(self.0 | 1 << term as u32)
    }

    /// The set with the term off.
    pub const fn without(self, term: Term) -> Self {
        Self(self.0 & !(1 << term as u32))
    }

    /// The terms that are on, in the order of the formula.
    pub fn iter(self) -> impl Iterator<Item = Term> {
        Term::ALL.into_iter().filter(move |&term| self.contains(term))
    }
}

impl From<Vec<Term>> for Terms {
    fn from(terms: Vec<Term>) -> Self {
        Self::of(&terms)
    }
}

impl From<Terms> for Vec<Term> {
    fn from(terms: Terms) -> Self {
        terms.iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_parameter_has_its_own_index_symbol_and_name() {
        let all = FrictionParameter::all();
        assert!(all.iter().enumerate().all(|(i, p)| p.index() == i));
        assert_eq!(all.iter().map(|p| p.symbol()).collect::<BTreeSet<_>>().len(), FrictionParameter::COUNT);
        assert_eq!(all.iter().map(|p| p.to_string()).collect::<BTreeSet<_>>().len(), FrictionParameter::COUNT);
    }

    #[test]
    fn units_follow_those_of_the_data_set() {
        let emps = Units { position: "m".into(), effort: "N".into() };
        assert_eq!(FrictionParameter::Viscous.unit(&emps), "N s/m");
        assert_eq!(FrictionParameter::CoulombPositive.unit(&emps), "N");
    }
}
