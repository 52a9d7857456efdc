//! Euler's elastica: cantilevers and buckled columns.

use super::numeric::{integrate, root};
use ellip::{ellipe, ellipeinc, ellipf, ellipk};
use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

fn or_nan<E>(value: Result<f64, E>) -> f64 {
    value.unwrap_or(f64::NAN)
}

/// Tip of a cantilever under a dead load k = P L^2 / EI: distance along, drop, slope \[rad\]. By elliptic integrals.
pub fn tip_load(k: f64) -> [f64; 3] {
    let modulus = |slope: f64| {
        let m = 0.5 * (1.0 + slope.sin());
        (m, (1.0 / (SQRT_2 * m.sqrt())).asin())
    };
    let length = |slope: f64| {
        let (m, phi) = modulus(slope);
        or_nan(ellipk(m)) - or_nan(ellipf(phi, m)) - k.sqrt()
    };
    let slope = root(1e-9, FRAC_PI_2 - 1e-12, length);
    let (m, phi) = modulus(slope);
    [(2.0 * slope.sin() / k).sqrt(), 1.0 - 2.0 / k.sqrt() * (or_nan(ellipe(m)) - or_nan(ellipeinc(phi, m))), slope]
}

/// Tip of a cantilever under its own weight g = w L^3 / EI: distance along, drop, slope \[rad\]. By shooting.
pub fn self_weight(g: f64) -> [f64; 3] {
    // Downward slope a at the distance t from the tip: a'' = -g t cos a, a'(0) = 0, and a(1) = 0 at the clamp.
    let shot = |tip: f64| {
        integrate(&[tip, 0.0, 0.0, 0.0], 1.0, |t, y, dy| {
            dy.copy_from_slice(&[y[1], -g * t * y[0].cos(), y[0].cos(), y[0].sin()]);
        })
    };
    // Of the solutions the one nearest to hanging straight down: the others swing across the vertical.
    let mut low = FRAC_PI_2 - 1e-4;
    while shot(low)[0] > 0.0 {
        low -= 0.2 * (FRAC_PI_2 - low);
    }
    let slope = root(low, FRAC_PI_2, |tip| shot(tip)[0]);
    let y = shot(slope);
    [y[2], y[3], slope]
}

/// Shape of the cantilever under a dead tip load: (along, drop) at `n + 1` places.
pub fn tip_load_shape(k: f64, n: usize) -> Vec<(f64, f64)> {
    let clamp_curvature = k * tip_load(k)[0];
    (0..=n)
        .map(|i| {
            let s = i as f64 / n as f64;
            if i == 0 {
                return (0.0, 0.0);
            }
            // a'' = -k cos a, with the moment at the clamp from the table of the tip.
            let y = integrate(&[0.0, clamp_curvature, 0.0, 0.0], s, |_, y, dy| {
                dy.copy_from_slice(&[y[1], -k * y[0].cos(), y[0].cos(), y[0].sin()]);
            });
            (y[2], y[3])
        })
        .collect()
}

/// A column pinned at both ends whose ends have come together by `shortening` of its length: load over Euler's pi^2 EI
/// / L^2, and deflection in the middle.
pub fn buckled(shortening: f64) -> [f64; 2] {
    let chord = |k: f64| 2.0 * or_nan(ellipe(k * k)) / or_nan(ellipk(k * k)) - 1.0;
    let k = root(1e-9, 0.999, |k| 1.0 - chord(k) - shortening);
    let quarter = or_nan(ellipk(k * k));
    [(2.0 * quarter / PI).powi(2), k / quarter]
}

/// Euler's loads P L^2 / EI: clamped and free, pinned, clamped and pinned, clamped at both ends.
pub fn critical_loads() -> [f64; 4] {
    let x = root(4.3, 4.6, |x| x.tan() - x);
    [PI * PI / 4.0, PI * PI, x * x, 4.0 * PI * PI]
}

/// Greatest weight w L^3 / EI of a column clamped at its foot: Greenhill 1881, J_{-1/3}(2/3 sqrt g) = 0.
pub fn heavy_column() -> f64 {
    // J_{-1/3} as its power series; the root is near 1.87, where ten terms do.
    let bessel = |z: f64| {
        let mut term = 1.0;
        let mut sum = 0.0;
        for k in 0..30_i32 {
            sum += term;
            term *= -(0.25 * z * z) / (f64::from(k + 1) * (f64::from(k + 1) - 1.0 / 3.0));
        }
        sum
    };
    2.25 * root(1.5, 2.2, bessel).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close<const N: usize>(got: [f64; N], want: [f64; N], digits: f64) {
        for (g, w) in got.iter().zip(want) {
            assert!((g - w).abs() <= digits, "{got:?} {want:?}");
        }
    }

    /// Mattiasson 1981 has the same numbers.
    #[test]
    fn cantilever_under_a_tip_load() {
        for (k, x, drop, slope) in [
            (0.1, 0.999_335, 0.033_295, 0.049_954),
            (1.0, 0.943_567, 0.301_721, 0.461_352),
            (5.0, 0.612_372, 0.713_792, 1.215_368),
            (10.0, 0.445_004, 0.810_609, 1.430_286),
            (20.0, 0.316_114, 0.868_696, 1.532_935),
        ] {
            close(tip_load(k), [x, drop, slope], 6e-7);
        }
        let shape = tip_load_shape(2.0, 10);
        close([shape[10].0, shape[10].1], [0.839_358, 0.493_457], 6e-7);
    }

    #[test]
    fn cantilever_under_its_weight() {
        for (g, x, drop, slope) in [
            (0.5, 0.997_779, 0.062_306, 0.083_137),
            (2.0, 0.966_893, 0.238_507, 0.321_594),
            (10.0, 0.656_354, 0.700_200, 1.052_643),
            (50.0, 0.245_015, 0.907_917, 1.526_453),
        ] {
            close(self_weight(g), [x, drop, slope], 6e-7);
        }
    }

    #[test]
    fn columns() {
        for (e, p, w) in [(0.02, 1.010_114, 0.089_467), (0.1, 1.052_987, 0.194_924), (0.5, 1.349_449, 0.373_306)] {
            close(buckled(e), [p, w], 6e-7);
        }
        close(critical_loads(), [2.467_401, 9.869_604, 20.190_729, 39.478_418], 6e-7);
        close([heavy_column()], [7.837_347], 6e-7);
    }
}
