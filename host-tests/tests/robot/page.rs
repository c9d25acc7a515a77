//! docs/robot.md: its text, the published figures and their margin.

use libtest_mimic::Failed;

/// The page.
pub const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/robot.md");
/// Largest departure from a published figure, as a fraction of it.
const MARGIN: f64 = 0.02;

/// One model after one training.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Seconds of training.
    pub training: String,
    /// The model.
    pub model: String,
    /// RMS error of each joint, A.
    pub errors: Vec<f64>,
    /// Mean over the joints of the error in % of the effort's RMS.
    pub mean: f64,
}

/// The table of the rows.
pub fn table(rows: &[Row]) -> String {
    let mut text =
        "| training | model | 1 | 2 | 3 | 4 | 5 | 6 | mean relative error |\n|---|---|---|---|---|---|---|---|---|\n"
            .to_owned();
    for Row { training, model, errors, mean } in rows {
        let errors: Vec<String> = errors.iter().map(|error| format!("{error:.4}")).collect();
        text += &format!("| {training} | {model} | {} | {mean:.2} % |\n", errors.join(" | "));
    }
    text
}

/// The whole page.
pub fn document(rows: &[Row]) -> String {
    include_str!("robot.md.in").replace("@TABLE@", &table(rows)).replace("@MARGIN@", &format!("{}", 100.0 * MARGIN))
}

/// The rows of a page.
///
/// # Errors
/// A line that is no row.
pub fn read(text: &str) -> Result<Vec<Row>, Failed> {
    let table = text.lines().skip_while(|line| !line.starts_with("| training |")).skip(2);
    let row = |line: &str| {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let [training, model, errors @ .., mean] = &cells[..] else {
            return Err(Failed::from(format!("docs/robot.md: {line}")));
        };
        let number =
            |text: &str| text.trim_end_matches(" %").parse::<f64>().map_err(|e| format!("docs/robot.md: {text}: {e}"));
        let errors = errors.iter().map(|text| number(text)).collect::<Result<_, _>>()?;
        Ok(Row { training: (*training).to_owned(), model: (*model).to_owned(), errors, mean: number(mean)? })
    };
    table.take_while(|line| line.starts_with('|')).map(row).collect()
}

/// Differences of the rows from the published ones, in words.
pub fn differences(rows: &[Row], published: &[Row]) -> Vec<String> {
    let mut found = Vec::new();
    if rows.len() != published.len() {
        found.push(format!("{} rows, published {}", rows.len(), published.len()));
    }
    for (row, page) in rows.iter().zip(published) {
        let all = |row: &Row| [&row.errors[..], &[row.mean]].concat();
        let same = (&row.training, &row.model, row.errors.len()) == (&page.training, &page.model, page.errors.len());
        let within = |(is, was): (&f64, &f64)| (is - was).abs() <= MARGIN * was;
        if !same || !all(row).iter().zip(&all(page)).all(within) {
            found.push(format!("{row:?}, published {page:?}"));
        }
    }
    found
}

/// The page's text and its figures are of one writing.
///
/// # Errors
/// They are not.
pub fn is_whole() -> Result<(), Failed> {
    let text = std::fs::read_to_string(PATH)?;
    let rows = read(&text)?;
    match !rows.is_empty() && document(&rows) == text {
        true => Ok(()),
        false => Err("docs/robot.md says something else than its figures; UPDATE_DOCS=1 writes it anew".into()),
    }
}

/// The margin's own rule.
///
/// # Errors
/// It does not hold.
pub fn margins() -> Result<(), Failed> {
    let row = |error: f64| vec![Row { training: "8 s".into(), model: "m".into(), errors: vec![error], mean: 10.0 }];
    let published = read(&document(&row(0.1)))?;
    let told = |error: f64| !differences(&row(error), &published).is_empty();
    match [0.1, 0.1019, 0.0981, 0.1021, 0.0979, f64::NAN].map(told) {
        [false, false, false, true, true, true] => Ok(()),
        other => Err(format!("{other:?}").into()),
    }
}
