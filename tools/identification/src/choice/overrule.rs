//! Decisions that a person makes instead of the cross-validation; host.

use crate::friction_model::Term;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Decision about a part of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Decision {
    /// The error on motions that were left out decides.
    #[default]
    Choose,
    /// Kept, unless the certificate refuses it.
    Keep,
    /// Left out.
    Never,
}

/// A term that a person forces into the full model, or forbids.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct TermRule {
    /// The term.
    pub term: Term,
    /// Forced; else forbidden.
    pub force: bool,
}

/// The text is no rule.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BadTermRule {
    /// Neither `+` nor `-` stands before the term.
    #[error("{0:?} says neither + (force) nor - (forbid) before the term")]
    Sign(String),
    /// No such term.
    #[error("no term is called {name:?}; there are {}", names().join(", "))]
    Term {
        /// The name that was given.
        name: String,
    },
    /// The term is part of every model.
    #[error("{0:?} cannot be forbidden: every model has viscous friction")]
    Needed(String),
}

fn names() -> Vec<String> {
    Term::ALL.iter().map(|term| format!("{term:?}")).collect()
}

impl FromStr for TermRule {
    type Err = BadTermRule;

    fn from_str(text: &str) -> Result<Self, BadTermRule> {
        let text = text.trim();
        let (force, name) = match (text.strip_prefix('+'), text.strip_prefix('-')) {
            (Some(name), _) => (true, name),
            (_, Some(name)) => (false, name),
            _ => return Err(BadTermRule::Sign(text.to_owned())),
        };
        let plain = |name: &str| name.replace(['-', '_', ' '], "").to_lowercase();
        let found = Term::ALL.into_iter().find(|term| plain(&format!("{term:?}")) == plain(name));
        let term = found.ok_or_else(|| BadTermRule::Term { name: name.to_owned() })?;
        match (term, force) {
            (Term::Viscous, false) => Err(BadTermRule::Needed(name.to_owned())),
            _ => Ok(Self { term, force }),
        }
    }
}

impl TryFrom<String> for TermRule {
    type Error = BadTermRule;

    fn try_from(text: String) -> Result<Self, BadTermRule> {
        text.parse()
    }
}

impl From<TermRule> for String {
    fn from(rule: TermRule) -> Self {
        rule.to_string()
    }
}

impl fmt::Display for TermRule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{:?}", if self.force { '+' } else { '-' }, self.term)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rule_names_its_term_in_any_spelling() {
        let rule: TermRule = "+Stribeck".parse().unwrap();
        assert_eq!((rule.term, rule.force), (Term::Stribeck, true));
        let rule: TermRule = "-coulomb-load".parse().unwrap();
        assert_eq!((rule.term, rule.force), (Term::CoulombLoad, false));
        assert_eq!(rule.to_string(), "-CoulombLoad");
    }

    #[test]
    fn what_is_no_rule_is_refused_with_the_reason() {
        assert!("Stribeck".parse::<TermRule>().unwrap_err().to_string().contains("neither + (force) nor - (forbid)"));
        assert!("+Stribek".parse::<TermRule>().unwrap_err().to_string().contains("CoulombLoad"));
        assert!("-Viscous".parse::<TermRule>().is_err() && "+Viscous".parse::<TermRule>().is_ok());
    }
}
