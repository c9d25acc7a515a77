//! The keys of a test on one column, as a description of a data set has them; host.

use serde::Deserialize;

/// A number or a text to compare a column with.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(untagged)]
pub enum Value {
    /// Compared with the column's numbers, within 1e-9 of the value.
    Number(f64),
    /// Compared with the column's text, exactly.
    Text(String),
}

impl Value {
    /// The value as it stands in a table, for comparison with a label.
    pub fn text(&self) -> String {
        match self {
            Value::Number(number) => number.to_string(),
            Value::Text(text) => text.clone(),
        }
    }
}

/// A test on one column; the tests that are given must all hold.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Column of the recordings or of the table of runs.
    pub column: String,
    /// Equal to this value.
    pub equals: Option<Value>,
    /// Equal to one of these values.
    #[serde(rename = "in")]
    pub one_of: Option<Vec<Value>>,
    /// Equal to none of these values.
    pub not_in: Option<Vec<Value>>,
    /// Text that begins with one of these.
    pub starts_with: Option<Vec<String>>,
    /// Range between these two numbers, ends included.
    pub inside: Option<[f64; 2]>,
    /// Below the first or above the second of these two numbers.
    pub outside: Option<[f64; 2]>,
}
