//! Small matrices: eigenvalues and solutions that are known.

use pendularm::study::matrix::Matrix;

/// One or zero.
fn unit(is_one: bool) -> f64 {
    f64::from(u8::from(is_one))
}

/// Sums of the eigenvalues and of their squares are traces of the matrix and of its square, for every scale of its
/// states. The tolerance is some hundred units of rounding of sums of 81 products.
#[test]
fn eigenvalues_of_random_matrices_have_the_traces() {
    let mut rng = fastrand::Rng::with_seed(3);
    for case in 0..5000 {
        let n = 1 + case % 9;
        let scales: Vec<f64> = (0..n).map(|_| 10_f64.powi(rng.i32(-6..=6))).collect();
        let even = Matrix::from_fn(n, |_, _| 2.0 * rng.f64() - 1.0);
        let square = even.product(&even);
        let values = Matrix::from_fn(n, |i, j| even[(i, j)] * scales[i] / scales[j]).eigenvalues();
        let trace = |matrix: &Matrix| (0..n).map(|i| matrix[(i, i)]).sum::<f64>();
        let sum: f64 = values.iter().map(|value| value.re).sum();
        let squares: f64 = values.iter().map(|it| it.re * it.re - it.im * it.im).sum();
        assert!((sum - trace(&even)).abs() < 1e-12, "{case}: {values:?}");
        let off = (squares - trace(&square)).abs();
        assert!(off < 1e-12, "{case}: {values:?}");
        let crossed: f64 = values.iter().map(|value| value.im).sum();
        assert_eq!(crossed, 0.0, "{case}: {values:?}");
    }
}

/// Without exceptional shifts the iteration never converges on a cyclic permutation.
#[test]
fn a_cycle_has_the_roots_of_one_for_eigenvalues() {
    for n in 3..10 {
        let cycle = Matrix::from_fn(n, |row, column| unit(row == (column + 1) % n));
        for value in cycle.eigenvalues() {
            assert!((value.modulus() - 1.0).abs() < 1e-13, "{n}: {value:?}");
        }
    }
}

#[test]
fn a_nilpotent_matrix_has_zeros_for_eigenvalues_and_one_that_is_not_finite_nan() {
    let matrix = Matrix::from_fn(6, |row, column| unit(column == row + 3));
    assert_eq!(matrix.spectral_radius(), 0.0);
    let matrix = Matrix::from_fn(3, |row, _| if row == 1 { f64::NAN } else { 1.0 });
    assert!(matrix.spectral_radius().is_nan());
}

/// A drift beside a decaying mode: rounding would spread the double eigenvalue to the square root of its size.
#[test]
fn an_eigenvalue_of_a_state_on_which_no_other_depends_is_exact() {
    for double in [0.0, 1.0] {
        let matrix = Matrix::from_fn(3, |row, column| {
            [[double, 1.0, 0.3], [0.0, double, 0.7], [0.0, 0.0, -0.9]][row][column]
        });
        // The same with its states in another order.
        for order in [[0, 1, 2], [2, 0, 1], [1, 2, 0]] {
            let mixed = Matrix::from_fn(3, |row, column| matrix[(order[row], order[column])]);
            let mut values: Vec<f64> = mixed.eigenvalues().iter().map(|value| value.re).collect();
            values.sort_unstable_by(f64::total_cmp);
            assert_eq!(values, [-0.9, double, double]);
        }
    }
}

#[test]
fn a_solution_satisfies_its_equations() {
    let matrix = Matrix::from_fn(3, |row, column| {
        [[0.0, 2.0, 1.0], [1.0, -1.0, 3.0], [4.0, 0.5, -2.0]][row][column]
    });
    // The solution is (1, -2, 3), exact in a few units of rounding.
    let x = matrix.solve(&[-1.0, 12.0, -3.0]).unwrap();
    for (x, expected) in x.iter().zip([1.0, -2.0, 3.0]) {
        assert!((x - expected).abs() < 1e-14);
    }
    assert!(Matrix::zeros(2).solve(&[1.0, 1.0]).is_none());
    let product = matrix.product(&matrix.inverse().unwrap());
    let off = Matrix::from_fn(3, |i, j| product[(i, j)] - unit(i == j));
    assert!((0..9).all(|at| off[(at / 3, at % 3)].abs() < 1e-15));
    assert!(Matrix::zeros(2).inverse().is_none());
}
