//! The arm of the specification, by its own derivation: a chain of uniform rods, written in absolute angles.
//!
//! With `phi_i = q_1 + ... + q_i` the Lagrangian gives, for every link `i`,
//! `sum_j A_ij (cos(phi_i - phi_j) phi_j'' + sin(phi_i - phi_j) phi_j'^2) + b_i cos(phi_i) = tau_i - tau_(i+1)`.

#![allow(clippy::indexing_slicing, reason = "every list of an arm has an entry for each link")]

/// Masses, lengths and gravity.
#[derive(Debug, Clone, PartialEq)]
pub struct Arm {
    /// Mass of each link [kg].
    pub masses: Vec<f64>,
    /// Length of each link [m].
    pub lengths: Vec<f64>,
    /// Gravity along -y [m/s^2].
    pub gravity: f64,
}

/// Angles and their rates.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Relative joint angles [rad].
    pub position: Vec<f64>,
    /// Their rates [rad/s].
    pub velocity: Vec<f64>,
}

/// Running sums: relative to absolute.
#[must_use]
pub fn absolute(relative: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let add = |value: &f64| {
        sum += value;
        sum
    };
    relative.iter().map(add).collect()
}

impl Arm {
    /// `n` links of 1 m and 1 kg.
    #[must_use]
    pub fn of(links: usize, gravity: f64) -> Self {
        Self { masses: vec![1.0; links], lengths: vec![1.0; links], gravity }
    }

    /// A part of the mass of link `i`, and all beyond it.
    fn carried(&self, i: usize, part: f64) -> f64 {
        part * self.masses[i] + self.masses[i + 1..].iter().sum::<f64>()
    }

    /// `A_ij`.
    fn inertia(&self, i: usize, j: usize) -> f64 {
        let part = if i == j { 1.0 / 3.0 } else { 0.5 };
        self.lengths[i] * self.lengths[j] * self.carried(i.max(j), part)
    }

    /// `b_i`.
    fn weight(&self, i: usize) -> f64 {
        self.gravity * self.lengths[i] * self.carried(i, 0.5)
    }

    /// The tip: `x`, `y` and its heading.
    #[must_use]
    pub fn end_effector(&self, position: &[f64]) -> (f64, f64, f64) {
        let headings = absolute(position);
        let x = self.lengths.iter().zip(&headings).map(|(length, heading)| length * heading.cos()).sum();
        let y = self.lengths.iter().zip(&headings).map(|(length, heading)| length * heading.sin()).sum();
        (x, y, headings.last().copied().unwrap_or(f64::NAN))
    }

    /// `G(q)`: each joint carries the weight of its own link and of all beyond it.
    #[must_use]
    pub fn gravity_load(&self, position: &[f64]) -> Vec<f64> {
        let headings = absolute(position);
        let weights: Vec<f64> = headings.iter().enumerate().map(|(i, heading)| self.weight(i) * heading.cos()).collect();
        (0..weights.len()).map(|i| weights[i..].iter().sum()).collect()
    }

    /// Kinetic energy [J].
    #[must_use]
    pub fn kinetic(&self, state: &State) -> f64 {
        let rates = absolute(&state.velocity);
        rates.iter().zip(self.momenta(state)).map(|(rate, momentum)| 0.5 * rate * momentum).sum()
    }

    /// Potential energy, zero at `y = 0` [J].
    #[must_use]
    pub fn potential(&self, position: &[f64]) -> f64 {
        absolute(position).iter().enumerate().map(|(i, heading)| self.weight(i) * heading.sin()).sum()
    }

    /// Angular momentum about the base [kg m^2/s].
    #[must_use]
    pub fn momentum(&self, state: &State) -> f64 {
        self.momenta(state).iter().sum()
    }

    /// Those of the links' rates.
    fn momenta(&self, state: &State) -> Vec<f64> {
        let (headings, rates) = (absolute(&state.position), absolute(&state.velocity));
        let count = headings.len();
        let term = |i: usize, j: usize| self.inertia(i, j) * (headings[i] - headings[j]).cos() * rates[j];
        (0..count).map(|i| (0..count).map(|j| term(i, j)).sum()).collect()
    }

    /// Joint accelerations without effort.
    #[must_use]
    pub fn free_acceleration(&self, position: &[f64], velocity: &[f64]) -> Vec<f64> {
        let (headings, rates) = (absolute(position), absolute(velocity));
        let count = headings.len();
        let row = |i: usize| {
            let turning = |j: usize| self.inertia(i, j) * (headings[i] - headings[j]).sin() * rates[j] * rates[j];
            let right = -(0..count).map(turning).sum::<f64>() - self.weight(i) * headings[i].cos();
            (0..count).map(|j| self.inertia(i, j) * (headings[i] - headings[j]).cos()).chain([right]).collect()
        };
        let mut relative = solved((0..count).map(row).collect());
        for i in (1..count).rev() {
            relative[i] -= relative[i - 1];
        }
        relative
    }
}

/// Gauss elimination of rows whose last entry is the right side; the matrix is positive definite, so no row is exchanged.
pub(crate) fn solved(mut rows: Vec<Vec<f64>>) -> Vec<f64> {
    let count = rows.len();
    for pivot in 0..count {
        let above = rows[pivot].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(at, _)| *at != pivot) {
            let factor = row[pivot] / above[pivot];
            for (entry, over) in row.iter_mut().zip(&above) {
                *entry -= factor * over;
            }
        }
    }
    rows.iter().enumerate().map(|(at, row)| row[count] / row[at]).collect()
}
