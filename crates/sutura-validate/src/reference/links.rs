//! Chains of n rigid links of length 1/n: what an inextensible rod of n elements is once it is discretized. Joints
//! between links have the stiffness n EI / L, a clamped end 2 n EI / L (half an element); mass is at the particles,
//! half as much at free ends.

use super::numeric::{integrate, newton};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::FRAC_PI_2;

/// Mass at particles 1 to n over the whole; the last is a free end.
fn masses(n: usize) -> Vec<f64> {
    (1..=n).map(|i| if i == n { 0.5 / n as f64 } else { 1.0 / n as f64 }).collect()
}

/// Sum of what follows, itself included.
fn beyond(values: &[f64]) -> Vec<f64> {
    let mut sums = values.to_vec();
    for i in (0..sums.len().saturating_sub(1)).rev() {
        sums[i] += sums[i + 1];
    }
    sums
}

/// Tip of a cantilever under a tip load k and its own weight g: distance along, drop, slope of the last link \[rad\].
pub fn cantilever(n: usize, k: f64, g: f64) -> [f64; 3] {
    let (l, stiffness) = (1.0 / n as f64, n as f64);
    let weight = beyond(&masses(n));
    let mut slope = DVector::<f64>::zeros(n);
    const STEPS: i32 = 40;
    for step in 1..=STEPS {
        let part = f64::from(step) / f64::from(STEPS);
        for _ in 0..50 {
            let joint = |i: usize| if i == 0 { 2.0 * stiffness } else { stiffness };
            let mut residual = DVector::<f64>::zeros(n);
            let mut jacobian = DMatrix::<f64>::zeros(n, n);
            for i in 0..n {
                let load = part * (k + g * weight[i]);
                let before = if i == 0 { 0.0 } else { slope[i - 1] };
                residual[i] = joint(i) * (slope[i] - before) - load * l * slope[i].cos();
                jacobian[(i, i)] += joint(i) + load * l * slope[i].sin();
                if i > 0 {
                    jacobian[(i, i - 1)] -= joint(i);
                }
                if i + 1 < n {
                    residual[i] -= joint(i + 1) * (slope[i + 1] - slope[i]);
                    jacobian[(i, i)] += joint(i + 1);
                    jacobian[(i, i + 1)] -= joint(i + 1);
                }
            }
            let Some(change) = jacobian.lu().solve(&(-residual)) else { return [f64::NAN; 3] };
            slope += &change;
            if change.amax() < 1e-13 {
                break;
            }
        }
    }
    [slope.iter().map(|a| l * a.cos()).sum(), slope.iter().map(|a| l * a.sin()).sum(), slope[n - 1]]
}

/// How an end of a column is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// Not at all.
    Free,
    /// It may turn, and move along the column.
    Pinned,
    /// It may move along the column.
    Clamped,
}

/// Bending of the links for small deflections of particles 1, 2, .. (the start is clamped or pinned on the axis): joint
/// angles by deflection, and stiffness of each joint.
fn joints(n: usize, start: End, end: End) -> (DMatrix<f64>, DVector<f64>) {
    let free = if end == End::Free { n } else { n - 1 };
    let per = n as f64;
    let mut rows: Vec<(DVector<f64>, f64)> = Vec::new();
    let row = |terms: &[(usize, f64)], stiffness: f64| {
        let mut r = DVector::zeros(free);
        for (particle, factor) in terms {
            if (1..=free).contains(particle) {
                r[particle - 1] += factor * per;
            }
        }
        (r, stiffness)
    };
    if start == End::Clamped {
        rows.push(row(&[(1, 1.0)], 2.0 * per));
    }
    for i in 1..n {
        rows.push(row(&[(i - 1, 1.0), (i, -2.0), (i + 1, 1.0)], per));
    }
    if end == End::Clamped {
        rows.push(row(&[(n - 1, 1.0)], 2.0 * per));
    }
    let mut angles = DMatrix::zeros(rows.len(), free);
    let mut stiffness = DVector::zeros(rows.len());
    for (i, (r, k)) in rows.into_iter().enumerate() {
        angles.set_row(i, &r.transpose());
        stiffness[i] = k;
    }
    (angles, stiffness)
}

fn bending(n: usize, start: End, end: End) -> DMatrix<f64> {
    let (angles, stiffness) = joints(n, start, end);
    angles.transpose() * DMatrix::from_diagonal(&stiffness) * angles
}

/// Stiffness taken away by compression `force[i]` in link i.
fn compression(n: usize, end: End, force: &[f64]) -> DMatrix<f64> {
    let free = if end == End::Free { n } else { n - 1 };
    let mut k = DMatrix::zeros(free, free);
    for (i, f) in force.iter().enumerate() {
        let f = f * n as f64;
        // Link i joins particles i and i + 1; deflection j is that of particle j + 1.
        let (a, b) = (i.checked_sub(1), (i < free).then_some(i));
        for p in [a, b].into_iter().flatten() {
            k[(p, p)] += f;
        }
        if let (Some(a), Some(b)) = (a, b) {
            k[(a, b)] -= f;
            k[(b, a)] -= f;
        }
    }
    k
}

/// Least p with det(bending - p compression) = 0.
fn least_load(bending: DMatrix<f64>, compression: &DMatrix<f64>) -> f64 {
    let Some(factor) = bending.cholesky() else { return f64::NAN };
    let l = factor.l();
    let Some(left) = l.solve_lower_triangular(compression) else { return f64::NAN };
    let Some(both) = l.solve_lower_triangular(&left.transpose()) else { return f64::NAN };
    1.0 / both.symmetric_eigenvalues().max()
}

/// Euler's load of a column of n links.
pub fn critical_load(n: usize, start: End, end: End) -> f64 {
    least_load(bending(n, start, end), &compression(n, end, &vec![1.0; n]))
}

/// Greatest weight w L^3 / EI of a column of n links that is clamped at its foot.
pub fn heavy_column(n: usize) -> f64 {
    least_load(bending(n, End::Clamped, End::Free), &compression(n, End::Free, &beyond(&masses(n))))
}

/// Eigenvalues and mode shapes of K u = w^2 M u with a diagonal M, in order.
fn modes(stiffness: &DMatrix<f64>, mass: &[f64]) -> Vec<(f64, DVector<f64>)> {
    let root = DVector::from_iterator(mass.len(), mass.iter().map(|m| 1.0 / m.sqrt()));
    let scaled = DMatrix::from_diagonal(&root) * stiffness * DMatrix::from_diagonal(&root);
    let eigen = scaled.symmetric_eigen();
    let mut all: Vec<(f64, DVector<f64>)> =
        (0..mass.len()).map(|i| (eigen.eigenvalues[i], eigen.eigenvectors.column(i).component_mul(&root))).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter().map(|(w2, shape)| (w2.max(0.0).sqrt(), shape)).collect()
}

/// Small swings of a hanging chain: angular frequencies in sqrt(g / L), deflections of particles 1 to n.
pub fn chain_modes(n: usize) -> Vec<(f64, DVector<f64>)> {
    let mass = masses(n);
    modes(&compression(n, End::Free, &beyond(&mass)), &mass)
}

/// Vibrations of a cantilever: angular frequencies in sqrt(EI / (mass L^3)) with the mass of the whole rod, deflections
/// of particles 1 to n.
pub fn cantilever_modes(n: usize) -> Vec<(f64, DVector<f64>)> {
    modes(&bending(n, End::Clamped, End::Free), &masses(n))
}

/// A chain of n links between two ends `span` apart, the far end `rise` higher: horizontal force, forces in the first
/// and last link over the weight, and the height of each particle.
pub fn catenary(n: usize, span: f64, rise: f64) -> (f64, [f64; 2], Vec<f64>) {
    let count = n as f64;
    // Vertical over horizontal force in link i; interior particles carry a link's weight each.
    let slope = |x: &[f64], i: usize| ((i as f64 - 0.5 * (count - 1.0) + x[1]) / (count * x[0])).atan();
    let [_, force, _] = super::catenary::level(span);
    let x = newton(&[force, 0.0], |x| {
        let sum = |f: fn(f64) -> f64| (0..n).map(|i| f(slope(x, i)) / count).sum::<f64>();
        vec![sum(f64::cos) - span, sum(f64::sin) - rise]
    });
    let mut heights = vec![0.0];
    for i in 0..n {
        heights.push(heights[i] + slope(&x, i).sin() / count);
    }
    let tension = |i: usize| x[0] / slope(&x, i).cos();
    (x[0], [tension(0), tension(n - 1)], heights)
}

/// Tip of a chain of n links of total length `length` \[m\] let go level at rest, after `time` \[s\]: across and up
/// \[m\]. The exact equations of motion in the angles.
pub fn chain_swing(n: usize, length: f64, time: f64) -> [f64; 2] {
    rod_swing(n, length, 0.0, 0.0, &[time])[0]
}

/// The same at several times, in ascending order, with elastic joints and a clamped start (`bending` is EI over the
/// mass of the whole \[m^3 / s^2\]; a pin where it is zero) and a drag, a force per velocity and mass \[1/s\]. Each
/// piece between times has the integrator's 2000 steps: they have to resolve the highest mode.
pub fn rod_swing(n: usize, length: f64, bending: f64, drag: f64, times: &[f64]) -> Vec<[f64; 2]> {
    let l = length / n as f64;
    let carried = beyond(&masses(n));
    let joint = bending / l;
    let slope = |_: f64, y: &[f64], dy: &mut [f64]| {
        let (angle, rate) = y.split_at(n);
        let mut mass = DMatrix::zeros(n, n);
        let mut right = DVector::zeros(n);
        for i in 0..n {
            for j in 0..n {
                let m = carried[i.max(j)] * l * l;
                let (sin, cos) = (angle[i] - angle[j]).sin_cos();
                mass[(i, j)] = m * cos;
                right[i] -= m * (sin * rate[j] * rate[j] + cos * drag * rate[j]);
            }
            right[i] -= super::material::GRAVITY * l * carried[i] * angle[i].sin();
            right[i] -= if i == 0 { 2.0 * joint * (angle[0] - FRAC_PI_2) } else { joint * (angle[i] - angle[i - 1]) };
            if i + 1 < n {
                right[i] += joint * (angle[i + 1] - angle[i]);
            }
        }
        let acceleration = mass.cholesky().map_or_else(|| DVector::from_element(n, f64::NAN), |c| c.solve(&right));
        dy[..n].copy_from_slice(rate);
        dy[n..].copy_from_slice(acceleration.as_slice());
    };
    let (mut y, mut now) = ([vec![FRAC_PI_2; n], vec![0.0; n]].concat(), 0.0);
    let at = |time: &f64| {
        y = integrate(&y, time - now, slope);
        now = *time;
        [y[..n].iter().map(|a| l * a.sin()).sum(), y[..n].iter().map(|a| -l * a.cos()).sum()]
    };
    times.iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::super::elastica;
    use super::*;

    /// Second order toward the elastica: errors of the drop at n = 10, 20, 40 are 0.47, 0.12, 0.029 %.
    #[test]
    fn cantilevers() {
        let [_, exact, _] = elastica::tip_load(1.0);
        for (n, error) in [(10, 0.0047), (20, 0.0012), (40, 0.00029)] {
            let got = cantilever(n, 1.0, 0.0)[1] / exact - 1.0;
            assert!((got - error).abs() < 0.06 * error, "{n}: {got}");
        }
        let (coarse, fine) = (cantilever(40, 0.0, 10.0)[1] - 0.700_200, cantilever(80, 0.0, 10.0)[1] - 0.700_200);
        assert!((coarse / fine - 4.0).abs() < 0.1, "{coarse} {fine}");
    }

    #[test]
    fn columns() {
        for (n, part) in [(5, 0.967_531), (10, 0.991_802), (20, 0.997_946)] {
            let got = critical_load(n, End::Pinned, End::Pinned) / std::f64::consts::PI.powi(2);
            assert!((got - part).abs() < 1e-6, "{n}: {got}");
        }
        let [free, _, one, both] = elastica::critical_loads();
        for (end, want) in [(End::Free, free), (End::Pinned, one), (End::Clamped, both)] {
            let error = |n| critical_load(n, End::Clamped, end) / want - 1.0;
            assert!(
                error(40).abs() < 4e-3 && (error(40) / error(80) - 4.0).abs() < 0.1,
                "{end:?}: {} {}",
                error(40),
                error(80)
            );
        }
        let error = |n| heavy_column(n) / elastica::heavy_column() - 1.0;
        assert!(error(40).abs() < 2e-3 && (error(40) / error(80) - 4.0).abs() < 0.1);
    }

    #[test]
    fn chains() {
        for (n, want) in [(10, [1.19886, 2.65821, 3.88463]), (20, [1.20152, 2.73349, 4.16512])] {
            for (got, want) in chain_modes(n).iter().zip(want) {
                assert!((got.0 - want).abs() < 6e-6, "{n}: {} {want}", got.0);
            }
        }
        for (n, sag, h) in [(10, 0.402_185, 0.114_739), (20, 0.399_137, f64::NAN), (40, 0.398_427, f64::NAN)] {
            let (force, [a, b], heights) = catenary(n, 0.5, 0.0);
            assert!(
                (-heights[n / 2] - sag).abs() < 6e-7
                    && (h.is_nan() || (force - h).abs() < 6e-7)
                    && (a - b).abs() < 1e-12,
                "{n}"
            );
        }
        // The continuous one with d = 0.5, h = 0.2.
        let (force, [a, b], heights) = catenary(400, 0.5, 0.2);
        let lowest = heights.iter().copied().fold(0.0, f64::min);
        assert!((force - 0.116_761).abs() < 2e-6 && (lowest + 0.297_244).abs() < 1e-5, "{force} {lowest}");
        assert!((a - 0.414_005).abs() < 2e-3 && (b - 0.614_005).abs() < 2e-3);
    }

    #[test]
    fn a_chain_let_go_level() {
        for (time, x, z) in [(0.08, 87.5726, -31.3920), (0.12, 56.3512, -70.6262), (0.20, -66.7834, -43.8165)] {
            let got = chain_swing(10, 0.1, time);
            assert!((got[0] * 1e3 - x).abs() < 2e-4 && (got[1] * 1e3 - z).abs() < 2e-4, "{time}: {got:?}");
        }
    }

    /// With drag a stiff rod that hangs from a clamp comes to the drop of a cantilever: k = 0, g = rho A g L^3 / EI.
    #[test]
    fn a_rod_let_go_level_comes_to_rest_as_a_cantilever() {
        let (n, length, g) = (5, 0.1, 5.0);
        let got = rod_swing(n, length, super::super::material::GRAVITY * length.powi(2) / g, 30.0, &[0.5, 1.0, 1.5])[2];
        let want = cantilever(n, 0.0, g);
        assert!(
            (got[0] / length - want[0]).abs() < 1e-6 && (got[1] / length + want[1]).abs() < 1e-6,
            "{got:?} {want:?}"
        );
    }

    #[test]
    fn cantilevers_vibrate() {
        let beta: [f64; 2] = [1.875_104_1, 4.694_091_1];
        for (mode, beta) in beta.iter().enumerate() {
            let error = |n| cantilever_modes(n)[mode].0 / (beta * beta) - 1.0;
            assert!(error(40).abs() < 1e-2 && (error(40) / error(80) - 4.0).abs() < 0.1, "{} {}", error(40), error(80));
        }
    }
}
