//! Ranges of the values of a description; host.
//!
//! Everything that can be judged without the recordings is judged here, so that a mistake shows before a large file is
//! read.

use super::condition_keys::{Condition, Value};
use super::description::{Description, EffortUnit, Gravity, PositionUnit, Rule};
use super::error::DatasetError;
use super::treatment::{LowPass, VelocityFrom};
use std::fmt::Display;
use std::path::Path;

/// Highest filter order: beyond it the poles of a low cut-off are lost in rounding.
const MAX_ORDER: usize = 12;
/// Longest delay of an effort that can be described, s.
const LONGEST_LAG: f64 = 1.0;

/// Parses the text of a description and checks its values. `file` is only named in errors.
pub fn parse(text: &str, file: &Path) -> Result<Description, DatasetError> {
    let description: Description = toml::from_str(text).map_err(|error| DatasetError::Toml {
        file: file.to_owned(),
        message: error.to_string().trim_end().to_owned(),
    })?;
    Check { file }.description(&description)?;
    Ok(description)
}

/// Checks of a description without its recordings: whether two columns can be compared is known only when they are
/// read.
struct Check<'a> {
    file: &'a Path,
}

type Checked = Result<(), DatasetError>;

impl Check<'_> {
    fn require(&self, holds: bool, key: impl Display, value: impl Display, expected: &str) -> Checked {
        if holds {
            return Ok(());
        }
        Err(DatasetError::Description {
            file: self.file.to_owned(),
            key: key.to_string(),
            value: value.to_string(),
            expected: expected.to_owned(),
        })
    }

    fn positive(&self, key: impl Display, value: f64) -> Checked {
        self.require(value.is_finite() && value > 0.0, key, value, "a finite number greater than 0")
    }

    fn not_negative(&self, key: impl Display, value: f64) -> Checked {
        self.require(value.is_finite() && value >= 0.0, key, value, "a finite number, 0 or greater")
    }

    fn scale(&self, key: impl Display, value: f64) -> Checked {
        self.require(value.is_finite() && value != 0.0, key, value, "a finite factor other than 0")
    }

    fn description(&self, d: &Description) -> Checked {
        self.require(
            d.reference_temperature.is_finite(),
            "reference_temperature",
            d.reference_temperature,
            "degrees Celsius",
        )?;
        self.require(!d.source.files.is_empty(), "source.files", "[]", "at least one file")?;
        self.require(d.source.delimiter.is_ascii(), "source.delimiter", d.source.delimiter, "an ASCII character")?;
        let decimal = d.source.decimal;
        let apart = matches!(decimal, '.' | ',') && decimal != d.source.delimiter;
        self.require(apart, "source.decimal", decimal, "\".\" or \",\", and not the delimiter")?;
        self.columns(d)?;
        self.select(d)?;
        self.clean(d)?;
        self.filter(d)?;
        if let Some(threshold) = d.classify.acceleration {
            self.not_negative("classify.acceleration", threshold)?;
        }
        if let Some(threshold) = d.classify.speed {
            self.not_negative("classify.speed", threshold)?;
        }
        self.rigid(d)?;
        self.split(d)
    }

    fn columns(&self, d: &Description) -> Checked {
        let columns = &d.columns;
        self.require(
            columns.time.scale.is_finite() && columns.time.scale > 0.0,
            "columns.time.scale",
            columns.time.scale,
            "a finite factor greater than 0",
        )?;
        self.scale("columns.position.scale", columns.position.scale)?;
        if let Some(wrap) = columns.position.wrap {
            self.positive("columns.position.wrap", wrap)?;
        }
        if let Some(velocity) = &columns.velocity {
            self.scale("columns.velocity.scale", velocity.scale)?;
        }
        if let Some(temperature) = &columns.temperature {
            self.scale("columns.temperature.scale", temperature.scale)?;
        }
        let effort = &columns.effort;
        self.scale("columns.effort.scale", effort.scale)?;
        let factors = effort.factors();
        self.require(
            effort.column.is_some() != effort.product.is_some() && !factors.is_empty(),
            "columns.effort",
            format!("{factors:?}"),
            "either column = \"...\" or product = [\"...\", \"...\"]",
        )?;
        let from_column = d.differentiate.velocity_from == Some(VelocityFrom::Column);
        self.require(
            !(from_column && columns.velocity.is_none()),
            "differentiate.velocity_from",
            "column",
            "\"position\", because columns.velocity is not given",
        )
    }

    fn condition(&self, key: &str, condition: &Condition) -> Checked {
        let c = condition;
        let tests = [c.equals.is_some(), c.one_of.is_some(), c.not_in.is_some(), c.starts_with.is_some()];
        let tests = tests.into_iter().chain([c.inside.is_some(), c.outside.is_some()]).any(|given| given);
        self.require(tests, key, &c.column, "one of equals, in, not_in, starts_with, inside, outside")?;
        for list in c.one_of.iter().chain(&c.not_in) {
            let numbers = list.iter().filter(|value| matches!(value, Value::Number(_))).count();
            let alike = numbers == 0 || numbers == list.len();
            self.require(alike, key, format!("{list:?}"), "a list of numbers or a list of texts")?;
        }
        for [low, high] in c.inside.iter().chain(&c.outside) {
            self.require(low <= high, key, format!("[{low}, {high}]"), "the lower limit before the upper one")?;
        }
        Ok(())
    }

    fn select(&self, d: &Description) -> Checked {
        let select = &d.select;
        select.keep.iter().try_for_each(|c| self.condition("select.keep", c))?;
        select.used.iter().try_for_each(|c| self.condition("select.use", c))?;
        if let Some([first, last]) = select.time {
            self.require(first < last, "select.time", format!("[{first}, {last}]"), "the first time before the last")?;
        }
        self.not_negative("select.trim_start", select.trim_start)?;
        self.not_negative("select.trim_end", select.trim_end)?;
        self.not_negative("select.minimum_speed", select.minimum_speed)
    }

    fn clean(&self, d: &Description) -> Checked {
        let clean = &d.clean;
        clean.dropout.iter().try_for_each(|c| self.condition("clean.dropout", c))?;
        clean.jump.iter().try_for_each(|j| self.positive(format!("clean.jump {:?}", j.column), j.limit))?;
        clean.steady.iter().try_for_each(|s| self.positive(format!("clean.steady {:?}", s.column), s.limit))?;
        clean.frozen.iter().try_for_each(|f| self.positive(format!("clean.frozen {:?}", f.column), f.step))?;
        clean.saturation.iter().try_for_each(|s| self.positive(format!("clean.saturation {:?}", s.column), s.limit))?;
        if let Some(gap) = clean.max_gap {
            self.positive("clean.max_gap", gap)?;
        }
        if let Some(period) = clean.sample_period {
            self.positive("clean.sample_period", period)?;
        }
        self.require(
            clean.minimum_run >= 3,
            "clean.minimum_run",
            clean.minimum_run,
            "3 or more, for a central difference",
        )
    }

    fn filter(&self, d: &Description) -> Checked {
        let filter = &d.filter;
        let signals = [
            ("filter.position", &filter.position),
            ("filter.velocity", &filter.velocity),
            ("filter.acceleration", &filter.acceleration),
            ("filter.effort", &filter.effort),
            ("filter.temperature", &filter.temperature),
        ];
        for (key, low_pass) in signals {
            if let Some(low_pass) = low_pass {
                self.low_pass(key, low_pass)?;
            }
        }
        self.require(
            filter.temperature.is_none() || d.columns.temperature.is_some(),
            "filter.temperature",
            "given",
            "columns.temperature to be given too",
        )?;
        let limit = filter.lag_limit;
        self.require((0.0..=LONGEST_LAG).contains(&limit), "filter.lag_limit", limit, "0 to 1 s")?;
        if let Some(lag) = filter.effort_lag {
            let expected = format!("a time within +-{limit} s; filter.lag_limit widens it, to {LONGEST_LAG} s at most");
            self.require(lag.abs() <= limit, "filter.effort_lag", lag, &expected)?;
        }
        let expected = "1 to 2000 Hz";
        self.require((1.0..=2000.0).contains(&filter.observer_hz), "filter.observer_hz", filter.observer_hz, expected)?;
        match &filter.decimate {
            Some(decimate) => {
                let factor = decimate.factor;
                self.require((1..=1000).contains(&factor), "filter.decimate.factor", factor, "1 to 1000")
            }
            None => Ok(()),
        }
    }

    fn low_pass(&self, key: &str, low_pass: &LowPass) -> Checked {
        let order = low_pass.order;
        self.require((1..=MAX_ORDER).contains(&order), format!("{key}.order"), order, &format!("1 to {MAX_ORDER}"))?;
        match (low_pass.cutoff_hz, low_pass.cutoff_nyquist) {
            (Some(hertz), None) => self.positive(format!("{key}.cutoff_hz"), hertz),
            (None, Some(fraction)) => self.require(
                fraction > 0.0 && fraction < 1.0,
                format!("{key}.cutoff_nyquist"),
                fraction,
                "a fraction of the Nyquist frequency, more than 0 and less than 1",
            ),
            _ => self.require(false, key, "no single cut-off", "either cutoff_hz or cutoff_nyquist"),
        }
    }

    fn rigid(&self, d: &Description) -> Checked {
        let rigid = &d.rigid;
        let volts = d.columns.effort.unit == EffortUnit::Volt;
        self.require(!rigid.back_emf || volts, "rigid.back_emf", true, "columns.effort.unit = \"V\"")?;
        let known = ["mass", "length"].iter().all(|name| d.columns.extra.contains_key(*name));
        self.require(
            !rigid.mass_and_length || known,
            "rigid.mass_and_length",
            true,
            "columns.extra to name the columns of mass and length",
        )?;
        let linear = d.columns.position.unit == PositionUnit::Metre;
        self.require(
            !linear || rigid.gravity == Gravity::None,
            "rigid.gravity",
            format!("{:?}", rigid.gravity),
            "\"none\" for a prismatic joint (its weight is a constant: rigid.offset)",
        )
    }

    fn split(&self, d: &Description) -> Checked {
        let mut names: Vec<&str> = Vec::new();
        for rule in &d.split.test {
            let name = rule.name.as_deref().unwrap_or("");
            self.require(!name.is_empty(), "split.test.name", format!("{name:?}"), "a name")?;
            self.require(!names.contains(&name), "split.test.name", format!("{name:?}"), "a name that is used once")?;
            names.push(name);
            self.rule(&format!("split.test {name:?}"), rule, d)?;
        }
        match &d.split.validation {
            Some(rule) => {
                self.require(rule.name.is_none(), "split.validation.name", "given", "no name")?;
                self.rule("split.validation", rule, d)
            }
            None => Ok(()),
        }
    }

    fn rule(&self, key: &str, rule: &Rule, d: &Description) -> Checked {
        let given = [rule.files.is_some(), rule.runs.is_some(), rule.blocks.is_some(), rule.fraction.is_some()];
        let given = given.into_iter().any(|given| given) || !rule.conditions.is_empty();
        self.require(given, key, "empty", "one of files, runs, where, blocks, fraction")?;
        rule.conditions.iter().try_for_each(|c| self.condition(&format!("{key}.where"), c))?;
        rule.unless.iter().try_for_each(|c| self.condition(&format!("{key}.unless"), c))?;
        for file in rule.files.iter().flatten() {
            self.require(d.source.files.contains(file), format!("{key}.files"), file, "a file of source.files")?;
        }
        if let Some(blocks) = &rule.blocks {
            self.positive(format!("{key}.blocks.length"), blocks.length)?;
            self.require(blocks.modulo > 0, format!("{key}.blocks.modulo"), blocks.modulo, "1 or more")?;
            for &index in &blocks.index {
                self.require(index < blocks.modulo, format!("{key}.blocks.index"), index, "less than blocks.modulo")?;
            }
        }
        if let Some(fraction) = &rule.fraction {
            let of = fraction.of;
            self.require(of > 0.0 && of < 1.0, format!("{key}.fraction.of"), of, "more than 0 and less than 1")?;
            if let Some(length) = fraction.length {
                self.positive(format!("{key}.fraction.length"), length)?;
            }
        }
        Ok(())
    }
}
