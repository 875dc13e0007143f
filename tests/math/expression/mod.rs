//! The `function` field of `/arm_sim/integration_step`, sentence by sentence of the specification and the contract.
//!
//! [`accepted`] and [`rejected`] hold the sentences, [`size`] the texts that would break a parser that recurses,
//! [`properties`] any expressions and texts.
//!
//! **Invariant:** values are compared exactly: the expected ones are whole numbers or binary fractions, or take the same
//! floating-point operations in the same order.
mod accepted;
mod properties;
mod rejected;
mod size;

use pendularm::math::expression::Expression;

/// An arbitrary time that is no special value of any function.
pub(crate) const T: f64 = 1.75;

#[track_caller]
pub(crate) fn value(text: &str) -> f64 {
    parse(text).evaluate(T)
}

#[track_caller]
pub(crate) fn parse(text: &str) -> Expression {
    match Expression::parse(text) {
        Ok(expression) => expression,
        Err(error) => panic!("{text:?}: {error}"),
    }
}

#[track_caller]
pub(crate) fn rejection(text: &str) -> String {
    match Expression::parse(text) {
        Ok(expression) => panic!("{text:?} was accepted, as {expression}"),
        Err(error) => error.to_string(),
    }
}
