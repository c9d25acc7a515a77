//! The keys of the description that say how signals are treated: cleaning, filters, differentiation, motion states;
//! host.

use super::condition_keys::Condition;
use serde::Deserialize;

/// Dropouts, outliers, gaps and uneven sampling.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Clean {
    /// A row is missing where one of these holds.
    pub dropout: Vec<Condition>,
    /// A row is missing where a column jumps for a single sample.
    pub jump: Vec<Jump>,
    /// A column that should be steady within a run takes the run's median where it is far from it.
    pub steady: Vec<Steady>,
    /// Rows are unused around a read-out that froze and then stepped.
    pub frozen: Vec<Frozen>,
    /// Texts of a numeric field that mean that the row is missing.
    pub missing_text: Vec<String>,
    /// Longest time between two good rows that is bridged by linear interpolation, s; a longer one ends the run and
    /// begins another. Absent: five and a half sampling periods.
    pub max_gap: Option<f64>,
    /// A row is unused where the magnitude of a column reaches a limit.
    pub saturation: Vec<Limit>,
    /// Interpolation of rows onto evenly spaced times.
    pub resample: Resample,
    /// Sampling period, s. Absent: the median of each run.
    pub sample_period: Option<f64>,
    /// Continuous recordings with fewer rows than this are left out.
    pub minimum_run: usize,
}

impl Default for Clean {
    fn default() -> Self {
        Clean {
            dropout: Vec::new(),
            jump: Vec::new(),
            steady: Vec::new(),
            frozen: Vec::new(),
            missing_text: Vec::new(),
            max_gap: None,
            saturation: Vec::new(),
            resample: Resample::Auto,
            sample_period: None,
            minimum_run: 20,
        }
    }
}

/// A single-sample outlier: farther than `limit` from the median of the two good rows before and the two after.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Jump {
    /// Column's name.
    pub column: String,
    /// Largest distance, in the column's unit.
    pub limit: f64,
}

/// A column that should be steady within a run (supply voltage, temperature) but is now and then misread; values
/// farther from the run's median than `limit` take its value.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Steady {
    /// Column's name.
    pub column: String,
    /// Largest distance from the run's median, in the column's unit.
    pub limit: f64,
}

/// A read-out that repeats one value and then steps farther than the joint can move in one sample.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Frozen {
    /// Column's name.
    pub column: String,
    /// Step between neighbouring good rows that is impossible, in the column's unit.
    pub step: f64,
    /// Rows before the repeated value and after the step that are unused too.
    #[serde(default)]
    pub margin: usize,
}

/// A bound on a column's magnitude.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limit {
    /// Column's name.
    pub column: String,
    /// Magnitude from which a row is unused, in the column's unit.
    pub limit: f64,
}

/// Condition for the interpolation of rows onto evenly spaced times.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Resample {
    /// Automatic: where a period differs from the median by more than 2 %, or the sampling period is given.
    #[default]
    Auto,
    /// Always.
    Always,
    /// Never: the rows are taken as evenly spaced, whatever their times say.
    Never,
}

/// Low-pass filters, delays and decimation.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Filter {
    /// Forward and backward (no delay, twice the attenuation); false: forward only, as the joint itself would filter.
    pub zero_phase: bool,
    /// Friction is fitted on position and velocity as the joint's observer sees them in the recording, not on
    /// zero-phase ones. Without effect where `zero_phase` is false. Models are judged on both.
    pub causal_motion: bool,
    /// Bandwidth of the joint's observer, Hz; 1 to 2000.
    pub observer_hz: f64,
    /// Filter of the position.
    pub position: Option<LowPass>,
    /// Filter of the velocity, recorded or differentiated.
    pub velocity: Option<LowPass>,
    /// Filter of the acceleration, the difference of the filtered velocity.
    pub acceleration: Option<LowPass>,
    /// Filter of the effort.
    pub effort: Option<LowPass>,
    /// Filter of the temperature.
    pub temperature: Option<LowPass>,
    /// Time by which the recorded effort lags behind the position, s; it is moved earlier by linear interpolation.
    /// Absent: it is identified from the training samples, and applied where it is significant.
    pub effort_lag: Option<f64>,
    /// Largest magnitude of that time, s; 0 to 1. With 0 nothing is identified.
    pub lag_limit: f64,
    /// Thinning after filtering, differentiation and trimming.
    pub decimate: Option<Decimate>,
}

impl Default for Filter {
    fn default() -> Self {
        Filter {
            zero_phase: true,
            causal_motion: false,
            observer_hz: 100.0,
            position: None,
            velocity: None,
            acceleration: None,
            effort: None,
            temperature: None,
            effort_lag: None,
            lag_limit: 0.05,
            decimate: None,
        }
    }
}

/// A Butterworth low-pass.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LowPass {
    /// Order of one pass, 1 to 12.
    pub order: usize,
    /// Cut-off (-3 dB of one pass), Hz; either this or `cutoff_nyquist`.
    pub cutoff_hz: Option<f64>,
    /// Cut-off as a fraction of the Nyquist frequency.
    pub cutoff_nyquist: Option<f64>,
}

/// Keeping every n-th sample.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Decimate {
    /// Keep one sample out of this many.
    pub factor: usize,
    /// Filter all signals before, zero-phase: Chebyshev type I of order 8, 0.05 dB ripple, 0.8 of the new Nyquist
    /// frequency, as the `decimate` of MATLAB and SciPy does.
    #[serde(default)]
    pub anti_alias: bool,
    /// Samples that are kept.
    #[serde(default)]
    pub keep: Keep,
}

/// Samples that a decimation keeps.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Keep {
    /// The first of a run and every n-th after it (SciPy).
    #[default]
    First,
    /// The last of a run and every n-th before it (MATLAB).
    Last,
}

/// Method of obtaining velocity; the acceleration is always the central difference of the velocity.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Differentiate {
    /// Absent: the column where there is one, else the position.
    pub velocity_from: Option<VelocityFrom>,
}

/// Source of the velocity.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum VelocityFrom {
    /// The recorded velocity.
    Column,
    /// The central difference of the filtered position.
    Position,
}

/// Thresholds of the motion states (mobile-robot paper, section 3.1).
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Classify {
    /// |acceleration| above which the joint is accelerating, unit/s^2. Absent: a tenth of the 95th percentile.
    pub acceleration: Option<f64>,
    /// |velocity| above which the joint is fast, unit/s. Absent: the median.
    pub speed: Option<f64>,
}
