//! Tests of the fit: the Jacobian.

use super::*;
