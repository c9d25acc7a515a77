//! Tests on raw columns, evaluated once for every row of the table; host.

use super::condition_keys::{Condition, Value};
use super::load::Table;

/// Flag of each row for which `condition` holds. The columns it names must have been loaded as the kinds that it
/// compares with.
pub fn holds(condition: &Condition, table: &Table) -> Vec<bool> {
    // No value is one of an empty list.
    let mut mask = vec![condition.one_of.as_ref().is_none_or(|list| !list.is_empty()); table.len()];
    if let Some(values) = table.numbers.get(&condition.column) {
        for (holds, &x) in mask.iter_mut().zip(values) {
            *holds &= number_holds(condition, x);
        }
    }
    if let Some(column) = table.texts.get(&condition.column) {
        let words: Vec<bool> = column.words.iter().map(|word| text_holds(condition, word)).collect();
        for (holds, &code) in mask.iter_mut().zip(&column.codes) {
            *holds &= words[code as usize];
        }
    }
    mask
}

/// Flag of each row for which all of `conditions` hold.
pub fn all_hold(conditions: &[Condition], table: &Table) -> Vec<bool> {
    let mut mask = vec![true; table.len()];
    for condition in conditions {
        for (all, one) in mask.iter_mut().zip(holds(condition, table)) {
            *all &= one;
        }
    }
    mask
}

/// Tests for text are passed over: `text_holds` judges them on the column's text.
fn number_holds(condition: &Condition, x: f64) -> bool {
    let same = |value: &Value| match value {
        Value::Number(y) => (x - y).abs() <= 1e-9 * y.abs().max(1.0),
        Value::Text(_) => false,
    };
    let is_number = |value: &&Value| matches!(value, Value::Number(_));
    condition.equals.iter().filter(is_number).all(same)
        && condition.one_of.as_ref().is_none_or(|list| !list.iter().any(|v| is_number(&v)) || list.iter().any(same))
        && !condition.not_in.iter().flatten().any(same)
        && condition.inside.is_none_or(|[low, high]| x >= low && x <= high)
        && condition.outside.is_none_or(|[low, high]| x < low || x > high)
}

fn text_holds(condition: &Condition, text: &str) -> bool {
    let same = |value: &Value| matches!(value, Value::Text(expected) if expected == text);
    let is_text = |value: &&Value| matches!(value, Value::Text(_));
    condition.equals.iter().filter(is_text).all(same)
        && condition.one_of.as_ref().is_none_or(|list| !list.iter().any(|v| is_text(&v)) || list.iter().any(same))
        && !condition.not_in.iter().flatten().any(same)
        && condition
            .starts_with
            .as_ref()
            .is_none_or(|starts| starts.iter().any(|start| text.starts_with(start.as_str())))
}
