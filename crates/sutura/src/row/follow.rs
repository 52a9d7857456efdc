//! Friction of sliding firm rows follows their normal forces. In the rods' matrix the friction force of such a row has
//! a fixed size, mu times the normal force that presses now: a matrix in which it followed would not be symmetric.
//! Letting it follow from one Newton iteration to the next is a fixed-point iteration whose error shrinks as (mu phi)^k
//! / k! along one strand around a post, so it grows at first; where both strands of a knot slide it was seen to grow to
//! the end.
//!
//! So each Newton step is corrected: the changes `v` of the sizes solve
//!
//! ```text
//! v = mu (N(z) - N),    z = z0 + (A^-1 with the contacts that press) G^T d v
//! ```
//!
//! with N(z) the normal force that the step z leads to and d the direction of the friction. That is a linear system of
//! one unknown per row; products with its matrix take two solutions of the rods, since their factor is there, and GMRES
//! (Saad and Schultz 1986) needs a few of them: along a thread friction only hands on tension from row to row.

use crate::effort::Effort;
use crate::rod::scratch::RodScratch;
use crate::row::{Rows, system};
use glam::DVec3;

/// Products after which GMRES ends.
const MOST: usize = 8;

/// Part of the correction that may be left.
const LEFT: f64 = 0.1;

/// How often the rows that press are looked at again.
const PASSES: usize = 2;

/// Memory of the corrections.
#[derive(Default)]
pub(crate) struct Follow {
    /// Firm rows that slide.
    rows: Vec<u32>,
    /// Friction that is missing at each row \[N\].
    missing: Vec<f64>,
    basis: Vec<f64>,
    change: Vec<f64>,
    step: Vec<DVec3>,
    border: Vec<f64>,
    active: Vec<bool>,
}

/// Corrects the step by the friction that its normal forces call for.
pub(crate) fn follow(rods: &mut RodScratch, rows: &mut Rows, effort: &mut Effort) {
    let mut memory = core::mem::take(&mut rows.follow);
    memory.rows.clear();
    memory.rows.extend(rows.shapes.iter().enumerate().filter(|(_, r)| r.slides()).map(|(k, _)| k as u32));
    if !memory.rows.is_empty() {
        memory.correct(rods, rows, effort);
    }
    rows.follow = memory;
}

impl Follow {
    fn correct(&mut self, rods: &mut RodScratch, rows: &mut Rows, effort: &mut Effort) {
        let m = self.rows.len();
        for _ in 0..PASSES {
            self.missing.clear();
            self.active.clear();
            let mut due = false;
            let largest = self.rows.iter().map(|k| rows.shapes[*k as usize].normal_force).fold(0.0, f64::max);
            for k in &self.rows {
                let (missing, active) = rows.shapes[*k as usize].missing(&rods.step, &rows.movers, &rows.border);
                due |= missing.abs() > 0.5 * crate::params::OFF_BALANCE * largest;
                self.missing.push(missing);
                self.active.push(active);
            }
            if !due {
                return;
            }
            self.solve(rods, rows, effort, m);
            for (k, v) in self.rows.iter().zip(&self.change) {
                rows.shapes[*k as usize].grow(*v);
            }
            // The contacts find their forces anew, and the step takes up both.
            self.push(rods, rows);
            system::again(rods, rows, effort, &mut self.step);
        }
    }

    /// Leaves in `step`, and at the border, the forces of the changes.
    fn push(&mut self, rods: &RodScratch, rows: &mut Rows) {
        self.step.clear();
        self.step.resize(rods.step.len(), DVec3::ZERO);
        for (k, v) in self.rows.iter().zip(&self.change) {
            let Rows { shapes, movers, border, .. } = rows;
            shapes[*k as usize].push(*v, &mut self.step, movers, border);
        }
    }

    /// `change <- change - d(mu N)` along the step that it causes.
    fn product(&mut self, rods: &mut RodScratch, rows: &mut Rows, effort: &mut Effort) {
        self.push(rods, rows);
        self.border.clear();
        rows.border.swap_steps(&mut self.border);
        system::pressed_response(rods, rows, effort, &mut self.step);
        for ((k, v), active) in self.rows.iter().zip(&mut self.change).zip(&self.active) {
            if *active {
                *v -= rows.shapes[*k as usize].gained(&self.step, &rows.movers, &rows.border);
            }
        }
        rows.border.swap_steps(&mut self.border);
    }

    /// GMRES: leaves in `change` what takes away all but a small part of `missing`.
    fn solve(&mut self, rods: &mut RodScratch, rows: &mut Rows, effort: &mut Effort, m: usize) {
        let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let size = norm(&self.missing);
        self.basis.clear();
        self.basis.extend(self.missing.iter().map(|x| x / size));
        // Column j of the Hessenberg matrix made triangular by rotations, and the right side turned with it.
        let mut h = [[0.0f64; MOST + 1]; MOST];
        let (mut turn, mut right) = ([(1.0, 0.0); MOST], [0.0; MOST + 1]);
        right[0] = size;
        let mut count = 0;
        while count < MOST {
            let j = count;
            self.change.clear();
            self.change.extend_from_slice(&self.basis[j * m..(j + 1) * m]);
            self.product(rods, rows, effort);
            for i in 0..=j {
                let b = &self.basis[i * m..(i + 1) * m];
                let part: f64 = self.change.iter().zip(b).map(|(x, y)| x * y).sum();
                h[j][i] = part;
                for (x, y) in self.change.iter_mut().zip(b) {
                    *x -= part * y;
                }
            }
            let rest = norm(&self.change);
            self.basis.extend(self.change.iter().map(|x| if rest > 0.0 { x / rest } else { 0.0 }));
            for (i, (c, s)) in turn[..j].iter().enumerate() {
                (h[j][i], h[j][i + 1]) = (c * h[j][i] + s * h[j][i + 1], c * h[j][i + 1] - s * h[j][i]);
            }
            let length = (h[j][j] * h[j][j] + rest * rest).sqrt();
            if length.is_nan() || length <= 0.0 {
                break;
            }
            let (c, s) = (h[j][j] / length, rest / length);
            turn[j] = (c, s);
            h[j][j] = length;
            (right[j], right[j + 1]) = (c * right[j], -s * right[j]);
            count += 1;
            if right[count].abs() <= LEFT * size {
                break;
            }
        }
        let mut y = [0.0; MOST];
        for j in (0..count).rev() {
            let known: f64 = (j + 1..count).map(|k| h[k][j] * y[k]).sum();
            y[j] = (right[j] - known) / h[j][j];
        }
        self.change.clear();
        self.change.resize(m, 0.0);
        for (j, y) in y[..count].iter().enumerate() {
            for (x, b) in self.change.iter_mut().zip(&self.basis[j * m..(j + 1) * m]) {
                *x += y * b;
            }
        }
    }
}
