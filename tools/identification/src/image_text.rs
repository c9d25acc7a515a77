//! The parameter image as text: a TOML twin that a person can read and edit; host.
//!
//! The two convert without loss: every number of the image is a multiple of a power of two and is written with as many
//! digits as f64 needs. Coefficients stand in SI; those that are zero are left out. Terms that are off keep theirs.

use crate::quantize::QuantizeError;
use crate::quantize::full_scale::{from_q16, from_si, to_integer, to_q16, to_si, to_unsigned_q8, to_unsigned_q16};
use friction_compensation::friction::common::CommonTerms;
use friction_compensation::friction::domain::{Domain, Range};
use friction_compensation::friction::maxwell_slip::MaxwellElement;
use friction_compensation::friction::network::{INPUTS, NEURONS, NetworkParameters, Neuron};
use friction_compensation::friction::physical::{Coefficients, PhysicalParameters, Terms};
use friction_compensation::friction::regime::{Criterion, MAX_CRITERIA, MAX_SETS, Measure, Selector};
use friction_compensation::friction::ripple::Ripple;
use friction_compensation::friction::state::{SIGNALS, Signal};
use friction_compensation::friction::{Estimate, FrictionParameters, ParameterSet};
use friction_compensation::parameters::certificate::Limits;
use friction_compensation::parameters::image::{Effort, FORMAT, GoldenVector, Image, MAX_GOLDEN, Target};
use friction_compensation::quantity::Torque;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Reason for which a text is not an image.
#[derive(Debug, thiserror::Error)]
pub enum TextError {
    /// Not TOML, an unknown key, a missing key or a value of the wrong type; the message has line and column.
    #[error("{0}")]
    Toml(#[from] toml::de::Error),
    /// Written for another format.
    #[error("format is {found}, this program reads formats 1 to {FORMAT}")]
    Format {
        /// Format of the text.
        found: u16,
    },
    /// A name that is not known here.
    #[error("{key} is {found:?}; known are {known}")]
    Name {
        /// Key whose value it is.
        key: &'static str,
        /// The value.
        found: String,
        /// Values that it may have.
        known: String,
    },
    /// Too few or too many entries of a list.
    #[error("there are {found} entries of [[{key}]]; {expected} are needed")]
    Count {
        /// Name of the list.
        key: &'static str,
        /// Entries present.
        found: usize,
        /// Number that is needed.
        expected: String,
    },
    /// A number that the image cannot hold.
    #[error(transparent)]
    Quantize(#[from] QuantizeError),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ImageText {
    format: u16,
    version: u32,
    /// Seconds since 1970-01-01 UTC, 0 = not stated.
    created: u64,
    effort: String,
    data_hash: String,
    target: TargetText,
    limits: LimitsText,
    domain: BTreeMap<String, toml::Value>,
    selector: SelectorText,
    #[serde(default, skip_serializing_if = "CommonText::is_none")]
    common: CommonText,
    set: Vec<SetText>,
    golden: Vec<GoldenText>,
}

#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CommonText {
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    element: Vec<ElementText>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    ripple: Vec<RippleText>,
}

impl CommonText {
    fn is_none(&self) -> bool {
        self.element.is_empty() && self.ripple.is_empty()
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ElementText {
    /// 1/rad.
    stiffness: f64,
    level: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RippleText {
    /// Periods in a rad.
    periods: f64,
    level_sine: f64,
    level_cosine: f64,
    torque_sine: f64,
    torque_cosine: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TargetText {
    product: u32,
    serial: u32,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LimitsText {
    output: f64,
    torque_gain: f64,
    velocity_slope: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SelectorText {
    fade_time: f64,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    criterion: Vec<CriterionText>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CriterionText {
    measure: String,
    enter: f64,
    leave: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SetText {
    terms: Vec<String>,
    physical: BTreeMap<String, f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    network: Option<NetworkText>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct NetworkText {
    scale: f64,
    /// Layer 0: five weights and a bias for each neuron.
    first: [[f64; INPUTS + 1]; NEURONS],
    hidden: Vec<Vec<NeuronText>>,
    output: NeuronText,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct NeuronText {
    weights: [f64; NEURONS + 1],
    fraction: u8,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct GoldenText {
    set: u8,
    signals: [f64; SIGNALS],
    physical: f64,
    network: f64,
}

/// The image as TOML.
pub fn to_text(image: &Image) -> String {
    let shifts = image.friction.domain.shifts();
    let sets = image.friction.sets.iter().take(image.friction.selector.sets());
    let text = ImageText {
        format: image.format(),
        version: image.version,
        created: image.created,
        effort: image.effort.symbol().to_owned(),
        data_hash: image.data_hash.iter().map(|byte| format!("{byte:02x}")).collect(),
        target: TargetText { product: image.target.product, serial: image.target.serial },
        limits: LimitsText {
            output: f64::from(image.limits.output) / 65536.0,
            torque_gain: f64::from(image.limits.torque_gain) / 65536.0,
            velocity_slope: f64::from(image.limits.velocity_slope) / 256.0,
        },
        domain: domain_text(&image.friction.domain),
        selector: selector_text(&image.friction.selector),
        common: common_text(&image.friction.common),
        set: sets.map(|set| set_text(set, &shifts)).collect(),
        golden: image.golden.iter().map(golden_text).collect(),
    };
    let body = toml::to_string(&text).expect("tables and numbers are always TOML");
    format!("# Friction parameters of a joint. Units: SI, with the effort's unit for torque.\n{body}")
}

/// The image that a TOML text describes. Golden vectors are taken as they stand: whether they still hold after an edit
/// is for [`Image::verify_golden`] to say.
pub fn from_text(text: &str) -> Result<Image, TextError> {
    // A text of another format may have other keys: its format is looked at first.
    #[derive(Deserialize)]
    struct Head {
        format: u16,
    }
    let Head { format } = toml::from_str(text)?;
    if !(1..=FORMAT).contains(&format) {
        return Err(TextError::Format { found: format });
    }
    let text: ImageText = toml::from_str(text)?;
    let domain = domain_of(&text.domain)?;
    let selector = selector_of(&text.selector)?;
    if text.set.len() != selector.sets() {
        let expected = format!("{} (as the criteria demand)", selector.sets());
        return Err(TextError::Count { key: "set", found: text.set.len(), expected });
    }
    let shifts = domain.shifts();
    let mut sets = [ParameterSet::default(); MAX_SETS];
    for (place, set) in sets.iter_mut().zip(&text.set) {
        *place = set_of(set, &shifts)?;
    }
    let golden = text.golden.iter().map(golden_of).collect::<Result<Vec<_>, _>>()?;
    let golden = heapless::Vec::from_slice(&golden).map_err(|_| TextError::Count {
        key: "golden",
        found: text.golden.len(),
        expected: format!("1 to {MAX_GOLDEN}"),
    })?;
    Ok(Image {
        version: text.version,
        target: Target { product: text.target.product, serial: text.target.serial },
        created: text.created,
        effort: named("effort", &text.effort, Effort::ALL, Effort::symbol)?,
        data_hash: hash_of(&text.data_hash)?,
        friction: FrictionParameters { domain, selector, common: common_of(&text.common)?, sets },
        limits: Limits {
            output: to_unsigned_q16("limits.output", text.limits.output)?,
            torque_gain: to_unsigned_q16("limits.torque_gain", text.limits.torque_gain)?,
            velocity_slope: to_unsigned_q8("limits.velocity_slope", text.limits.velocity_slope)?,
        },
        golden,
    })
}

/// The value whose name is `found`.
fn named<T: Copy>(
    key: &'static str,
    found: &str,
    all: impl IntoIterator<Item = T> + Clone,
    name: impl Fn(T) -> &'static str,
) -> Result<T, TextError> {
    all.clone().into_iter().find(|value| name(*value) == found).ok_or_else(|| TextError::Name {
        key,
        found: found.to_owned(),
        known: all.into_iter().map(&name).collect::<Vec<_>>().join(", "),
    })
}

fn hash_of(text: &str) -> Result<[u8; 16], TextError> {
    let refused =
        || TextError::Name { key: "data_hash", found: text.to_owned(), known: "32 hexadecimal digits".to_owned() };
    if text.len() != 32 || !text.is_ascii() {
        return Err(refused());
    }
    let mut hash = [0; 16];
    for (byte, digits) in hash.iter_mut().zip(text.as_bytes().chunks(2)) {
        let digits = std::str::from_utf8(digits).map_err(|_| refused())?;
        *byte = u8::from_str_radix(digits, 16).map_err(|_| refused())?;
    }
    Ok(hash)
}

fn domain_text(domain: &Domain) -> BTreeMap<String, toml::Value> {
    let mut table = BTreeMap::new();
    for (range, signal) in domain.ranges.iter().zip(Signal::ALL) {
        let value = match *range {
            Range::ANY => toml::Value::String("any".to_owned()),
            Range { low, high } => toml::Value::Array(vec![from_q16(low).into(), from_q16(high).into()]),
        };
        table.insert(signal.name().to_owned(), value);
    }
    table.insert("margin".to_owned(), (f64::from(domain.margin) / 65536.0).into());
    table.insert("reference_temperature".to_owned(), from_q16(domain.reference_temperature).into());
    table
}

fn domain_of(table: &BTreeMap<String, toml::Value>) -> Result<Domain, TextError> {
    let known = || Signal::ALL.map(Signal::name).join(", ") + ", margin, reference_temperature";
    let refused = |found: String| TextError::Name { key: "domain", found, known: known() };
    if let Some(unknown) = table.keys().find(|key| !known().split(", ").any(|name| name == *key)) {
        return Err(refused(unknown.clone()));
    }
    let number = |value: &toml::Value| value.as_float().or_else(|| value.as_integer().map(|i| i as f64));
    let entry = |key: &str| table.get(key).ok_or_else(|| refused(format!("without {key}")));
    let single = |key: &str| {
        let value = entry(key)?;
        number(value).ok_or_else(|| refused(format!("{key} = {value}, not a number")))
    };
    let mut ranges = [Range::ANY; SIGNALS];
    for (range, signal) in ranges.iter_mut().zip(Signal::ALL) {
        let key = signal.name();
        let value = entry(key)?;
        let ends: Option<Vec<f64>> = value.as_array().and_then(|list| list.iter().map(number).collect());
        *range = match ends.as_deref() {
            Some([low, high]) if low <= high => Range { low: to_q16(key, *low)?, high: to_q16(key, *high)? },
            None if value.as_str() == Some("any") => Range::ANY,
            _ => return Err(refused(format!("{key} = {value}, neither \"any\" nor [lowest, highest]"))),
        };
    }
    Ok(Domain {
        ranges,
        margin: to_unsigned_q16("domain.margin", single("margin")?)?,
        reference_temperature: to_q16("domain.reference_temperature", single("reference_temperature")?)?,
    })
}

const MEASURES: [Measure; 3] = [Measure::Acceleration, Measure::Speed, Measure::Coupled];

fn measure_name(measure: Measure) -> &'static str {
    match measure {
        Measure::Acceleration => "acceleration",
        Measure::Speed => "speed",
        Measure::Coupled => "coupled",
    }
}

fn selector_text(selector: &Selector) -> SelectorText {
    let criterion = selector.criteria.iter().flatten().map(|criterion| CriterionText {
        measure: measure_name(criterion.measure).to_owned(),
        enter: from_q16(criterion.enter),
        leave: from_q16(criterion.leave),
    });
    SelectorText { fade_time: f64::from(selector.fade_time) / 65536.0, criterion: criterion.collect() }
}

fn selector_of(text: &SelectorText) -> Result<Selector, TextError> {
    if text.criterion.len() > MAX_CRITERIA {
        let expected = format!("at most {MAX_CRITERIA}");
        return Err(TextError::Count { key: "selector.criterion", found: text.criterion.len(), expected });
    }
    let mut criteria = [None; MAX_CRITERIA];
    for (place, criterion) in criteria.iter_mut().zip(&text.criterion) {
        *place = Some(Criterion {
            measure: named("selector.criterion.measure", &criterion.measure, MEASURES, measure_name)?,
            enter: to_q16("selector.criterion.enter", criterion.enter)?,
            leave: to_q16("selector.criterion.leave", criterion.leave)?,
        });
    }
    Ok(Selector { criteria, fade_time: to_unsigned_q16("selector.fade_time", text.fade_time)? })
}

/// Elements and ripples up to the last that is there.
fn common_text(common: &CommonTerms) -> CommonText {
    let elements = common.elements.iter().rposition(|e| *e != MaxwellElement::default()).map_or(0, |last| last + 1);
    let ripples = common.ripples.iter().rposition(|r| *r != Ripple::default()).map_or(0, |last| last + 1);
    let element = |e: &MaxwellElement| ElementText { stiffness: from_q16(e.stiffness), level: from_q16(e.level) };
    let ripple = |r: &Ripple| RippleText {
        periods: from_q16(r.periods),
        level_sine: from_q16(r.level_sine),
        level_cosine: from_q16(r.level_cosine),
        torque_sine: from_q16(r.torque_sine),
        torque_cosine: from_q16(r.torque_cosine),
    };
    CommonText {
        element: common.elements[..elements].iter().map(element).collect(),
        ripple: common.ripples[..ripples].iter().map(ripple).collect(),
    }
}

fn common_of(text: &CommonText) -> Result<CommonTerms, TextError> {
    let mut common = CommonTerms::NONE;
    let too_many = |key, found, most: usize| TextError::Count { key, found, expected: format!("at most {most}") };
    if text.element.len() > common.elements.len() {
        return Err(too_many("common.element", text.element.len(), common.elements.len()));
    }
    if text.ripple.len() > common.ripples.len() {
        return Err(too_many("common.ripple", text.ripple.len(), common.ripples.len()));
    }
    for (place, element) in common.elements.iter_mut().zip(&text.element) {
        *place = MaxwellElement {
            stiffness: to_q16("common.element.stiffness", element.stiffness)?,
            level: to_q16("common.element.level", element.level)?,
        };
    }
    for (place, ripple) in common.ripples.iter_mut().zip(&text.ripple) {
        *place = Ripple {
            periods: to_q16("common.ripple.periods", ripple.periods)?,
            level_sine: to_q16("common.ripple.level_sine", ripple.level_sine)?,
            level_cosine: to_q16("common.ripple.level_cosine", ripple.level_cosine)?,
            torque_sine: to_q16("common.ripple.torque_sine", ripple.torque_sine)?,
            torque_cosine: to_q16("common.ripple.torque_cosine", ripple.torque_cosine)?,
        };
    }
    Ok(common)
}

fn set_text(set: &ParameterSet, shifts: &[u32; SIGNALS]) -> SetText {
    let terms = Terms::NAMES.iter().enumerate();
    let on = terms.filter(|(bit, _)| set.physical.terms.contains(Terms(1 << bit)));
    let values = set.physical.coefficients.to_array();
    let physical = (0..Coefficients::COUNT)
        .filter(|&i| values[i] != 0)
        .map(|i| (Coefficients::NAMES[i].to_owned(), to_si(values[i], Coefficients::DIMENSIONS[i], shifts)));
    SetText {
        terms: on.map(|(_, name)| (*name).to_owned()).collect(),
        physical: physical.collect(),
        network: set.network.as_ref().map(network_text),
    }
}

fn set_of(text: &SetText, shifts: &[u32; SIGNALS]) -> Result<ParameterSet, TextError> {
    let mut terms = Terms::default();
    for name in &text.terms {
        let bit = named("set.terms", name, 0..Terms::NAMES.len(), |bit| Terms::NAMES[bit])?;
        terms = terms.union(Terms(1 << bit));
    }
    let mut values = [0; Coefficients::COUNT];
    for (name, value) in &text.physical {
        let i = named("set.physical", name, 0..Coefficients::COUNT, |i| Coefficients::NAMES[i])?;
        values[i] = from_si(name, *value, Coefficients::DIMENSIONS[i], shifts)?;
    }
    let physical = PhysicalParameters { terms, coefficients: Coefficients::from_array(values) };
    Ok(ParameterSet { physical, network: text.network.as_ref().map(network_of).transpose()? })
}

const FIRST_WEIGHT: f64 = 67_108_864.0; // 2^26
const FIRST_BIAS: f64 = 33_554_432.0; // 2^25

fn first_unit(i: usize) -> f64 {
    if i < INPUTS { FIRST_WEIGHT } else { FIRST_BIAS }
}

fn network_text(network: &NetworkParameters) -> NetworkText {
    NetworkText {
        scale: from_q16(network.scale),
        first: network.first.map(|row| std::array::from_fn(|i| f64::from(row[i]) / first_unit(i))),
        hidden: network.hidden.iter().map(|layer| layer.iter().map(neuron_text).collect()).collect(),
        output: neuron_text(&network.output),
    }
}

fn network_of(text: &NetworkText) -> Result<NetworkParameters, TextError> {
    let mut network = NetworkParameters { scale: to_q16("network.scale", text.scale)?, ..Default::default() };
    let (low, high) = (f64::from(i32::MIN), f64::from(i32::MAX));
    for (row, values) in network.first.iter_mut().zip(&text.first) {
        for (i, (place, value)) in row.iter_mut().zip(values).enumerate() {
            *place = to_integer("network.first", *value, first_unit(i), low, high)?;
        }
    }
    let sizes: Vec<usize> = text.hidden.iter().map(Vec::len).collect();
    if sizes != [NEURONS; 2] {
        let (found, expected) = (sizes.iter().sum(), format!("2 layers of {NEURONS}"));
        return Err(TextError::Count { key: "set.network.hidden", found, expected });
    }
    for (place, neuron) in network.hidden.iter_mut().flatten().zip(text.hidden.iter().flatten()) {
        *place = neuron_of(neuron)?;
    }
    network.output = neuron_of(&text.output)?;
    Ok(network)
}

fn neuron_text(neuron: &Neuron) -> NeuronText {
    let unit = 2f64.powi(i32::from(neuron.fraction));
    NeuronText { weights: neuron.weights.map(|weight| f64::from(weight) / unit), fraction: neuron.fraction }
}

fn neuron_of(text: &NeuronText) -> Result<Neuron, TextError> {
    let unit = 2f64.powi(i32::from(text.fraction));
    let mut weights = [0; NEURONS + 1];
    for (place, weight) in weights.iter_mut().zip(text.weights) {
        let (low, high) = (f64::from(i16::MIN), f64::from(i16::MAX));
        *place = to_integer("network weight", weight, unit, low, high)? as i16;
    }
    Ok(Neuron { weights, fraction: text.fraction })
}

fn golden_text(vector: &GoldenVector) -> GoldenText {
    GoldenText {
        set: vector.set,
        signals: vector.signals.map(from_q16),
        physical: vector.expected.physical.to_f64(),
        network: vector.expected.network.to_f64(),
    }
}

fn golden_of(text: &GoldenText) -> Result<GoldenVector, TextError> {
    let mut signals = [0; SIGNALS];
    for (place, signal) in signals.iter_mut().zip(text.signals) {
        *place = to_q16("golden.signals", signal)?;
    }
    let torque = |key: &str, value: f64| to_q16(key, value).map(Torque::from_bits);
    let expected = Estimate {
        physical: torque("golden.physical", text.physical)?,
        network: torque("golden.network", text.network)?,
    };
    Ok(GoldenVector { set: text.set, signals, expected })
}
