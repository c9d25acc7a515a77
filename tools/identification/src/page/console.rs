//! The errors of one test set as a table for a terminal: plain text, aligned, one row for each model; host.

use super::ErrorTable;
use report::number::{NONE, optional, percent};

/// Choice of the model, in lines for a terminal.
pub fn choice(choice: &super::Choice) -> String {
    let mut lines = vec![format!("Chosen by {}.", choice.grouping)];
    lines.push(format!("Terms: {}.", choice.terms.join(", ")));
    lines.extend(choice.overruled.iter().map(|rule| format!("Overruled: {rule}.")));
    lines.join("\n")
}

/// The table with a heading, ending in a line feed. Efforts in `unit`.
pub fn error_table(table: &ErrorTable, unit: &str) -> String {
    let heading = [
        "model".to_owned(),
        format!("RMSE [{unit}]"),
        "% of RMS".into(),
        "R2".into(),
        "torque error [%]".into(),
        "eq. 11 [%]".into(),
    ];
    let mut lines = vec![heading];
    for row in &table.rows {
        let errors = row.errors.overall.as_ref();
        lines.push([
            row.model.clone(),
            optional(errors.map(|e| e.rmse)),
            percent(errors.and_then(|e| e.percent_of_rms)),
            errors.and_then(|e| e.r2).map_or_else(|| NONE.to_owned(), |r2| format!("{r2:.4}")),
            percent(row.torque_error),
            percent(errors.and_then(|e| e.relative_torque_error)),
        ]);
    }
    let width = |column: usize| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0);
    let widths: [usize; 6] = std::array::from_fn(width);
    let mut text = format!("test set: {}\n", table.test_set);
    for (number, line) in lines.iter().enumerate() {
        text.push_str(&format!("{:<1$}", line[0], widths[0]));
        for column in 1..line.len() {
            text.push_str(&format!("  {:>1$}", line[column], widths[column]));
        }
        text.push('\n');
        if number == 0 {
            text.push_str(&"-".repeat(widths.iter().sum::<usize>() + 2 * (widths.len() - 1)));
            text.push('\n');
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::{ErrorRow, Role};
    use super::*;
    use crate::metrics::{ByState, metrics};

    #[test]
    fn columns_are_aligned_and_missing_numbers_are_dashes() {
        let row = |model: &str, predicted: &[f64]| ErrorRow {
            model: model.into(),
            role: Role::Nothing,
            errors: ByState { overall: metrics(&[1.0, -1.0], predicted, 0.0).unwrap(), ..ByState::default() },
            torque_error: Some(12.345),
        };
        let empty =
            ErrorRow { model: "no samples".into(), role: Role::Preset, errors: ByState::default(), torque_error: None };
        let table = ErrorTable {
            test_set: "pulses".into(),
            rows: vec![row("nothing", &[0.5, -0.5]), row("physical + network", &[0.9, -1.1]), empty],
        };
        let expected = "\
test set: pulses
model               RMSE [Nm]  % of RMS      R2  torque error [%]  eq. 11 [%]
-----------------------------------------------------------------------------
nothing                0.5000      50.0  0.7500              12.3        50.0
physical + network     0.1000      10.0  0.9900              12.3        10.0
no samples                  –         –       –                 –           –
";
        assert_eq!(error_table(&table, "Nm"), expected);
    }
}
