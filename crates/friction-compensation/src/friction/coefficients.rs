//! Terms of the physical model and their coefficients, one table: names, order in an image, and the format of an image
//! that each came with; any context.
//!
//! A new term is a row at the end of the terms and its coefficients at the end of theirs, in a new format. From the
//! rows follow what an image of each format holds, the oldest format that holds a model, and which coefficients a term
//! switches off. Their evaluation is in [`physical`](super::physical).

use super::state::Signal;

/// Terms that take part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Terms(pub u32);

impl Terms {
    /// True where every term of `other` takes part.
    #[inline(always)]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// The terms of both.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// Quantity that a coefficient is multiplied with: decides its unit and its scale in SI.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dimension {
    /// Signal whose full scale is contained in the stored number, and its power.
    pub per: Option<(Signal, u8)>,
    /// True for torques, false for dimensionless numbers.
    pub torque: bool,
}

/// Makes [`Terms`], [`Coefficients`] and [`Factors`] from one table.
///
/// A coefficient is a `torque` or a dimensionless `number`, at full scale of a signal where it is multiplied with one
/// (`per`). It matters where one of the terms behind `of` takes part. It is a member of [`Factors`] where it is used as
/// it is: `switched` off without its term, or `kept`, where nothing asks for it then.
macro_rules! physical_model {
    (
        formats { $($known:literal)* }
        terms { $($(#[$term_doc:meta])* $term:ident: $term_name:literal since $term_format:literal;)* }
        coefficients { $(
            $(#[$doc:meta])*
            $name:ident: $dimension:ident $(per $signal:ident ^ $power:literal)?,
            of $of:ident $(or $other:ident)* since $format:literal $(, $factor:ident)?;
        )* }
    ) => {
        /// Bits of [`Terms`].
        #[allow(non_camel_case_types, clippy::upper_case_acronyms, reason = "named as the constants are")]
        enum Bit { $($term),* }

        impl Terms {
            $($(#[$term_doc])* pub const $term: Self = Self(1 << Bit::$term as u32);)*
            /// Number of terms.
            pub const COUNT: usize = Self::NAMES.len();
            /// Every term.
            pub const ALL: Self = Self((1 << Self::COUNT) - 1);
            /// Names of the terms, from bit 0 up.
            pub const NAMES: [&'static str; [$($term_name),*].len()] = [$($term_name),*];
            /// Format of an image that each term came with, from bit 0 up.
            pub const FORMATS: [u16; Self::COUNT] = [$($term_format),*];
        }

        /// The coefficients as they are stored and transferred: Q16.16 at full scale of the signals.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct Coefficients {
            $($(#[$doc])* pub $name: i32,)*
        }

        impl Coefficients {
            /// Number of coefficients.
            pub const COUNT: usize = [$(stringify!($name)),*].len();
            /// Names, in the order of [`Coefficients::to_array`].
            pub const NAMES: [&'static str; Self::COUNT] = [$(stringify!($name)),*];
            /// Dimensions, in the same order.
            pub const DIMENSIONS: [Dimension; Self::COUNT] = [$(Dimension {
                torque: physical_model!(@is_torque $dimension),
                per: physical_model!(@per $($signal $power)?),
            }),*];
            /// Terms of which one at least makes each coefficient matter, in the same order.
            pub const TERMS: [Terms; Self::COUNT] = [$(Terms::$of $(.union(Terms::$other))*),*];
            /// Format of an image that each coefficient came with, in the same order.
            pub const FORMATS: [u16; Self::COUNT] = [$($format),*];

            /// All coefficients in a fixed order.
            pub const fn to_array(&self) -> [i32; Self::COUNT] {
                [$(self.$name),*]
            }

            /// The coefficients in the order of [`Coefficients::to_array`].
            pub const fn from_array(array: [i32; Self::COUNT]) -> Self {
                let [$($name),*] = array;
                Self { $($name),* }
            }
        }

        /// The coefficients that are used as they are, those of absent terms zero.
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct Factors {
            $($(pub(crate) $name: physical_model!(@number $factor),)?)*
        }

        impl Factors {
            /// Factors of no term.
            pub(super) const NONE: Self = Self::new(Terms(0), &Coefficients::from_array([0; Coefficients::COUNT]));

            #[inline(always)]
            pub(super) const fn new(terms: Terms, c: &Coefficients) -> Self {
                Self { $($($name: physical_model!(@$factor terms, Terms::$of, c.$name),)?)* }
            }
        }

        /// Formats of an image, oldest first.
        const FORMATS: &[u16] = &[$($known),*];

        /// The terms that an image of a format can have, and the number of its coefficients, the first ones.
        #[inline(always)]
        pub const fn held_by(format: u16) -> (Terms, usize) {
            match format {
                $($known => const { (terms_of($known), coefficients_of($known)) },)*
                _ => (Terms::ALL, Coefficients::COUNT),
            }
        }
    };
    (@is_torque torque) => { true };
    (@is_torque number) => { false };
    (@per) => { None };
    (@per $signal:ident $power:literal) => { Some((Signal::$signal, $power)) };
    (@number $factor:ident) => { i32 };
    (@switched $terms:expr, $term:expr, $value:expr) => { if $terms.contains($term) { $value } else { 0 } };
    (@kept $terms:expr, $term:expr, $value:expr) => { $value };
}

physical_model! {
    formats { 1 2 3 }
    terms {
        /// c0.
        CONSTANT: "constant" since 1;
        /// c_q q.
        POSITION: "position" since 1;
        /// c_T th.
        TEMPERATURE: "temperature" since 1;
        /// c_tau tau.
        LOAD: "load" since 1;
        /// f_v v.
        VISCOUS: "viscous" since 1;
        /// Factor 1 + k_v th of the viscous term.
        VISCOUS_TEMPERATURE: "viscous_temperature" since 1;
        /// f_2 v |v|.
        QUADRATIC: "quadratic" since 1;
        /// F_c tanh(v / v_c).
        COULOMB: "coulomb" since 1;
        /// Part k_c th of the Coulomb term's factor.
        COULOMB_TEMPERATURE: "coulomb_temperature" since 1;
        /// Part k_l |tau| of the Coulomb term's factor.
        COULOMB_LOAD: "coulomb_load" since 1;
        /// The Stribeck term.
        STRIBECK: "stribeck" since 1;
        /// The hysteresis term.
        HYSTERESIS: "hysteresis" since 1;
        /// The position harmonics.
        HARMONICS: "harmonics" since 1;
        /// I_a a.
        ROTOR_INERTIA: "rotor_inertia" since 1;
        /// f_a |v|.
        VISCOUS_ASYMMETRY: "viscous_asymmetry" since 2;
        /// Factor 1 + w (1 - tanh(v / v_w)^2) of dry friction.
        VELOCITY_WEAKENING: "velocity_weakening" since 3;
    }
    coefficients {
        /// c0, Nm.
        constant: torque, of CONSTANT since 1, switched;
        /// c_q, Nm at full-scale position.
        position: torque per Position ^ 1, of POSITION since 1, switched;
        /// c_T, Nm at full-scale temperature difference.
        temperature: torque per Temperature ^ 1, of TEMPERATURE since 1, switched;
        /// c_tau, Nm at full-scale theoretical torque.
        load: torque per TheoreticalTorque ^ 1, of LOAD since 1, switched;
        /// f_v, Nm at full-scale velocity.
        viscous: torque per Velocity ^ 1, of VISCOUS since 1, switched;
        /// k_v at full-scale temperature difference.
        viscous_temperature: number per Temperature ^ 1, of VISCOUS_TEMPERATURE since 1, switched;
        /// f_2, Nm at full-scale velocity.
        quadratic: torque per Velocity ^ 2, of QUADRATIC since 1, switched;
        /// F_c for positive velocity, Nm.
        coulomb_positive: torque, of COULOMB since 1;
        /// F_c for negative velocity, Nm.
        coulomb_negative: torque, of COULOMB since 1;
        /// k_c at full-scale temperature difference.
        coulomb_temperature: number per Temperature ^ 1, of COULOMB_TEMPERATURE since 1, switched;
        /// k_l at full-scale theoretical torque.
        coulomb_load: number per TheoreticalTorque ^ 1, of COULOMB_LOAD since 1, switched;
        /// 1 / v_c times full-scale velocity.
        coulomb_slope: number per Velocity ^ 1, of COULOMB or HARMONICS since 1, kept;
        /// F_brk for positive velocity, Nm.
        breakaway_positive: torque, of STRIBECK since 1;
        /// F_brk for negative velocity, Nm.
        breakaway_negative: torque, of STRIBECK since 1;
        /// 1 / v_st times full-scale velocity.
        stribeck_slope: number per Velocity ^ 1, of STRIBECK since 1, kept;
        /// b_h, Nm (per rad of arc tangent).
        hysteresis: torque, of HYSTERESIS since 1;
        /// s times full-scale velocity.
        hysteresis_velocity_slope: number per Velocity ^ 1, of HYSTERESIS since 1, kept;
        /// z.
        hysteresis_width: number, of HYSTERESIS since 1, kept;
        /// k_a times full-scale acceleration.
        hysteresis_acceleration_slope: number per Acceleration ^ 1, of HYSTERESIS since 1, kept;
        /// h times full-scale position, rad.
        harmonic_frequency: number per Position ^ 1, of HARMONICS since 1;
        /// b_1 for positive velocity, Nm.
        harmonic_positive_1: torque, of HARMONICS since 1;
        /// b_2 for positive velocity, Nm.
        harmonic_positive_2: torque, of HARMONICS since 1;
        /// b_3 for positive velocity, Nm.
        harmonic_positive_3: torque, of HARMONICS since 1;
        /// b_4 for positive velocity, Nm.
        harmonic_positive_4: torque, of HARMONICS since 1;
        /// b_5 for positive velocity, Nm.
        harmonic_positive_5: torque, of HARMONICS since 1;
        /// b_1 for negative velocity, Nm.
        harmonic_negative_1: torque, of HARMONICS since 1;
        /// b_2 for negative velocity, Nm.
        harmonic_negative_2: torque, of HARMONICS since 1;
        /// b_3 for negative velocity, Nm.
        harmonic_negative_3: torque, of HARMONICS since 1;
        /// b_4 for negative velocity, Nm.
        harmonic_negative_4: torque, of HARMONICS since 1;
        /// b_5 for negative velocity, Nm.
        harmonic_negative_5: torque, of HARMONICS since 1;
        /// I_a, Nm at full-scale acceleration.
        rotor_inertia: torque per Acceleration ^ 1, of ROTOR_INERTIA since 1, switched;
        /// f_a, Nm at full-scale velocity.
        viscous_asymmetry: torque per Velocity ^ 1, of VISCOUS_ASYMMETRY since 2, switched;
        /// w for positive velocity: breakaway over Coulomb friction, less one.
        weakening_positive: number, of VELOCITY_WEAKENING since 3;
        /// w for negative velocity.
        weakening_negative: number, of VELOCITY_WEAKENING since 3;
        /// 1 / v_w times full-scale velocity.
        weakening_slope: number per Velocity ^ 1, of VELOCITY_WEAKENING since 3, kept;
    }
}

/// The newest format of an image.
pub const NEWEST_FORMAT: u16 = FORMATS[FORMATS.len() - 1];

/// Number of rows at the top of a column of formats that are not newer than `format`.
const fn not_newer(column: &[u16], format: u16) -> usize {
    let mut count = 0;
    while count < column.len() && column[count] <= format {
        count += 1;
    }
    count
}

const fn terms_of(format: u16) -> Terms {
    Terms((1 << not_newer(&Terms::FORMATS, format)) - 1)
}

const fn coefficients_of(format: u16) -> usize {
    not_newer(&Coefficients::FORMATS, format)
}

/// The oldest format of an image that holds a model.
pub(super) fn oldest_format(terms: Terms, coefficients: &Coefficients) -> u16 {
    let holds = |format: u16| {
        let (known, count) = held_by(format);
        known.contains(terms) && coefficients.to_array().into_iter().skip(count).all(|bits| bits == 0)
    };
    FORMATS.iter().copied().find(|&format| holds(format)).unwrap_or(NEWEST_FORMAT)
}

/// True for rows in an order that an image can have: the format rises from one to the next, up to the newest.
const fn in_order(column: &[u16]) -> bool {
    let mut row = 0;
    while row < column.len() {
        let before = if row == 0 { 1 } else { column[row - 1] };
        if column[row] < before || column[row] > NEWEST_FORMAT {
            return false;
        }
        row += 1;
    }
    true
}

/// True where no coefficient is older than its terms, and each term has one that came with it.
const fn each_term_has_its_coefficients() -> bool {
    let (mut row, mut found) = (0, 0);
    while row < Coefficients::COUNT {
        let (of, format) = (Coefficients::TERMS[row], Coefficients::FORMATS[row]);
        let oldest = Terms::FORMATS[of.0.trailing_zeros() as usize];
        if format < oldest {
            return false;
        }
        if format == oldest {
            found |= of.0;
        }
        row += 1;
    }
    found == Terms::ALL.0
}

const _: () = assert!(Terms::COUNT <= 16, "an image has 16 bits for terms");
const _: () = assert!(in_order(&Terms::FORMATS), "a new term goes to the end, with the newest format");
const _: () = assert!(in_order(&Coefficients::FORMATS), "a new coefficient goes to the end, with the newest format");
const _: () = assert!(each_term_has_its_coefficients(), "a term and its coefficients are of one format");
const _: () = assert!(coefficients_of(NEWEST_FORMAT - 1) < Coefficients::COUNT, "the newest format has no coefficient");
