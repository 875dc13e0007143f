//! What the steps of an encoder do to a measured velocity, and to the derivative gain.
//!
//! A velocity that is the difference of two counts, `T` apart, is off by a whole number of steps and the fraction `f` of a
//! step that the joint turned: by `(1 - f) s/T` with probability `f`, and by `-f s/T` else. The standard deviation at one
//! speed is `√(f (1 - f)) s/T`, at most `s/(2T)`. Over all speeds it is `s/(√6 T)`. The control law multiplies it by kd.
//!
//! Source: Belanger, *Estimation of angular velocity and acceleration from shaft encoder measurements* (1992).
//!
//! **Invariant:** pure formulas; `period` is greater than 0 and `step` is not negative.

/// Standard deviation of a velocity that is a difference of counts, over all speeds \[rad/s\]. `step` is the encoder's
/// \[rad\], `period` the control period \[s\].
#[must_use]
pub fn velocity_noise(step: f64, period: f64) -> f64 {
    step / (6.0_f64.sqrt() * period)
}

/// The largest derivative gain \[N m s/rad\] with which the encoder's noise is an effort of at most this standard
/// deviation \[N m\]; infinite without steps.
#[must_use]
pub fn largest_kd(step: f64, period: f64, effort: f64) -> f64 {
    effort / velocity_noise(step, period)
}
