//! Data checks: defects of a recording that a fit would swallow without a word; host.
//!
//! - [`columns`]: the raw signals, before any filter: units, wrapping, stuck values, clipping, sampling
//! - [`model`]: the training samples beside the simplest model: sign, excitation, drift, inertia between runs
//! - [`slope`]: the Coulomb step of an identified model beside the speeds that were recorded
//!
//! Each finding names column, rows, number and remedy. Where nothing sensible can follow it is an error.

pub mod columns;
pub mod model;
pub mod slope;
