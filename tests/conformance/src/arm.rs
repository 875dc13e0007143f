//! The arm of the specification, by its own derivation: a chain of uniform rods, written in absolute angles.
//!
//! With `phi_i = q_1 + ... + q_i` the Lagrangian gives, for every link `i`,
//! `sum_j A_ij (cos(phi_i - phi_j) phi_j'' + sin(phi_i - phi_j) phi_j'^2) + b_i cos(phi_i) = tau_i - tau_(i+1)`.

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
    relative
        .iter()
        .scan(0.0, |sum, value| {
            *sum += value;
            Some(*sum)
        })
        .collect()
}

impl Arm {
    /// `n` links of 1 m and 1 kg.
    #[must_use]
    pub fn of(links: usize, gravity: f64) -> Self {
        Self { masses: vec![1.0; links], lengths: vec![1.0; links], gravity }
    }

    /// The mass beyond link `i`.
    fn beyond(&self, i: usize) -> f64 {
        self.masses.iter().skip(i + 1).sum()
    }

    /// `A_ij`.
    fn inertia(&self, i: usize, j: usize) -> f64 {
        let (near, far) = (i.min(j), i.max(j));
        let own = if near == far { 1.0 / 3.0 } else { 0.5 };
        self.at(&self.lengths, near) * self.at(&self.lengths, far) * (own * self.at(&self.masses, far) + self.beyond(far))
    }

    /// `b_i`.
    fn weight(&self, i: usize) -> f64 {
        self.gravity * self.at(&self.lengths, i) * (0.5 * self.at(&self.masses, i) + self.beyond(i))
    }

    #[allow(clippy::unused_self, reason = "one spelling for all of the arm's rows")]
    fn at(&self, values: &[f64], i: usize) -> f64 {
        values.get(i).copied().unwrap_or(f64::NAN)
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
        let mut load: Vec<f64> = headings.iter().enumerate().map(|(i, heading)| self.weight(i) * heading.cos()).collect();
        let mut sum = 0.0;
        for entry in load.iter_mut().rev() {
            sum += *entry;
            *entry = sum;
        }
        load
    }

    /// Kinetic energy [J].
    #[must_use]
    pub fn kinetic(&self, state: &State) -> f64 {
        let (headings, rates) = (absolute(&state.position), absolute(&state.velocity));
        let pairs = headings.iter().zip(&rates).enumerate();
        let row = |(i, (heading, rate)): (usize, (&f64, &f64))| 0.5 * rate * self.momentum_of(i, *heading, &headings, &rates);
        pairs.map(row).sum()
    }

    /// Potential energy, zero at `y = 0` [J].
    #[must_use]
    pub fn potential(&self, position: &[f64]) -> f64 {
        absolute(position).iter().enumerate().map(|(i, heading)| self.weight(i) * heading.sin()).sum()
    }

    /// Angular momentum about the base [kg m^2/s].
    #[must_use]
    pub fn momentum(&self, state: &State) -> f64 {
        let (headings, rates) = (absolute(&state.position), absolute(&state.velocity));
        headings.iter().enumerate().map(|(i, heading)| self.momentum_of(i, *heading, &headings, &rates)).sum()
    }

    fn momentum_of(&self, i: usize, heading: f64, headings: &[f64], rates: &[f64]) -> f64 {
        let terms = headings.iter().zip(rates).enumerate();
        terms.map(|(j, (other, rate))| self.inertia(i, j) * (heading - other).cos() * rate).sum()
    }

    /// Joint accelerations without effort.
    #[must_use]
    pub fn free_acceleration(&self, position: &[f64], velocity: &[f64]) -> Vec<f64> {
        let (headings, rates) = (absolute(position), absolute(velocity));
        let mut rows = Vec::new();
        for (i, heading) in headings.iter().enumerate() {
            let mut row: Vec<f64> = headings.iter().enumerate().map(|(j, other)| self.inertia(i, j) * (heading - other).cos()).collect();
            let turning: f64 = headings
                .iter()
                .zip(&rates)
                .enumerate()
                .map(|(j, (other, rate))| self.inertia(i, j) * (heading - other).sin() * rate * rate)
                .sum();
            row.push(-turning - self.weight(i) * heading.cos());
            rows.push(row);
        }
        let mut before = 0.0;
        solved(rows)
            .into_iter()
            .map(|acceleration| {
                let relative = acceleration - before;
                before = acceleration;
                relative
            })
            .collect()
    }
}

/// Gauss elimination of rows whose last entry is the right side; the matrix is positive definite, so no row is exchanged.
fn solved(mut rows: Vec<Vec<f64>>) -> Vec<f64> {
    let count = rows.len();
    for pivot in 0..count {
        let Some(above) = rows.get(pivot).cloned() else {
            continue;
        };
        for row in rows.iter_mut().skip(pivot + 1) {
            let factor = row.get(pivot).zip(above.get(pivot)).map_or(f64::NAN, |(below, above)| below / above);
            for (entry, over) in row.iter_mut().zip(&above) {
                *entry -= factor * over;
            }
        }
    }
    let mut solution = vec![0.0; count];
    for at in (0..count).rev() {
        let Some(row) = rows.get(at) else { continue };
        let known: f64 = row.iter().take(count).zip(&solution).skip(at + 1).map(|(entry, value)| entry * value).sum();
        let value = row.last().zip(row.get(at)).map_or(f64::NAN, |(right, pivot)| (right - known) / pivot);
        if let Some(entry) = solution.get_mut(at) {
            *entry = value;
        }
    }
    solution
}
